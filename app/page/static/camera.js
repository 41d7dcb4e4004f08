// What the camera sees, and what vision makes of it: the newest picture with the board's squares drawn over it.

import {announce, make, say, silence, toggle, useStyles} from './panels/dom.js';
import {watchWhileSeen} from './panels/watch.js';
import {quads, seenInWords, unsureInWords} from './camera/squares.js';

const SVG = 'http://www.w3.org/2000/svg';
const SURE = 0.9; // what is thought with more than that is not worth a number
let number = 0; // of panels made, for identifiers that occur once

/** Shows the camera's picture in an element; returns what takes it out again. */
export function mount(element, store) {
  useStyles();
  const panel = new Camera(element, store);
  return () => panel.stop();
}

class Camera {
  constructor(element, store) {
    Object.assign(this, {store, seen: false, loading: null, shown: null, arrived: 0, drawnFor: null});
    this.hatch = `tm-unsure-${(number += 1)}`;
    this.picture = make('img', {class: 'tm-picture', alt: 'The board from the camera', hidden: true});
    this.overlay = document.createElementNS(SVG, 'svg');
    this.overlay.setAttribute('class', 'tm-squares');
    this.overlay.setAttribute('aria-hidden', 'true');
    this.frame = make('div', {class: 'tm-camera-frame'}, this.picture, this.overlay);
    this.outcome = make('p', {class: 'tm-sentence tm-strong'}, 'No picture has arrived yet.');
    this.detail = make('p', {class: 'tm-sentence'});
    this.age = make('p', {class: 'tm-sentence'});
    this.live = make('p', {class: 'tm-hidden', role: 'status'});
    const squares = toggle('Squares', true, (on) => this.overlay.classList.toggle('tm-off', !on));
    const figures = toggle('How sure', false, (on) => this.overlay.classList.toggle('tm-figures', on));
    this.root = make(
      'div',
      {class: 'tm-panel tm-camera'},
      this.frame,
      make('div', {class: 'tm-tools'}, squares, figures, legend()),
      this.outcome,
      this.detail,
      this.age,
      this.live,
    );
    element.append(this.root);
    this.picture.addEventListener('load', () => this.loaded());
    this.picture.addEventListener('error', () => this.failed());
    this.ends = [
      watchWhileSeen(this.root, store, 'camera', (seen) => this.show(seen)),
      store.subscribe('look', (look) => this.think(look)),
      store.subscribe('pictures', () => this.fetch()),
      store.subscribe('session', (session) => this.whether(session)),
    ];
    this.timer = setInterval(() => this.tellAge(), 1000);
  }

  stop() {
    clearInterval(this.timer);
    this.ends.forEach((end) => end());
    silence(this.live);
    this.root.remove();
  }

  whether(session) {
    this.blind = session?.sees === false;
    this.frame.hidden = this.blind;
    if (this.blind) say(this.outcome, 'This rig has no camera: typed moves count as they are.');
    else if (this.shown === null && session?.pace === 'fast') {
      say(
        this.outcome,
        'No picture yet: in pace fast there is one only when the board is read, since the game would wait for others.',
      );
    }
  }

  show(seen) {
    this.seen = seen;
    if (seen) this.fetch();
  }

  /** The newest picture's number; null: there is none. */
  get newest() {
    return this.store.get('pictures')?.camera?.number ?? this.store.get('look')?.picture ?? null;
  }

  /** Asks for the newest picture, one at a time: what comes in between is left out. */
  fetch() {
    const {newest} = this;
    if (!this.seen || this.loading !== null || newest === null || newest === this.shown) return;
    this.loading = newest;
    this.picture.src = `/picture/camera.jpg?n=${newest}`;
  }

  loaded() {
    this.shown = this.loading;
    this.loading = null;
    this.arrived = performance.now();
    this.picture.hidden = false;
    if (!this.store.get('look')) say(this.outcome, 'The board has not been read yet.');
    this.draw();
    this.tellAge();
    this.fetch();
  }

