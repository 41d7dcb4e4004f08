/** The recorded games. */

import {button, make} from '../dom.js';
import {openDialog} from './dialog.js';

/**
 * Open the list.
 * @param {import('../store.js').Store} store
 */
export async function openGames(store) {
  const list = make('ol', {class: 'games'});
  const note = make('p', {class: 'muted', role: 'status'}, 'Loading the list…');
  const dialog = openDialog({title: 'Recorded games', name: 'games', wide: true, content: [note, list]});
  let games;
  try {
    const answer = await fetch('/games', {headers: {accept: 'application/json'}});
    if (!answer.ok) throw new Error(`${answer.status} ${answer.statusText}`);
    games = await answer.json();
  } catch (error) {
    note.textContent = `The list could not be loaded (${error.message}). Close this and try again.`;
    return;
  }
  const shown = games.filter((game) => !game.sets_up);
  note.textContent = shown.length === 0 ? 'No game has been recorded yet.' : '';
  note.hidden = shown.length > 0;
  list.replaceChildren(...shown.map((game) => make(
    'li', {class: 'game'},
    make(
      'div', {class: 'game-what'},
      make('strong', {}, `${game.white ?? '?'} – ${game.black ?? '?'}`),
      make('span', {class: 'muted'}, [when(game.began), counted(Math.ceil(game.plies / 2)), game.reason].filter(Boolean).join(' · ')),
    ),
    make('span', {class: 'game-result'}, (game.result ?? '*').replaceAll('1/2', '½').replace('*', 'unfinished')),
    make(
      'div', {class: 'game-links'},
      button('Show', 'go', () => {
        dialog.close();
        if (store.get('record') === game.id) store.set('record', game.id);  // once more: it is seen, or read again
        else store.showRecord(game.id);
      }, {'aria-label': `Show ${game.white ?? '?'} – ${game.black ?? '?'}, ${when(game.began)}`}),
      make('a', {href: `/games/${game.id}/report.html`, target: '_blank', rel: 'noopener'}, 'Report'),
    ),
  )));
}

function counted(moves) {
  return moves === 1 ? '1 move' : `${moves} moves`;
}

function when(text) {
  const date = new Date(text);
  return Number.isNaN(date.valueOf()) ? '' : date.toLocaleString([], {dateStyle: 'medium', timeStyle: 'short'});
}
