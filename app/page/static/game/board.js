/**
 * The board: shows the game, an earlier position, or a move that is not recorded yet; takes moves by click, drag and touch.
 *
 * A move that was sent is pending: it is drawn, marked, and taken back if the game asks for a move again without it.
 */

import {Chessground} from '../vendor/chessground/chessground.min.js';
import {byId} from '../dom.js';
import {EMPTY, isOver, piecesOf, placement, turnOf} from './position.js';
import {askPromotion} from './promotion.js';

const STILL = window.matchMedia('(prefers-reduced-motion: reduce)');

/**
 * Make the board.
 * @param {import('../store.js').Store} store
 */
export function mountBoard(store) {
  const listeners = new Set();
  let flipped = store.remembered('flipped', false);
  let pending = null;  // {line, fen: placement with the move made, squares, plies, game, prompt}
  let choosing = false;
  let picker = null;   // takes squares in place of moves: (square) => void
  let said = {id: 0, squares: [], plies: 0};
  let marks = [];      // squares that something else on the page points at

  const board = Chessground(byId('board'), {
    fen: EMPTY,
    coordinates: true,
    autoCastle: true,
    animation: {enabled: !STILL.matches, duration: 180},
    premovable: {enabled: false},
    draggable: {showGhost: true, distance: 4},
    drawable: {enabled: false, visible: true},
    movable: {free: false, showDests: true, events: {after: moved}},
    events: {select: selected},
  });

  /** What the board shows: a position and what belongs to it; null while there is no game. */
  function shown() {
    const game = store.get('game');
    if (game === null) {  // what it begins from is known before the devices are open, and players there
      const start = store.get('record') === null ? store.get('session')?.start : null;
      return start ? {fen: start, turn: turnOf(start), last: null, check: false, live: true} : null;
    }
    const viewing = store.get('viewing');
    if (viewing !== null && viewing < game.moves.length) {
      const before = viewing === 0 ? null : game.moves[viewing - 1];
      const fen = before === null ? game.start : before.fen;
      const last = before === null ? null : [before.uci.slice(0, 2), before.uci.slice(2, 4)];
      return {fen, turn: turnOf(fen), last, check: /[+#]/.test(before?.san ?? ''), live: false};
    }
    if (pending !== null) {
      return {fen: pending.fen, turn: game.turn, last: pending.squares, check: false, live: true};
    }
    return {fen: game.fen, turn: game.turn, last: game.last, check: game.check !== null, live: true};
  }

  /** Whose pieces this browser may move now; undefined: nobody's. */
  function movable() {
    const [game, prompt, session] = ['game', 'prompt', 'session'].map(store.get);
    const asked = game !== null && !isOver(game) && prompt?.turn === true && store.holds();
    const byHand = session !== null && session.sees && !session.hands;  // then pieces are moved, and seen
    return asked && !byHand && pending === null && !choosing && picker === null && shown().live ? game.turn : undefined;
  }

  function orientation() {
    const side = store.get('game')?.person ?? store.get('session')?.person ?? 'white';
    return (side === 'black') !== flipped ? 'black' : 'white';
  }

  function legal() {
    return new Map(Object.entries(store.get('game')?.legal ?? {}));
  }

  function lit() {
    const squares = new Map();
    const add = (names, what) => {
      for (const name of names) squares.set(name, `${squares.get(name) ?? ''} ${what}`.trim());
    };
    if (pending !== null && shown()?.live) add(pending.squares, 'pending');
    if (shown()?.live) add(store.get('prompt')?.squares ?? [], 'lit');
    if (shown()?.live && said.plies === store.get('game')?.moves.length) add(said.squares, 'lit');
    add(marks, 'lit');
    return squares;
  }

  function draw() {
    const now = shown();
    if (now === null) return;
    const mine = movable();
    const fen = now.fen.split(' ')[0];
    board.set({
      orientation: orientation(),
      ...(fen === board.getFen() ? {} : {fen}),  // what is being dragged stays in the fingers where nothing has changed
      turnColor: now.turn,
      lastMove: now.last ?? [],
      check: now.check ? now.turn : false,
      selectable: {enabled: mine !== undefined},
      draggable: {enabled: mine !== undefined},
      movable: {color: mine, dests: mine === undefined ? new Map() : legal()},
      highlight: {lastMove: true, check: true, custom: lit()},
      animation: {enabled: !STILL.matches},
    });
    byId('board').classList.toggle('earlier', !now.live);
    byId('board').classList.toggle('picking', picker !== null);
    tell();
  }

  function tell() {
    for (const callback of listeners) callback();
  }

  function selected(square) {
    if (picker !== null) picker(square);
    tell();
  }

  async function moved(from, to) {
    const game = store.get('game');
    const prompt = store.get('prompt');
    if (prompt === null) {
      draw();
      return;
    }
    let line = from + to;
    if (game.promoting.some(([source, target]) => source === from && target === to)) {
      choosing = true;
      const letter = await askPromotion(game.turn, to);
      choosing = false;
      if (letter === null) {
        draw();
        return;
      }
      line += letter;
    }
    send(line, from, to, game, prompt);
  }

  function send(line, from, to, game, prompt) {
    if (store.get('game')?.fen !== game.fen || store.get('prompt')?.id !== prompt.id || !store.say(line)) {
      draw();  // it was taken back, decided or asked anew meanwhile
      return;
    }
    const pieces = piecesOf(game.fen);
    made(pieces, line, from, to);
    pending = {
      line, fen: placement(pieces), squares: [from, to], plies: game.moves.length, game: game.id, prompt: prompt.id,
    };
    draw();
  }

  function settled() {
    const game = store.get('game');
    const prompt = store.get('prompt');
    if (pending === null || game === null) return;
    const elsewhere = game.id !== pending.game || game.moves.length !== pending.plies || isOver(game);
    const askedAgain = prompt !== null && prompt.id !== pending.prompt;
    if (elsewhere || askedAgain || store.get('connection') !== 'open') pending = null;
  }

  /** Lift what stands on a square, or put down there what is lifted; as a click does. */
  function press(square) {
    if (picker !== null) {
      picker(square);
      return;
    }
    board.selectSquare(square);
    tell();
  }

  function cancel() {
    board.cancelMove();
    tell();
  }

  /** Let somebody pick squares instead of moving pieces; null: pieces are moved again. */
  function pick(next) {
    picker = next;
    board.cancelMove();
    draw();
  }

  /** Light squares that something on the page is about. */
  function mark(squares) {
    marks = squares;
    draw();
  }

  function flip() {
    flipped = !flipped;
    store.remember('flipped', flipped);
    draw();
    store.set('orientation', orientation());
  }

  store.subscribe('game', () => {
    settled();
    draw();
    store.set('orientation', orientation());
  });
  for (const section of ['session', 'controls', 'viewing']) store.subscribe(section, draw);
  store.subscribe('connection', () => {
    settled();
    draw();
  });
  store.subscribe('prompt', () => {
    settled();
    draw();
  });
  store.subscribe('refused', () => {
    pending = null;
    draw();
  });
  store.subscribe('log', (log) => {
    // what was said last lights its squares, until something else is said
    const last = (log ?? []).findLast((entry) => entry.kind === 'say' || entry.kind === 'heard');
    if (last === undefined || last.id === said.id) return;
    const plies = store.get('game')?.moves.length ?? 0;
    said = {id: last.id, squares: last.kind === 'say' ? last.squares ?? [] : [], plies};
    draw();
  });
  STILL.addEventListener('change', draw);

  return {
    press, cancel, flip, pick, mark, orientation, movable,
    /** Call back whenever what is shown, or what is lifted, has changed. */
    listen: (callback) => listeners.add(callback),
    /** What stands where on the board as shown. */
    pieces: () => piecesOf(shown()?.fen ?? ''),
    /** The square that is lifted from; undefined: nothing is lifted. */
    lifted: () => board.state.selected,
    /** Where a piece of a square may go, if this browser may move it now. */
    targets: (square) => (movable() === undefined ? [] : legal().get(square) ?? []),
    /** Whether a move is being made that is not recorded yet. */
    pending: () => pending,
  };
}

/** Make a move among pieces as it will look: castling, en passant and promotion too. */
function made(pieces, line, from, to) {
  const piece = pieces.get(from);
  const there = pieces.get(to);
  const captures = there !== undefined;
  pieces.delete(from);
  if (piece.role === 'king' && there?.role === 'rook' && there.color === piece.color) {  // castling in Chess960
    const [king, rook] = from < to ? ['g', 'f'] : ['c', 'd'];
    pieces.delete(to);
    pieces.set(king + from[1], piece);
    pieces.set(rook + from[1], there);
    return;
  }
  if (piece.role === 'pawn' && from[0] !== to[0] && !captures) pieces.delete(to[0] + from[1]);
  if (piece.role === 'king' && Math.abs(from.charCodeAt(0) - to.charCodeAt(0)) === 2) {
    const rook = {c: ['a', 'd'], g: ['h', 'f']}[to[0]];
    pieces.set(rook[1] + from[1], pieces.get(rook[0] + from[1]));
    pieces.delete(rook[0] + from[1]);
  }
  const roles = {q: 'queen', r: 'rook', b: 'bishop', n: 'knight'};
  pieces.set(to, line.length === 5 ? {role: roles[line[4]], color: piece.color} : piece);
}
