/** What was said, and how the devices are. */

import {byId, capital, icon, make} from '../dom.js';
import {isOver, seeks} from '../game/position.js';

const KEPT = 200;
const MARKS = {say: 'say', heard: 'heard', phase: 'phase', trouble: 'warning'};
const WHO = {say: 'Robot', heard: 'You', phase: 'Now', trouble: 'Trouble'};

/**
 * Make the log and the list of devices.
 * @param {import('../store.js').Store} store
 * @param {(squares: string[]) => void} mark lights squares on the board.
 */
export function mountLog(store, mark) {
  const list = make('ol');
  const box = make('div', {class: 'said', role: 'log', 'aria-live': 'polite', 'aria-label': 'What was said', tabindex: 0}, list);
  byId('log').append(box);
  let newest = 0;
  let follows = true;

  store.subscribe('log', (log) => {
    const entries = log ?? [];
    const first = newest === 0 || (entries.at(-1)?.id ?? 0) < newest;
    if (first) {
      list.replaceChildren();
      newest = 0;
    }
    for (const entry of entries.filter(({id}) => id > newest)) {
      // of what is being done only the newest is news, until something is said
      if (entry.kind === 'phase' && list.lastChild?.className === 'phase') list.lastChild.remove();
      list.append(line(entry));
      newest = entry.id;
    }
    while (list.children.length > KEPT) list.firstChild.remove();
    toEnd();
  });

  // who has scrolled back reads on in peace
  function toEnd() {
    if (follows) box.scrollTop = box.scrollHeight;
  }
  box.addEventListener('scroll', () => {
    follows = box.scrollHeight - box.scrollTop - box.clientHeight < 40;
  });
  new ResizeObserver(toEnd).observe(box);

  function line({kind, text, squares}) {
    const about = squares ?? [];
    const item = make(
      'li', {class: kind},
      icon(MARKS[kind] ?? 'say'),
      make('span', {class: 'unseen'}, `${WHO[kind] ?? 'Robot'}: `),
      make('span', {class: 'words'}, kind === 'heard' ? text : capital(text)),
    );
    if (about.length > 0) {
      item.addEventListener('pointerenter', () => mark(about));
      item.addEventListener('pointerleave', () => mark([]));
    }
    return item;
  }

  const devices = make('ul', {class: 'device-list'});
  byId('devices').append(devices);
  store.subscribe('devices', (all) => {
    byId('devices').hidden = (all ?? []).length === 0;
    devices.replaceChildren(...(all ?? []).map(({name, ok, text}) => {
      const state = ok === true ? 'well' : ok === false ? 'not well' : 'not known';
      return make(
        'li', {class: `device ${ok === true ? 'well' : ok === false ? 'ill' : 'unknown'}`},
        icon(ok === true ? 'well' : ok === false ? 'ill' : 'unknown'),
        make('span', {class: 'device-name'}, capital(name), make('span', {class: 'unseen'}, `, ${state}: `)),
        make('span', {class: 'device-text'}, text),
      );
    }));
  });

  /** What is asked counts for more than what was done last; the clocks in it have gone on since. */
  function drawPhase() {
    const idle = (isOver(store.get('game')) && !seeks(store.get('remote'))) || store.get('session')?.live === false;
    const asked = store.get('prompt')?.text.replace(/ \([\d:.]+ - [\d:.]+\)/, '');
    const now = asked || (idle ? '' : store.get('phase')) || '';
    byId('phase-text').textContent = capital(now);
    byId('phase').hidden = now === '';
  }
  for (const section of ['phase', 'prompt', 'game', 'session', 'remote']) store.subscribe(section, drawPhase);
}
