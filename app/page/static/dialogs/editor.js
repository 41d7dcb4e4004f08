/** Any position, set up by dragging, by clicking or from the keyboard. */

import {Chessground} from '../vendor/chessground/chessground.min.js';
import {button, make} from '../dom.js';
import {layGrid} from '../game/grid.js';
import {EMPTY, START, piecesOf, placement} from '../game/position.js';
import {choices, openDialog, toggle} from './dialog.js';
import {openNewGame} from './newgame.js';

const ROLES = ['king', 'queen', 'rook', 'bishop', 'knight', 'pawn'];
const KEYS = {k: 'king', q: 'queen', r: 'rook', b: 'bishop', n: 'knight', p: 'pawn'};
/** Where king and rook stand for each right to castle. */
const RIGHTS = {
  K: ['White, king side', 'e1', 'h1', 'white'], Q: ['White, queen side', 'e1', 'a1', 'white'],
  k: ['Black, king side', 'e8', 'h8', 'black'], q: ['Black, queen side', 'e8', 'a8', 'black'],
};

/** Open the editor from the game's buttons: what is set up becomes a new game. */
export async function openEditor(store) {
  const fen = await editPosition(store.get('game')?.fen);
  if (fen !== null) openNewGame(store, fen);
}

/** What is wrong with a position; null: nothing that can be seen without the rules of the whole game. */
export function problemOf(pieces) {
  const all = [...pieces];
  for (const color of ['white', 'black']) {
    const name = color === 'white' ? 'White' : 'Black';
    const kings = all.filter(([, piece]) => piece.role === 'king' && piece.color === color).length;
    if (kings !== 1) return `${name} needs one king, and has ${kings}`;
    const pawns = all.filter(([, piece]) => piece.role === 'pawn' && piece.color === color).length;
    if (pawns > 8) return `${name} has ${pawns} pawns; there are 8`;
  }
  const lost = all.find(([square, {role}]) => role === 'pawn' && '18'.includes(square[1]));
  return lost === undefined ? null : `No pawn can stand on ${lost[0]}`;
}

/**
 * Let somebody set a position up.
 * @param {string | undefined} fen to begin with.
 * @returns {Promise<string | null>} its FEN; null: they think better of it.
 */