  failed() {
    this.shown = this.loading; // that one is gone; the next one has another number
    this.loading = null;
  }

  think(look) {
    if (!look) return this.clear();
    say(this.outcome, look.text || look.outcome);
    say(this.detail, [seenInWords(look), unsureInWords(look)].filter(Boolean).join(' '));
    if (look.outcome !== this.told) announce(this.live, [look.text || look.outcome, unsureInWords(look)].join(' '));
    this.told = look.outcome;
    this.draw();
    this.fetch();
  }

  clear() {
    this.overlay.replaceChildren();
    this.drawnFor = null;
    say(this.detail, '');
  }

  tellAge() {
    if (!this.seen || this.shown === null) return;
    const look = this.store.get('look');
    const now = this.store.get('telemetry')?.t;
    const stamp = this.store.get('pictures')?.camera?.stamp ?? look?.stamp;
    const wall = (performance.now() - this.arrived) / 1000;
    const exposed = stamp === undefined ? '' : `, exposed at ${stamp.toFixed(1)} s of plant time`;
    const read =
      look && now !== undefined
        ? `; the board was read ${Math.max(0, now - look.stamp).toFixed(0)} s of plant time ago`
        : '';
    say(this.age, `This picture came ${wall < 1.5 ? 'just now' : `${wall.toFixed(0)} s ago`}${exposed}${read}.`);
  }

  draw() {
    const look = this.store.get('look');
    if (look === this.drawnFor) return;
    this.drawnFor = look;
    this.overlay.replaceChildren();
    const squares = look ? quads(look) : [];
    if (squares.length === 0) return;
    this.overlay.setAttribute('viewBox', `0 0 ${look.width} ${look.height}`);
    this.overlay.append(this.#pattern(look.width));
    for (const square of squares) this.overlay.append(this.#square(square, look.width));
  }

  #pattern(width) {
    const step = width / 90;
    const pattern = svg('pattern', {
      id: this.hatch,
      width: step,
      height: step,
      patternUnits: 'userSpaceOnUse',
      patternTransform: 'rotate(45)',
    });
    pattern.append(
      svg('rect', {width: step, height: step, class: 'tm-hatch-ground'}),
      svg('rect', {width: step / 2.5, height: step, class: 'tm-hatch'}),
    );
    const defs = svg('defs');
    defs.append(pattern);
    return defs;
  }

  #square({name, corners, centre, size, seen, sure, unsure}, width) {
    const group = svg('g', {class: `tm-square tm-seen-${seen}${unsure ? ' tm-is-unsure' : ''}`});
    const points = corners.map((corner) => corner.join(',')).join(' ');
    group.append(
      svg('polygon', {
        points,
        ...(unsure ? {fill: `url(#${this.hatch})`} : {fill: 'none'}),
        'stroke-width': width / 700,
      }),
    );
    const [x, y] = centre;
    if (seen !== 'empty') group.append(svg('circle', {cx: x, cy: y, r: 0.17 * size, 'stroke-width': width / 480}));
    if (unsure || sure < SURE) {
      const text = svg('text', {
        x,
        y: y + 0.42 * size,
        'font-size': 0.25 * size,
        class: unsure ? 'tm-percent' : 'tm-percent tm-only-figures',
      });
      text.textContent = `${unsure ? '? ' : ''}${Math.round(100 * sure)}`;
      group.append(text);
    } else {
      const text = svg('text', {x, y: y + 0.42 * size, 'font-size': 0.22 * size, class: 'tm-percent tm-only-figures'});
      text.textContent = String(Math.round(100 * sure));
      group.append(text);
    }
    group.dataset.square = name;
    return group;
  }
}

function svg(tag, attributes = {}) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  return element;
}

function legend() {
  const key = (look, text) =>
    make('span', {class: 'tm-key'}, make('span', {class: `tm-dot tm-dot-${look}`, 'aria-hidden': 'true'}), text);
  return make(
    'p',
    {class: 'tm-keys'},
    key('white', 'white piece'),
    key('black', 'black piece'),
    key('unsure', 'not sure, with per cent'),
  );
}
