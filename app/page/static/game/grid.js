/**
 * The board for the keyboard and for screen readers: 64 labelled cells over the pictures.
 *
 * One cell is in the tab order; arrows move, Enter and Space lift and put down, Escape cancels.
 */

import {make} from '../dom.js';
import {FILES, described} from './position.js';

const STEPS = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1]};

/**
 * Lay the grid over a board.
 * @param {Element} frame that the board fills.
 * @param {any} board what `mountBoard` returns, or what works like it; its `keyed(event, square)`, where it has one, takes
 *   other keys, and says whether it did.
 * @param {(sentence: string) => void} announce reads a sentence out.
 * @param {string} label of the grid.
 */
export function layGrid(frame, board, announce, label) {
  const cells = [];  // row by row as seen
  const grid = make('div', {
    class: 'grid', role: 'grid', 'aria-label': label,
    onkeydown: keyed, onclick: (event) => pressed(event.target.closest('[role="gridcell"]')),
  });
  for (let row = 0; row < 8; row += 1) {
    const line = make('div', {role: 'row'});
    for (let column = 0; column < 8; column += 1) {
      const cell = make('div', {role: 'gridcell', tabindex: -1});
      cells.push(cell);
      line.append(cell);
    }
    grid.append(line);
  }
  frame.append(grid);
  let current = squareAt(0, 6);  // e2, or e7, once the side is known
  let turned = null;

  function squareAt(column, row) {
    return board.orientation() === 'white' ? `${FILES[column]}${8 - row}` : `${FILES[7 - column]}${row + 1}`;
  }

  function update() {
    if (turned !== board.orientation()) {
      const inGrid = grid.contains(document.activeElement);
      turned = board.orientation();
      if (!inGrid) current = turned === 'white' ? 'e2' : 'e7';
    }
    const pieces = board.pieces();
    const lifted = board.lifted();
    const targets = lifted === undefined ? [] : board.targets(lifted);
    for (const [index, cell] of cells.entries()) {
      const square = squareAt(index % 8, Math.floor(index / 8));
      const note = square === lifted ? ', lifted' : targets.includes(square) ? ', can go here' : '';
      const label = described(square, pieces) + note;
      if (cell.getAttribute('aria-label') !== label) cell.setAttribute('aria-label', label);
      cell.dataset.square = square;
      cell.setAttribute('aria-selected', String(square === lifted));
      cell.tabIndex = square === current ? 0 : -1;
    }
  }

  function focus(square) {
    current = square;
    update();
    cells.find((cell) => cell.dataset.square === square).focus();
  }

  function pressed(cell) {
    if (cell === null) return;
    const square = cell.dataset.square;
    current = square;
    const before = board.lifted();
    const could = before !== undefined && board.targets(before).includes(square);
    board.press(square);
    if (could) return;  // what comes of it is announced as any move
    if (board.lifted() === square) {
      const targets = board.targets(square);
      announce(`${described(square, board.pieces())}, lifted; it can go to ${targets.join(', ') || 'no square'}`);
    } else if (before !== undefined) {
      announce(before === square ? 'put back' : `it cannot go to ${square}`);
    } else if (board.movable() === undefined) {
      announce('no move can be made here now');
    } else {
      announce(`${described(square, board.pieces())}: not yours to move`);
    }
  }

  function keyed(event) {
    const cell = event.target.closest('[role="gridcell"]');
    if (cell === null || event.altKey || event.metaKey) return;
    const index = cells.indexOf(cell);
    const [column, row] = [index % 8, Math.floor(index / 8)];
    const step = STEPS[event.key];
    if (step !== undefined) {
      const next = [column + step[0], row + step[1]];
      if (next.every((at) => at >= 0 && at < 8)) focus(squareAt(...next));
    } else if (event.key === 'Home') {
      focus(squareAt(0, event.ctrlKey ? 0 : row));
    } else if (event.key === 'End') {
      focus(squareAt(7, event.ctrlKey ? 7 : row));
    } else if (event.key === 'Enter' || event.key === ' ') {
      pressed(cell);
    } else if (event.key === 'Escape' && board.lifted() !== undefined) {
      board.cancel();
      announce('put back');
    } else if (!board.keyed?.(event, cell.dataset.square)) {
      return;
    }
    event.preventDefault();
  }

  board.listen(update);
  update();
}
