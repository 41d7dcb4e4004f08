// A recorded game by plant time: which moment it is, and the sections of the page's state at that moment.

/** What is under way at each moment, with where every piece is: made once of record.json. */
export class Timeline {
  constructor(record) {
    this.record = record;
    this.game = record.game;
    [this.start, this.end] = record.span;
    this.moments = record.moments;
    this.times = record.moments.map(({t}) => t);
    const known = new Map(record.game.pieces.map((piece) => [piece.name, piece]));
    let at = {};
    this.pieces = record.moments.map(({moved}) => {
      if (Object.keys(moved).length > 0) at = {...at, ...moved};
      return at;
    });
    this.known = [...known.values()];
    // when each ply that counts was done: the last moment at which there was one ply fewer
    this.plies = record.game.moves.map((move, index) => {
      const done = record.moments.findLastIndex(
        ({event, plies, fen}) => event === 'ply' && plies === index + 1 && fen === move.fen,
      );
      return {...move, number: index + 1, t: done < 0 ? this.end : this.times[done]};
    });
  }

  /** Index of the moment that holds at a time: the last one that is not later. */
  at(t) {
    let [low, high] = [0, this.times.length - 1];
    while (low < high) {
      const middle = Math.ceil((low + high) / 2);
      if (this.times[middle] <= t) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  /** The sections `game`, `viewing`, `clock` and `phase` at a moment. */
  sections(index) {
    const {fen, plies, held, text, event} = this.moments[index];
    const {moves, start} = this.game;
    const follows = (plies === 0 ? start : moves[plies - 1]?.fen) === fen;
    const last = plies > 0 && follows ? moves[plies - 1] : null;
    const at = this.pieces[index];
    const game = {
      ...this.game,
      fen,
      held,
      turn: fen.split(' ')[1] === 'b' ? 'black' : 'white',
      check: last && /[+#]/.test(last.san) ? kingOf(fen) : null,
      last: last ? [last.uci.slice(0, 2), last.uci.slice(2, 4)] : null,
      legal: {},
      promoting: [],
      moves: follows ? moves : [],
      pieces: this.known.map((piece) => ({...piece, at: at[piece.name] ?? piece.at})),
      assists: true,
    };
    const clock = last?.clock
      ? {white: last.clock.white ?? null, black: last.clock.black ?? null, running: null, age: 0}
      : null;
    const phase = event === 'step' ? `${text}${held ? ` ${this.#words(held)}` : ''}` : text;
    return {game, viewing: follows && plies < moves.length ? plies : null, clock, phase};
  }

  #words(name) {
    const piece = this.known.find((one) => one.name === name);
    return piece ? `${piece.colour} ${piece.kind}` : name;
  }

  /** Time at which a ply was done; 0: the beginning. */
  timeOf(ply) {
    return ply <= 0 ? this.start : (this.plies[Math.min(ply, this.plies.length) - 1]?.t ?? this.end);
  }

  /** The number of plies done at a time. */
  pliesAt(t) {
    return this.plies.filter((ply) => ply.t <= t + 1e-6).length;
  }
}

/** The square of the king whose turn it is. */
function kingOf(fen) {
  const [rows, turn] = fen.split(' ');
  const wanted = turn === 'b' ? 'k' : 'K';
  for (const [row, text] of rows.split('/').entries()) {
    let file = 0;
    for (const letter of text) {
      if (letter === wanted) return `${'abcdefgh'[file]}${8 - row}`;
      file += /\d/.test(letter) ? Number(letter) : 1;
    }
  }
  return null;
}
