/** The strips above and below the board: who plays, what they have taken, and their clock, which counts down by itself. */

import {byId, make} from '../dom.js';
import {clockText, isOver, material, other} from './position.js';

const LOW = 20;    // a clock that shows less is low [s]
const BEAT = 100;  // between two looks at a running clock [ms]

/**
 * Make both strips.
 * @param {import('../store.js').Store} store
 * @param {(side: 'white' | 'black') => void} low told when a side's time becomes low.
 */
export function mountPlayers(store, low) {
  const strips = {far: strip(byId('far')), near: strip(byId('near'))};
  const warned = {white: false, black: false};
  let timer = 0;

  function strip(element) {
    const parts = {
      dot: make('span', {class: 'dot', 'aria-hidden': 'true'}),
      name: make('span', {class: 'name'}),
      taken: make('span', {class: 'taken cg-wrap still'}),
      clock: make('span', {class: 'clock', role: 'timer', hidden: true}),
    };
    element.append(parts.dot, make('span', {class: 'who'}, parts.name, parts.taken), parts.clock);
    return {element, ...parts, key: ''};
  }

  function sides() {
    const near = store.get('orientation') ?? 'white';
    return {far: other(near), near};
  }

  function names() {
    const game = store.get('game');
    const there = material(game?.fen ?? '8/8/8/8/8/8/8/8');
    for (const [place, side] of Object.entries(sides())) {
      const {element, name, taken, dot} = strips[place];
      const title = game === null ? '' : game[side];
      if (name.textContent !== title) name.textContent = title;
      element.dataset.side = side;
      dot.className = `dot ${side}`;
      element.classList.toggle('on-move', game !== null && !isOver(game) && game.turn === side);
      const lead = side === 'white' ? there.lead : -there.lead;
      const roles = game === null || game.sets_up ? [] : there[other(side)];
      const key = `${side} ${roles.join(' ')} ${lead}`;
      if (strips[place].key === key) continue;
      strips[place].key = key;
      taken.replaceChildren(...roles.map((role) => make('piece', {class: `${role} ${other(side)}`})));
      if (roles.length > 0 || lead > 0) {
        const words = `${roles.length > 0 ? `has taken ${counted(roles)}` : ''}${lead > 0 ? ` leads by ${lead}` : ''}`;
        taken.append(make('span', {class: 'unseen'}, words));
        if (lead > 0) taken.append(make('span', {class: 'lead', 'aria-hidden': 'true'}, `+${lead}`));
      }
    }
  }

  function left(clock, side) {
    if (clock[side] === null || clock[side] === undefined) return null;
    const passed = clock.running === side ? (clock.age ?? 0) + (performance.now() - clock.arrived) / 1000 : 0;
    return clock[side] - Math.max(0, passed - (clock.free ?? 0));  // with a delay it stands first
  }

  function tick() {
    const clock = store.get('clock');
    // what counts on after the connection is lost, or the game is over, would be made up
    const away = store.get('connection') !== 'open' || store.get('session')?.live === false || isOver(store.get('game'));
    for (const [place, side] of Object.entries(sides())) {
      const {clock: face} = strips[place];
      const rest = clock === null ? null : left(away ? {...clock, running: null} : clock, side);
      face.hidden = rest === null;
      if (rest === null) continue;
      const text = clockText(rest);
      if (face.textContent !== text) face.textContent = text;
      const running = clock.running === side && !away;
      face.classList.toggle('running', running);
      face.classList.toggle('low', rest < LOW);
      face.setAttribute('aria-label', `${side === 'white' ? "White's" : "Black's"} clock${running ? ', running' : ''}`);
      if (rest < LOW && running && !warned[side]) low(side);
      warned[side] = rest < LOW;
    }
    const runs = clock?.running && !away;
    if (runs && timer === 0) timer = setInterval(tick, BEAT);
    if (!runs && timer !== 0) {
      clearInterval(timer);
      timer = 0;
    }
  }

  function draw() {
    names();
    tick();
  }
  for (const section of ['game', 'orientation', 'session']) store.subscribe(section, draw);
  for (const section of ['clock', 'connection']) store.subscribe(section, tick);
}

function counted(roles) {
  const numbers = new Map();
  for (const role of roles) numbers.set(role, (numbers.get(role) ?? 0) + 1);
  return [...numbers].map(([role, many]) => (many === 1 ? `a ${role}` : `${many} ${role}s`)).join(', ');
}
