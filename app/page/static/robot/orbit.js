// The camera around the board: one finger or button turns, two fingers or the wheel zoom, two or Shift move; keys as well.

import {Vector3} from '../vendor/three/three.module.js';

const NEAREST = 0.25; // [m]
const FARTHEST = 2.2; // [m]
const LOWEST = 0.04; // [rad] from straight above …
const HIGHEST = 1.62; // … to a little below the horizon
const TURN = 0.0065; // [rad] a pixel
const STEP = (7 * Math.PI) / 180; // of an arrow key
const EASE = 350; // [ms] from view to view
const HOME = new Vector3(0, -0.33, 0);

/** Azimuth from the person's side, angle from straight above, distance and the point looked at. World: y up [m]. */
export const VIEWS = {
  front: {azimuth: 0.5, polar: 1.13, distance: 1.07, target: [0, -0.278, 0]},
  top: {azimuth: 0, polar: LOWEST, distance: 0.98, target: [0, -0.47, 0]},
  person: {azimuth: 0, polar: 0.92, distance: 0.78, target: [0, -0.42, 0]},
};

/** Moves a camera; calls `changed` when it has been moved. */
export class Orbit {
  constructor(camera, element, changed) {
    Object.assign(this, {camera, element, changed, azimuth: 0, polar: 1, distance: 1, target: HOME.clone()});
    this.pointers = new Map();
    this.ease = null;
    this.apart = 0;
    this.events = {
      pointerdown: (event) => this.#down(event),
      pointermove: (event) => this.#move(event),
      pointerup: (event) => this.pointers.delete(event.pointerId),
      pointercancel: (event) => this.pointers.delete(event.pointerId),
      wheel: (event) => this.#wheel(event),
      keydown: (event) => this.#key(event),
      contextmenu: (event) => event.preventDefault(),
    };
    for (const [name, listener] of Object.entries(this.events))
      element.addEventListener(name, listener, {passive: false});
    this.look(VIEWS.front, 0);
  }

  /** Goes to a view, at once where motion is unwelcome. */
  look(view, now) {
    const still = now === 0 || window.matchMedia('(prefers-reduced-motion: reduce)').matches;
    const to = {...view, target: new Vector3(...view.target)};
    if (still) {
      Object.assign(this, to);
      this.ease = null;
      this.place();
    } else {
      const {azimuth, polar, distance, target} = this;
      // the shorter way around
      to.azimuth = azimuth + Math.atan2(Math.sin(to.azimuth - azimuth), Math.cos(to.azimuth - azimuth));
      this.ease = {from: {azimuth, polar, distance, target: target.clone()}, to, start: now};
    }
    this.changed();
  }

  /** One step of the way to a view; true while there is more of it. */
  step(now) {
    if (this.ease === null) return false;
    const {from, to, start} = this.ease;
    const t = Math.min(1, (now - start) / EASE);
    const share = t * t * (3 - 2 * t);
    for (const name of ['azimuth', 'polar', 'distance']) this[name] = from[name] + share * (to[name] - from[name]);
    this.target.lerpVectors(from.target, to.target, share);
    if (t >= 1) this.ease = null;
    this.place();
    return true;
  }

  /** Puts the camera where the angles say; further off in a narrow picture, so that the board fits. */
  place() {
    this.polar = Math.min(HIGHEST, Math.max(LOWEST, this.polar));
    this.distance = Math.min(FARTHEST, Math.max(NEAREST, this.distance));
    const away = this.distance * Math.max(1, 1.45 / this.camera.aspect);
    const across = away * Math.sin(this.polar);
    this.camera.position.set(
      this.target.x + across * Math.sin(this.azimuth),
      this.target.y + away * Math.cos(this.polar),
      this.target.z + across * Math.cos(this.azimuth),
    );
    this.camera.lookAt(this.target);
    this.camera.updateMatrixWorld();
  }

  dispose() {
    for (const [name, listener] of Object.entries(this.events)) this.element.removeEventListener(name, listener);
  }

  #moved() {
    this.ease = null;
    this.place();
    this.changed();
  }

  #turn(right, down) {
    this.azimuth -= right;
    this.polar -= down;
  }

  #shift(right, down) {
    const scale = this.distance / 700;
    const [x, y] = [new Vector3(), new Vector3()];
    this.camera.matrixWorld.extractBasis(x, y, new Vector3());
    this.target.addScaledVector(x, -right * scale).addScaledVector(y, down * scale);
    this.target.clamp(new Vector3(-0.5, -0.6, -0.5), new Vector3(0.5, 0.2, 0.5));
  }

  #down(event) {
    this.element.focus({preventScroll: true});
    this.element.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
    this.apart = 0;
  }

  #move(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const [right, down] = [event.clientX - before[0], event.clientY - before[1]];
    this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
    if (this.pointers.size > 1) {
      const [a, b] = [...this.pointers.values()];
      const apart = Math.hypot(a[0] - b[0], a[1] - b[1]);
      if (this.apart > 0) this.distance *= this.apart / Math.max(apart, 1);
      this.apart = apart;
      this.#shift(right / 2, down / 2);
    } else if (event.shiftKey || event.buttons & 6) {
      this.#shift(right, down);
    } else {
      this.#turn(right * TURN, down * TURN);
    }
    this.#moved();
  }

  #wheel(event) {
    // the page scrolls on unless the view was chosen before: nobody wants to be caught on the way down
    if (document.activeElement !== this.element && !event.ctrlKey) return;
    event.preventDefault();
    this.distance *= Math.exp(event.deltaY * (event.deltaMode === 1 ? 0.04 : 0.0012));
    this.#moved();
  }

  #key(event) {
    if (event.altKey || event.ctrlKey || event.metaKey) return;
    const keys = {
      ArrowLeft: [-1, 0],
      ArrowRight: [1, 0],
      ArrowUp: [0, -1],
      ArrowDown: [0, 1],
    };
    if (event.key in keys) {
      const [right, down] = keys[event.key];
      if (event.shiftKey) this.#shift(-30 * right, -30 * down);
      else this.#turn(-right * STEP, -down * STEP);
    } else if (event.key === '+' || event.key === '=') {
      this.distance *= 0.88;
    } else if (event.key === '-') {
      this.distance /= 0.88;
    } else {
      return;
    }
    event.preventDefault();
    event.stopPropagation();
    this.#moved();
  }
}
