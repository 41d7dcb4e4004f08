// The one slider over plant time, with marks for plies and for trouble, and the buttons beside it.

import {icon, make, say} from '../panels/dom.js';

const SPEEDS = [0.25, 0.5, 1, 2, 4, 8];
const STEP = 0.1; // [s] of an arrow key

/** Name of a ply as in a score sheet: "12. Nf3" or "12… d5". */
export function plyName(fenBefore, san) {
  const [, turn, , , , number] = fenBefore.split(' ');
  return `${number}${turn === 'b' ? '…' : '.'} ${san}`;
}

/** Slider and buttons; what they do is told to `to`: seek(t), play(), jump(±1), speed(x). */
export class Slider {
  constructor(timeline, to) {
    this.timeline = timeline;
    const {start, end} = timeline;
    this.range = make('input', {
      type: 'range',
      class: 'tm-range',
      min: start,
      max: end,
      step: 0.01,
      value: start,
      'aria-label': 'Plant time',
      oninput: () => to.seek(Number(this.range.value)),
      onkeydown: (event) => this.#key(event, to),
    });
    const button = (label, picture, act) =>
      make(
        'button',
        {type: 'button', class: 'tm-button', 'aria-label': label, title: label, onclick: act},
        icon(picture),
      );
    this.play = button('Play', 'go', () => to.play());
    this.speed = make(
      'select',
      {class: 'tm-button', 'aria-label': 'Speed', onchange: () => to.speed(Number(this.speed.value))},
      ...SPEEDS.map((speed) => make('option', {value: speed, selected: speed === 1}, `${speed} ×`)),
    );
    this.time = make('output', {class: 'tm-time'});
    this.root = make(
      'div',
      {class: 'tm-slider'},
      make('div', {class: 'tm-track'}, this.range, this.#marks()),
      make(
        'div',
        {class: 'tm-tools'},
        button('Beginning', 'first', () => to.seek(start)),
        button('Ply before', 'back', () => to.jump(-1)),
        this.play,
        button('Next ply', 'forth', () => to.jump(1)),
        button('End', 'last', () => to.seek(end)),
        this.speed,
        this.time,
      ),
    );
  }

  #marks() {
    const {start, end, plies, record} = this.timeline;
    const space = 'http://www.w3.org/2000/svg';
    const svg = document.createElementNS(space, 'svg');
    for (const [name, value] of Object.entries({
      class: 'tm-marks',
      viewBox: '0 0 1000 10',
      preserveAspectRatio: 'none',
      'aria-hidden': 'true',
    })) {
      svg.setAttribute(name, value);
    }
    const mark = (t, look, height) => {
      const line = document.createElementNS(space, 'line');
      const x = (1000 * (t - start)) / (end - start || 1);
      for (const [name, value] of Object.entries({x1: x, x2: x, y1: 10 - height, y2: 10, class: look}))
        line.setAttribute(name, value);
      svg.append(line);
    };
    for (const {t, number} of plies) mark(t, 'tm-mark', number % 10 === 0 ? 9 : number % 2 ? 4 : 6);
    for (const {t} of record.troubles) mark(t, 'tm-mark tm-mark-trouble', 10);
    return svg;
  }

  #key(event, to) {
    const {start, end} = this.timeline;
    const value = Number(this.range.value);
    const keys = {
      ArrowRight: () => to.seek(value + STEP),
      ArrowLeft: () => to.seek(value - STEP),
      ArrowUp: () => to.jump(1),
      ArrowDown: () => to.jump(-1),
      PageDown: () => to.jump(1),
      PageUp: () => to.jump(-1),
      Home: () => to.seek(start),
      End: () => to.seek(end),
      ' ': () => to.play(),
      k: () => to.play(),
    };
    const act = keys[event.key];
    if (!act || event.altKey || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    event.stopPropagation();
    act();
  }

  /** What the slider shows: a time, in words what was played last, and whether time runs. */
  show(t, words, running) {
    this.range.value = t;
    this.range.setAttribute('aria-valuetext', `${t.toFixed(1)} seconds, ${words}`);
    say(this.time, `${t.toFixed(2)} s of ${this.timeline.end.toFixed(1)} s · ${words}`);
    if (running === this.running) return;
    this.running = running;
    this.play.replaceChildren(icon(running ? 'pause' : 'go'));
    for (const name of ['aria-label', 'title']) this.play.setAttribute(name, running ? 'Pause' : 'Play');
  }
}