export function editPosition(fen = START) {
  return new Promise((resolve) => {
    const listeners = new Set();
    let answer = null;
    let turn = 'white';
    let rights = new Set();
    let loaded = {position: '', rest: ''};  // what a FEN says beside the position holds as long as that is not changed
    let tool = null;  // a piece that clicks put down, 'none' for an empty square, or null: pieces are dragged

    const wrap = make('div', {class: 'editor-board'});
    const frame = make('div', {class: 'editor-frame'}, wrap);
    const fenField = make('input', {
      id: 'editor-fen', type: 'text', autocomplete: 'off', spellcheck: 'false', 'aria-label': 'Position as FEN',
      onchange: () => load(fenField.value.trim()),
    });
    const problem = make('p', {class: 'problem', role: 'status'});
    const use = button('Play from here', null, () => {
      answer = fenText();
      dialog.close();
    }, {class: 'primary'});
    const tools = new Map();
    const palette = ['white', 'black'].map((color) => make(
      'div', {class: 'palette', role: 'group', 'aria-label': `${color === 'white' ? 'White' : 'Black'} pieces`},
      ...ROLES.map((role) => paletteButton({role, color})),
    ));
    const eraser = make('button', {
      type: 'button', 'aria-pressed': 'false', class: 'eraser', onclick: () => choose('none'),
    }, 'Empty a square');
    tools.set('none', eraser);
    const side = choices('To move', 'editor-turn', [['white', 'White'], ['black', 'Black']], 'white', (value) => {
      turn = value;
      changed();
    });
    const castling = Object.entries(RIGHTS).map(([letter, [words]]) => {
      const box = toggle(words, false, (on) => {
        if (on) rights.add(letter);
        else rights.delete(letter);
        changed();
      });
      return [letter, box];
    });

    const dialog = openDialog({
      title: 'Set up a position', wide: true, name: 'editor',
      content: [make(
        'div', {class: 'editor'},
        make('div', {class: 'editor-left'}, palette[1], frame, palette[0]),
        make(
          'div', {class: 'editor-right'},
          make(
            'div', {class: 'words'},
            button('Start position', null, () => load(START)), button('Clear', null, () => load(`${EMPTY} w - - 0 1`)),
            button('Flip', 'flip', () => {
              board.toggleOrientation();
              tell();
            }), eraser,
          ),
          side,
          make('fieldset', {class: 'choice'}, make('legend', {}, 'May still castle'), make('div', {class: 'rights'}, ...castling.map(([, box]) => box))),
          make('label', {class: 'field'}, make('span', {}, 'FEN'), fenField),
          make('p', {class: 'muted'}, 'Drag pieces, or choose one and click squares. On the board, letters put pieces down: K is White’s king, k Black’s; Delete empties a square.'),
          problem,
          make('div', {class: 'dialog-actions'}, button('Cancel', null, () => dialog.close()), use),
        ),
      )],
      closed: () => {
        board.destroy();
        resolve(answer);
      },
    });

    const board = Chessground(wrap, {
      fen: EMPTY, coordinates: true, animation: {enabled: false}, premovable: {enabled: false},
      movable: {free: true, color: 'both', rookCastle: false}, autoCastle: false, drawable: {enabled: false},
      draggable: {deleteOnDropOff: true, showGhost: true}, highlight: {lastMove: false},
      events: {change: changed, select: (square) => tool !== null && put(square)},
    });
    const adapter = {
      orientation: () => board.state.orientation,
      pieces: () => board.state.pieces,
      lifted: () => (tool === null ? board.state.selected : undefined),
      targets: () => [],
      movable: () => 'both',
      press: (square) => (tool === null ? board.selectSquare(square) : put(square)),
      cancel: () => board.cancelMove(),
      listen: (callback) => listeners.add(callback),
      keyed: (event, square) => {
        const role = KEYS[event.key.toLowerCase()];
        if (role !== undefined && !event.ctrlKey) {
          set(square, {role, color: event.key === event.key.toLowerCase() ? 'black' : 'white'});
        } else if (event.key === 'Delete' || event.key === 'Backspace') {
          set(square, undefined);
        } else {
          return false;
        }
        return true;
      },
    };
    layGrid(frame, adapter, () => {}, 'Position: arrow keys move, letters put pieces down, Delete empties a square');
    load(fen);

    function paletteButton(piece) {
      const made = make(
        'button',
        {
          type: 'button', 'aria-pressed': 'false', 'aria-label': `${piece.color} ${piece.role}`,
          // dragged from here onto the board, or clicked to put down many
          onmousedown: (event) => event.button === 0 && board.dragNewPiece(piece, event, true),
          ontouchstart: (event) => board.dragNewPiece(piece, event, true),
          onclick: () => choose(piece),
        },
        make('span', {class: 'cg-wrap still'}, make('piece', {class: `${piece.role} ${piece.color}`})),
      );
      tools.set(`${piece.color} ${piece.role}`, made);
      return made;
    }

    function nameOf(one) {
      return one === null || one === 'none' ? one : `${one.color} ${one.role}`;
    }

    function choose(next) {
      tool = nameOf(tool) === nameOf(next) ? null : next;
      for (const [name, made] of tools) made.setAttribute('aria-pressed', String(name === nameOf(tool)));
      board.cancelMove();
      board.set({draggable: {enabled: tool === null}, selectable: {enabled: tool === null}});
    }

    function put(square) {
      const there = board.state.pieces.get(square);
      const same = tool !== 'none' && there?.role === tool.role && there.color === tool.color;
      set(square, tool === 'none' || same ? undefined : {...tool});
    }

    function set(square, piece) {
      board.setPieces(new Map([[square, piece]]));
      changed();
    }

    function tell() {
      for (const callback of listeners) callback();
    }

    function load(text) {
      const [where, whose, castles, ...rest] = text.split(/\s+/);
      const rows = where.split('/');
      const width = (row) => [...row].reduce((sum, letter) => sum + (Number(letter) || 1), 0);
      if (rows.length !== 8 || !rows.every((row) => /^[pnbrqkPNBRQK1-8]+$/.test(row) && width(row) === 8)) {
        problem.textContent = 'This is not a FEN: eight rows of pieces, such as 8/8/8/4k3/8/4K3/8/8 w - - 0 1';
        return;
      }
      board.set({fen: where});
      turn = whose === 'b' ? 'black' : 'white';
      side.querySelector(`input[value="${turn}"]`).checked = true;
      rights = new Set([...(castles ?? '')].filter((letter) => letter in RIGHTS));
      const whole = rest.length === 3 && /^(-|[a-h][36]) \d+ [1-9]\d*$/.test(rest.join(' '));
      loaded = {position: position(), rest: whole ? rest.join(' ') : ''};
      changed();
    }

    function position() {
      const letters = Object.keys(RIGHTS).filter((letter) => rights.has(letter)).join('');
      return `${placement(board.state.pieces)} ${turn === 'white' ? 'w' : 'b'} ${letters || '-'}`;
    }

    function fenText() {
      const now = position();
      return `${now} ${(now === loaded.position && loaded.rest) || '- 0 1'}`;
    }

    function changed() {
      const pieces = board.state.pieces;
      for (const [letter, box] of castling) {
        const [, king, rook, color] = RIGHTS[letter];
        const home = [[king, 'king'], [rook, 'rook']].every(([square, role]) => {
          const piece = pieces.get(square);
          return piece?.role === role && piece.color === color;
        });
        if (!home) rights.delete(letter);
        const input = box.querySelector('input');
        input.disabled = !home;
        input.checked = rights.has(letter);
      }
      fenField.value = fenText();
      const wrong = problemOf(piecesOf(fenField.value));
      problem.textContent = wrong ?? '';
      use.disabled = wrong !== null;
      tell();
    }
  });
}
