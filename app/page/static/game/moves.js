/** The list of moves, and walking through the game: the board shows what stood then, until one goes back to the game. */

import {byId, icon, make, takesKeys} from '../dom.js';
import {isOver, outcome, spoken} from './position.js';


/**
 * Make the list.
 * @param {import('../store.js').Store} store
 */
export function mountMoves(store) {
  const opening = make('p', {class: 'opening'});
  const list = make('ol', {class: 'moves', 'aria-label': 'Moves of the game'});
  const result = make('p', {class: 'result', hidden: true});
  const scroll = make('div', {class: 'move-scroll', tabindex: 0, role: 'group', 'aria-label': 'Moves, scrolling'}, list, result);
  const steps = [
    ['first', 'First position', () => go(0)],
    ['back', 'One move back', () => go(at() - 1)],
    ['forth', 'One move forward', () => go(at() + 1)],
    ['last', 'Newest position', () => go(Infinity)],
  ].map(([picture, words, act]) => make(
    'button', {type: 'button', class: 'quiet', 'aria-label': words, title: words, onclick: act}, icon(picture),
  ));
  const back = make('button', {type: 'button', class: 'back-to-game', onclick: () => go(Infinity), hidden: true}, 'Back to the game');
  byId('moves').append(
    make('div', {class: 'moves-head'}, make('h2', {}, 'Moves'), opening),
    scroll,
    make('div', {class: 'steps'}, ...steps, back),
  );
  let drawn = null;   // what the list was made from
  let buttons = [];

  function plies() {
    return store.get('game')?.moves.length ?? 0;
  }

  function at() {
    return store.get('viewing') ?? plies();
  }

  function go(ply) {
    if (plies() === 0) return;  // in a record also where moves were played that were taken back: its end is not theirs
    const wanted = Math.max(0, Math.min(ply, plies()));
    store.set('viewing', wanted === plies() ? null : wanted);
  }

  function draw() {
    const game = store.get('game');
    const moves = game?.moves ?? [];
    const key = `${game?.id} ${game?.start} ${moves.map((move) => move.san).join(' ')}`;
    if (key !== drawn) {
      drawn = key;
      makeList(game, moves);
      const viewing = store.get('viewing');
      if (viewing !== null && viewing >= moves.length) store.set('viewing', null);  // what stood then stands again
    }
    opening.textContent = game?.opening ? `${game.opening.eco} ${game.opening.name}` : '';
    opening.title = opening.textContent;
    const over = isOver(game);
    result.hidden = !over || game.sets_up;
    if (over) result.textContent = outcome(game);
    mark();
  }

  function makeList(game, moves) {
    buttons = moves.map((move, index) => make(
      'button',
      {type: 'button', class: 'move', 'aria-label': spoken(move.san), onclick: () => go(index + 1)},
      move.san,
    ));
    const [, turn, , , , full] = (game?.start ?? '').split(' ');
    const late = turn === 'b' ? 1 : 0;
    const number = Number(full) || 1;
    const rows = [];
    for (let index = -late; index < moves.length; index += 2) {
      rows.push(make(
        'li', {},
        make('span', {class: 'number'}, `${number + (index + late) / 2}`),
        index < 0 ? make('span', {class: 'move none'}, '…') : buttons[index],
        buttons[index + 1] ?? make('span', {class: 'move none'}),
      ));
    }
    list.replaceChildren(...(rows.length > 0 ? rows : [make('li', {class: 'empty'}, 'No move yet')]));
  }

  function mark() {
    const here = at();
    for (const [index, button] of buttons.entries()) {
      if (index === here - 1) button.setAttribute('aria-current', 'true');
      else button.removeAttribute('aria-current');
    }
    const viewing = store.get('viewing') !== null;
    back.hidden = !viewing || store.get('record') !== null;  // a record's newest position is not the game that is played
    for (const step of steps.slice(0, 2)) step.disabled = here === 0;
    for (const step of steps.slice(2)) step.disabled = !viewing;
    // only the list scrolls, never the page
    const current = buttons[here - 1];
    if (here === 0) scroll.scrollTop = 0;
    if (current !== undefined) {
      const box = current.closest('li');
      if (scroll.scrollHeight > scroll.clientHeight) {
        scroll.scrollTop = box.offsetTop - scroll.clientHeight / 2 + box.offsetHeight / 2;
      }
      if (scroll.scrollWidth > scroll.clientWidth) {
        scroll.scrollLeft = current.offsetLeft - scroll.clientWidth / 2 + current.offsetWidth / 2;
      }
    }
  }

  store.subscribe('game', draw);
  store.subscribe('viewing', mark);
  store.subscribe('record', mark);
  document.addEventListener('keydown', (event) => {
    if (event.altKey || event.ctrlKey || event.metaKey || event.shiftKey || takesKeys(event.target)) return;
    const to = {ArrowLeft: at() - 1, ArrowRight: at() + 1, Home: 0, End: Infinity}[event.key];
    if (to === undefined) return;
    event.preventDefault();
    go(to);
  });
}
