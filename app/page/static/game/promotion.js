/** Which piece a pawn becomes: asked over the board, by pointer or keyboard. */

import {stopButton} from '../dialogs/dialog.js';
import {make} from '../dom.js';

const CHOICES = [['q', 'queen'], ['n', 'knight'], ['r', 'rook'], ['b', 'bishop']];

/**
 * Ask.
 * @param {'white' | 'black'} colour of the pawn.
 * @param {string} square where it arrives.
 * @returns {Promise<string | null>} letter of the piece; null: they think better of it.
 */
export function askPromotion(colour, square) {
  return new Promise((resolve) => {
    const choose = (letter) => {
      dialog.close();
      dialog.remove();
      resolve(letter);
    };
    const buttons = CHOICES.map(([letter, role]) => make(
      'button',
      {type: 'button', class: 'promotion-choice', 'aria-label': role, onclick: () => choose(letter)},
      make('span', {class: 'cg-wrap still'}, make('piece', {class: `${role} ${colour}`})),
      make('span', {'aria-hidden': 'true'}, role),
    ));
    const dialog = make(
      'dialog',
      {
        class: 'promotion', 'aria-label': `What does the pawn on ${square} become?`,
        oncancel: (event) => {
          event.preventDefault();
          choose(null);
        },
        onkeydown: (event) => {
          const at = buttons.indexOf(document.activeElement);
          const step = {ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1}[event.key];
          if (step !== undefined) {
            event.preventDefault();
            buttons[(at + step + buttons.length) % buttons.length].focus();
          } else if (CHOICES.some(([letter]) => letter === event.key.toLowerCase())) {
            event.preventDefault();
            choose(event.key.toLowerCase());
          }
        },
        onclick: (event) => {
          if (event.target === dialog) choose(null);
        },
      },
      make('header', {class: 'promotion-head'}, make('h2', {}, 'Promote to'), stopButton()),
      make('div', {class: 'choices'}, ...buttons),
    );
    document.getElementById('dialogs').append(dialog);
    dialog.showModal();
    buttons[0].focus();
  });
}
