/** The simulated hand: told by squares what to do, legal or not, to see how the robot takes it. */

import {byId, button, make} from '../dom.js';

const VERBS = {
  move: ['Move any piece', 'Choose the piece, then where it goes'],
  knock: ['Knock a piece over', 'Choose the piece'],
  hover: ['Hold the hand over a square', 'Choose the square'],
  rest: ['Rest the hand on a square', 'Choose the square'],
};

/**
 * Make its buttons.
 * @param {import('../store.js').Store} store
 * @param {ReturnType<typeof import('../game/board.js').mountBoard>} board
 * @param {Element} place
 */
export function mountHand(store, board, place) {
  const buttons = Object.entries(VERBS).map(([verb, [label]]) => button(label, 'hand', () => begin(verb), {'data-hand': verb}));
  const group = make('fieldset', {class: 'hand', hidden: true}, make('legend', {}, 'The simulated hand'), ...buttons);
  place.append(group);
  const notice = make(
    'div', {class: 'picking-note', hidden: true},
    make('p', {}), make('button', {type: 'button', onclick: end}, 'Cancel'),
  );
  byId('table').append(notice);
  let verb = null;
  let chosen = [];

  function begin(next) {
    verb = next;
    chosen = [];
    notice.querySelector('p').textContent = VERBS[verb][1];
    notice.hidden = false;
    board.pick(picked);
  }

  function end() {
    verb = null;
    notice.hidden = true;
    board.mark([]);
    board.pick(null);
  }

  function picked(square) {
    chosen.push(square);
    board.mark(chosen);
    if (chosen.length < (verb === 'move' ? 2 : 1)) {
      notice.querySelector('p').textContent = `${square}: where does it go?`;
      return;
    }
    const line = `hand ${verb} ${chosen.join(' ')}`;
    end();
    store.say(line);
  }

  document.addEventListener('keydown', (event) => {
    if (event.key === 'Escape' && verb !== null) end();
  });
  function draw() {
    const session = store.get('session');
    group.hidden = session === null || !session.hands;
    for (const made of buttons) made.disabled = !store.holds();
    if (verb !== null && !store.holds()) end();
  }
  for (const section of ['session', 'controls', 'connection']) store.subscribe(section, draw);
}
