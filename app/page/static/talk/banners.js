/** Lines across the page that say what has changed for everything on it: a connection that is lost, an arm that was stopped. */

import {byId, icon, make} from '../dom.js';

/** Make the place for them. */
export function makeBanners() {
  const place = byId('banners');
  const shown = new Map();

  /**
   * Show a banner, or take it away.
   * @param {string} name
   * @param {{kind: 'note' | 'warning' | 'danger', text: string, actions?: Node[]} | null} banner
   */
  function set(name, banner) {
    const key = banner === null ? '' : `${banner.kind} ${banner.text}`;
    if ((shown.get(name)?.key ?? '') === key) return;
    shown.get(name)?.element.remove();
    shown.delete(name);
    if (banner === null) return;
    const picture = {note: 'note', warning: 'warning', danger: 'warning'}[banner.kind];
    const element = make(
      'div', {class: `banner ${banner.kind}`, 'data-banner': name},
      icon(picture), make('p', {}, banner.text), make('div', {class: 'banner-actions'}, ...(banner.actions ?? [])),
    );
    place.append(element);
    shown.set(name, {key, element});
  }

  return {set};
}

/**
 * What the connection, the program and refusals have to say.
 * @param {import('../store.js').Store} store
 * @param {ReturnType<typeof makeBanners>} banners
 */
export function mountNews(store, banners) {
  let timer = 0;
  let seen = false;

  function connection() {
    const state = store.get('connection');
    seen = seen || state === 'open';
    document.body.classList.toggle('away', state === 'away');
    const text = seen
      ? 'The connection to the game is lost. What you see is its last known state; this page reconnects by itself.'
      : 'The game cannot be reached. This page tries again by itself.';
    banners.set('connection', state === 'away' ? {kind: 'warning', text} : null);
  }

  function refused(text) {
    if (text === null) return;
    clearTimeout(timer);
    const close = make('button', {type: 'button', class: 'quiet', onclick: () => banners.set('refused', null)}, 'Close');
    banners.set('refused', {kind: 'note', text: text.charAt(0).toUpperCase() + text.slice(1), actions: [close]});
    timer = setTimeout(() => banners.set('refused', null), 8000);
  }

  store.subscribe('connection', connection);
  store.subscribe('refused', refused);
  store.subscribe('session', (session) => {
    const ended = session !== null && session.live === false;
    document.body.classList.toggle('ended', ended);
    document.title = ended ? 'Touchmove: ended' : 'Touchmove';
  });
}
