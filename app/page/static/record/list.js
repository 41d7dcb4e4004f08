// The list of recorded games.

import {make} from '../panels/dom.js';

const WHEN = new Intl.DateTimeFormat(undefined, {dateStyle: 'medium', timeStyle: 'short'});

/** A table of games, each with a button that opens it. */
export function gameList(games, open) {
  if (games.length === 0) return make('p', {class: 'tm-sentence'}, 'Play one: every game is recorded.');
  const rows = games.map((game) => {
    const name = game.sets_up ? `Setting up for game ${game.number}` : `${game.white ?? '?'} – ${game.black ?? '?'}`;
    const button = make('button', {type: 'button', class: 'tm-button', onclick: () => open(game.id)}, name);
    const extras = [game.film && 'film', game.telemetry && 'telemetry'].filter(Boolean).join(', ');
    return make(
      'tr',
      {},
      make('th', {scope: 'row'}, button),
      make('td', {}, game.began ? WHEN.format(new Date(game.began)) : ''),
      make('td', {}, game.result ?? ''),
      make('td', {}, game.plies === 1 ? '1 ply' : `${game.plies} plies`),
      make('td', {class: 'tm-wide'}, extras),
    );
  });
  const head = ['Game', 'Begun', 'Result', 'Length'].map((text) => make('th', {scope: 'col'}, text));
  head.push(make('th', {scope: 'col', class: 'tm-wide'}, 'With'));
  return make(
    'div',
    {class: 'tm-scroll', tabindex: '0', role: 'region', 'aria-label': 'Recorded games'},
    make(
      'table',
      {class: 'tm-table'},
      make('caption', {class: 'tm-hidden'}, 'Recorded games, the newest first'),
      make('thead', {}, make('tr', {}, ...head)),
      make('tbody', {}, ...rows),
    ),
  );
}
