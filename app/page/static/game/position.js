/** Positions: what stands where in a FEN, and in words. */

export const FILES = 'abcdefgh';
const ROLES = {p: 'pawn', n: 'knight', b: 'bishop', r: 'rook', q: 'queen', k: 'king'};
export const LETTERS = {pawn: 'p', knight: 'n', bishop: 'b', rook: 'r', queen: 'q', king: 'k'};
const VALUES = {pawn: 1, knight: 3, bishop: 3, rook: 5, queen: 9};
const FULL = {queen: 1, rook: 2, bishop: 2, knight: 2, pawn: 8};
export const START = 'rnbqkbnr/pppppppp/8/8/8/8/PPPPPPPP/RNBQKBNR w KQkq - 0 1';
export const EMPTY = '8/8/8/8/8/8/8/8';

/**
 * What stands on each square that is not empty.
 * @param {string} fen
 * @returns {Map<string, {role: string, color: 'white' | 'black'}>}
 */
export function piecesOf(fen) {
  const pieces = new Map();
  for (const [row, text] of fen.split(' ')[0].split('/').entries()) {
    let file = 0;
    for (const letter of text) {
      if (letter >= '1' && letter <= '8') {
        file += Number(letter);
      } else {
        const role = ROLES[letter.toLowerCase()];
        if (role !== undefined) {
          pieces.set(`${FILES[file]}${8 - row}`, {role, color: letter === letter.toLowerCase() ? 'black' : 'white'});
        }
        file += 1;
      }
    }
  }
  return pieces;
}

/** The first field of a FEN from what stands where. */
export function placement(pieces) {
  const rows = [];
  for (let rank = 8; rank >= 1; rank -= 1) {
    let row = '';
    let gap = 0;
    for (const file of FILES) {
      const piece = pieces.get(`${file}${rank}`);
      if (piece === undefined) {
        gap += 1;
        continue;
      }
      const letter = LETTERS[piece.role];
      row += (gap || '') + (piece.color === 'white' ? letter.toUpperCase() : letter);
      gap = 0;
    }
    rows.push(row + (gap || ''));
  }
  return rows.join('/');
}

/** Whose turn it is in a FEN. */
export function turnOf(fen) {
  return fen.split(' ')[1] === 'b' ? 'black' : 'white';
}

/**
 * What each side has lost, counted against a full set: what a promotion has brought does not count as lost twice.
 * @param {string} fen
 * @returns {{white: string[], black: string[], lead: number}} roles that White's, Black's set lacks, from queen to pawn, and
 *   White's lead in material [pawns].
 */
export function material(fen) {
  const there = {white: {}, black: {}};
  let lead = 0;
  for (const {role, color} of piecesOf(fen).values()) {
    there[color][role] = (there[color][role] ?? 0) + 1;
    lead += (color === 'white' ? 1 : -1) * (VALUES[role] ?? 0);
  }
  const lacks = {white: [], black: []};
  for (const color of ['white', 'black']) {
    let promoted = 0;
    for (const [role, full] of Object.entries(FULL)) {
      const has = there[color][role] ?? 0;
      promoted += role === 'pawn' ? 0 : Math.max(0, has - full);
      const missing = Math.max(0, full - has - (role === 'pawn' ? promoted : 0));
      lacks[color].push(...Array(missing).fill(role));
    }
  }
  return {...lacks, lead};
}

/** A square and what stands there, in words: "e4, white pawn" or "e5, empty". */
export function described(square, pieces) {
  const piece = pieces.get(square);
  return piece === undefined ? `${square}, empty` : `${square}, ${piece.color} ${piece.role}`;
}

/** A move in short algebraic notation as one says it: "knight takes f3, check". */
export function spoken(san) {
  if (san.startsWith('O-O-O')) return `castles queen side${ending(san)}`;
  if (san.startsWith('O-O')) return `castles king side${ending(san)}`;
  const found = /^([KQRBN]?)([a-h]?[1-8]?)(x?)([a-h][1-8])(?:=([QRBN]))?/.exec(san);
  if (found === null) return san;
  const [, letter, from, takes, target, promoted] = found;
  const words = [letter === '' ? (takes === '' ? '' : from) : ROLES[letter.toLowerCase()]];
  if (letter !== '') words.push(from);
  words.push(takes === '' ? '' : 'takes', target);
  if (promoted !== undefined) words.push('becomes a', ROLES[promoted.toLowerCase()]);
  return words.filter((word) => word !== '').join(' ') + ending(san);
}

function ending(san) {
  if (san.includes('#')) return ', checkmate';
  return san.includes('+') ? ', check' : '';
}

/** Time left as chess clocks show it: 1:02:03, 4:05, below 20 s with tenths; rounded down, so that what is shown is there. */
export function clockText(seconds) {
  const tenths = Math.max(0, Math.floor(10 * seconds + 1e-6));
  const whole = Math.floor(tenths / 10);
  const hours = Math.floor(whole / 3600);
  const minutes = Math.floor(whole / 60) % 60;
  const rest = String(whole % 60).padStart(2, '0');
  if (hours > 0) return `${hours}:${String(minutes).padStart(2, '0')}:${rest}`;
  return `${minutes}:${rest}${whole < 20 ? `.${tenths % 10}` : ''}`;
}

/** Whether a game has ended, with a result or without. */
export function isOver(game) {
  return game !== null && (game.reason !== null || game.result !== '*');
}

/** Whether somebody to play against is being looked for elsewhere. */
export function seeks(remote) {
  return remote !== null && remote.name === null;
}

/** How a game has ended, for people: "0-1 · checkmate". */
export function outcome({result, reason}) {
  const score = result === '*' ? '' : result.replaceAll('1/2', '½');
  return [score, reason].filter(Boolean).join(' · ') || 'not finished';
}

/** The other side. */
export function other(side) {
  return side === 'white' ? 'black' : 'white';
}
