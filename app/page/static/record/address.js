// Game and moment in the address's fragment, so that a link leads to a moment: #game=ID&t=12.34

/** What the fragment names: `game` and `t` [s], null where it does not. */
export function readPlace() {
  const fields = new URLSearchParams(window.location.hash.slice(1));
  const t = Number(fields.get('t'));
  return {game: fields.get('game'), t: fields.has('t') && Number.isFinite(t) ? t : null};
}

/** Puts game and moment into the fragment without a new entry of the history; null: takes them out. */
export function writePlace(game, t) {
  const fields = game === null ? '' : `#${new URLSearchParams({game, ...(t === null ? {} : {t: t.toFixed(2)})})}`;
  if (window.location.hash === fields) return;
  window.history.replaceState(
    window.history.state,
    '',
    `${window.location.pathname}${window.location.search}${fields}`,
  );
}
