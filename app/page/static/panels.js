/**
 * The views of the robot, one at a time; a view's module is loaded when it is first opened.
 *
 * Each module exports `mount(element, store)`, which is called once. A view that is closed stays in the page, hidden: it looks
 * at `element.hidden`, or listens for the events 'shown' and 'hidden' at its element, and asks the store for telemetry and
 * pictures (`store.watch`) only while it is shown.
 */

import {byId} from './dom.js';

const VIEWS = {
  robot: () => import('./robot.js'),
  camera: () => import('./camera.js'),
  plots: () => import('./plots.js'),
  record: () => import('./record.js'),
};

/**
 * Make the tabs work.
 * @param {import('./store.js').Store} store
 */
export function mountPanels(store) {
  const names = Object.keys(VIEWS);
  const tabs = names.map((name) => byId(`tab-${name}`));
  const mounted = new Set();
  let open = null;

  async function show(name) {
    if (open === name) return;
    for (const [index, other] of names.entries()) {
      const panel = byId(other);
      const chosen = other === name;
      tabs[index].setAttribute('aria-selected', String(chosen));
      if (chosen || name !== null) tabs[index].tabIndex = chosen ? 0 : -1;
      if (panel.hidden === chosen) {
        panel.hidden = !chosen;
        panel.dispatchEvent(new Event(chosen ? 'shown' : 'hidden'));
      }
    }
    open = name;
    if (name !== 'record') store.remember('panel', name);
    if (name !== null && !mounted.has(name)) {
      mounted.add(name);
      const panel = byId(name);
      panel.classList.add('loading');
      try {
        (await VIEWS[name]()).mount(panel, store);
      } catch (error) {
        mounted.delete(name);
        panel.textContent = 'This view could not be loaded. Open it again to try once more.';
        console.error(error);
      } finally {
        panel.classList.remove('loading');
      }
    }
  }

  for (const [index, tab] of tabs.entries()) {
    tab.addEventListener('click', () => show(open === names[index] ? null : names[index]));
    tab.addEventListener('keydown', (event) => {
      const step = {ArrowRight: 1, ArrowLeft: -1}[event.key];
      if (step === undefined) return;
      event.preventDefault();
      event.stopPropagation();
      const there = tabs.filter((one) => !one.hidden);
      const next = there[(there.indexOf(tab) + step + there.length) % there.length];
      next.focus();
      show(names[tabs.indexOf(next)]);
    });
  }

  // what there is to see depends on the rig; where there is room for it the arm is shown, once the board has been drawn
  let first = true;
  store.subscribe('session', (session) => {
    const robot = session?.rig !== undefined && session.rig !== 'board';
    for (const name of ['robot', 'plots']) byId(`tab-${name}`).hidden = !robot;
    byId('tab-camera').hidden = !session?.sees;
    byId('panels').hidden = !robot && store.get('record') === null;
    if (!robot || !first) return;
    first = false;
    const wanted = store.remembered('panel', window.matchMedia('(min-width: 70rem)').matches ? 'robot' : null);
    if (wanted !== null && wanted in VIEWS && wanted !== 'record') requestIdleCallback(() => open ?? show(wanted), {timeout: 1000});
  });

  // a recorded game that is chosen is shown where records are shown
  store.subscribe('record', (id) => {
    byId('tab-record').hidden = id === null;
    const robot = !byId('tab-robot').hidden;
    byId('panels').hidden = !robot && id === null;
    if (id !== null) show('record');
    else if (open === 'record') show(robot ? 'robot' : null);
  });
  return {show};
}
