// One recorded game: a clock over plant time that sets film and the sections of the page's state to its moment.

import {make, say} from '../panels/dom.js';
import {writePlace} from './address.js';
import {Chances} from './chances.js';
import {Film} from './film.js';
import {plyName, Slider} from './slider.js';
import {Timeline} from './timeline.js';
import {Trace} from './trace.js';

const FRAME = 1000 / 30; // [ms] the page's state is not set more often
const RESTS = 400; // [ms] after which the moment is written into the address

/** Shows a record. The store keeps what the game that runs says meanwhile (`showRecord`). */
export class Player {
  constructor(store, {id, address, record}) {
    Object.assign(this, {
      store,
      id,
      address,
      record,
      speed: 1,
      running: false,
      request: 0,
      shown: -1,
      ply: -1,
      rest: 0,
    });
    this.onclose = () => {};
    this.timeline = new Timeline(record);
    for (const [index, ply] of this.timeline.plies.entries()) {
      ply.name = plyName(index === 0 ? record.game.start : this.timeline.plies[index - 1].fen, ply.san);
    }
    this.trace = null;
    this.film = new Film(record, address);
    this.slider = new Slider(this.timeline, {
      seek: (t) => this.seek(t),
      play: () => (this.running ? this.pause() : this.run()),
      jump: (by) => this.jump(by),
      speed: (speed) => this.setSpeed(speed),
    });
    const {white, black, result} = record.game;
    this.title = record.game.sets_up ? 'Setting up' : `${white} – ${black}, ${result}`;
    this.troubles = make('ul', {class: 'tm-troubles'}, ...record.troubles.map((one) => this.#trouble(one)));
    this.chances = record.analysis ? new Chances(record.analysis, (ply) => this.seek(this.timeline.timeOf(ply))) : null;
    this.robot = make('div', {class: 'tm-beside'});
    this.plots = make('div', {});
    const figures = make(
      'details',
      {class: 'tm-details', ontoggle: () => this.#plot(figures.open)},
      make('summary', {}, 'Plots'),
      this.plots,
    );
    this.root = make(
      'div',
      {},
      make(
        'div',
        {class: 'tm-tools'},
        make('h2', {class: 'tm-title'}, this.title),
        make('button', {type: 'button', class: 'tm-button', onclick: () => this.onclose()}, 'Close'),
      ),
      make('div', {class: 'tm-stage'}, this.film.root, this.slider.root, this.robot),
      this.#downloads(),
      ...(this.chances ? [this.chances.root] : []),
      this.troubles,
      figures,
    );
    this.ends = [];
  }

  /** Begins, at a moment or at the beginning. */
  start(t) {
    this.store.change({trace: null, prompt: null, look: null, pictures: null});
    this.ends.push(
      this.store.subscribe('viewing', (ply) => this.#viewed(ply)),
      this.#mount('../robot.js', this.robot),
    );
    this.seek(t ?? this.timeline.start);
  }

  /** Takes the telemetry of the game: from now on arm and plots follow. */
  follow(telemetry) {
    if (!(telemetry.columns.t?.length > 0)) return;
    this.trace = new Trace(telemetry);
    this.mcap.hidden = false;
    this.store.set('trace', this.trace);
    this.show();
  }

  stop() {
    this.pause();
    clearTimeout(this.rest);
    this.ends.forEach((end) => end());
    this.#plot(false);
    this.film.dispose();
    this.root.remove();
    this.store.set('trace', null);
  }

  seek(t) {
    const {start, end} = this.timeline;
    this.t = Math.min(end, Math.max(start, t));
    this.clock = performance.now();
    this.show();
  }

  run() {
    if (this.t >= this.timeline.end) this.seek(this.timeline.start);
    this.running = true;
    this.clock = this.drawn = performance.now();
    this.request = requestAnimationFrame(() => this.#step());
    this.show();
  }

  pause() {
    cancelAnimationFrame(this.request);
    if (!this.running) return;
    this.running = false;
    this.show();
  }

  setSpeed(speed) {
    this.speed = speed;
    this.show();
  }

  /** To the end of the ply before or after. */
  jump(by) {
    const done = this.timeline.pliesAt(this.t);
    const within = this.t > this.timeline.timeOf(done) + 0.02;
    this.seek(this.timeline.timeOf(by < 0 && within ? done : done + by));
  }

  #step() {
    const now = performance.now();
    if (now - this.drawn >= FRAME - 2) {
      this.t += (this.speed * (now - this.clock)) / 1000;
      this.clock = this.drawn = now;
      if (this.t >= this.timeline.end) {
        this.t = this.timeline.end;
        this.pause();
        return;
      }
      this.show();
    }
    this.request = requestAnimationFrame(() => this.#step());
  }

  /** Sets everything to the moment. */
  show() {
    const {t, timeline, trace} = this;
    const sections = {};
    const index = timeline.at(t);
    if (index !== this.shown) Object.assign(sections, timeline.sections(index));
    this.shown = index;
    if (trace) {
      sections.telemetry = trace.frame(t);
      const path = trace.pathAt(t);
      if (path !== this.path) sections.path = path;
      this.path = path;
    }
    this.setting = true;
    this.store.change(sections);
    this.setting = false;
    const done = timeline.pliesAt(t);
    const ply = done > 0 ? timeline.plies[done - 1] : null;
    this.chances?.show(done);
    this.film.show(t, ply ?? {frame: this.record.first_frame, name: 'the beginning'}, this.running ? this.speed : 0);
    this.slider.show(t, ply ? `after ${ply.name}` : 'before the first move', this.running);
    clearTimeout(this.rest);
    if (!this.running) this.rest = setTimeout(() => writePlace(this.id, this.t), RESTS);
  }

  /** Somebody has gone to a ply in the list of moves: the slider goes there. */
  #viewed(ply) {
    if (this.setting) return;
    this.seek(this.timeline.timeOf(ply ?? this.timeline.plies.length));
  }

  #mount(module, element) {
    let end = () => {};
    let over = false;
    import(module)
      .then(({mount}) => {
        if (!over) end = mount(element, this.store);
      })
      .catch((error) => {
        element.textContent = 'This part could not be loaded: open the game again.';
        console.error(error);
      });
    return () => {
      over = true;
      end();
    };
  }

  #plot(open) {
    this.unplot?.();
    this.unplot = open ? this.#mount('../plots.js', this.plots) : null;
  }

  #trouble({t, text}) {
    const go = make('button', {type: 'button', class: 'tm-button', onclick: () => this.seek(t)}, `${t.toFixed(1)} s`);
    return make('li', {}, go, ` ${text}`);
  }

  #downloads() {
    const link = (name, text) => make('a', {class: 'tm-link', href: `${this.address}/${name}`, download: ''}, text);
    const links = [link('game.pgn', 'PGN'), link('report.html', 'Report')];
    this.mcap = link('telemetry.mcap', 'Telemetry (MCAP)');
    this.mcap.hidden = true;
    links.push(this.mcap);
    const copy = make(
      'button',
      {type: 'button', class: 'tm-button', onclick: () => this.#copy(copy)},
      'Copy link to this moment',
    );
    return make('p', {class: 'tm-tools tm-downloads'}, ...links, copy);
  }

  async #copy(button) {
    writePlace(this.id, this.t);
    try {
      await navigator.clipboard.writeText(window.location.href);
      say(button, 'Link copied');
    } catch {
      say(button, 'The link is in the address bar'); // where the clipboard is forbidden
    }
    setTimeout(() => say(button, 'Copy link to this moment'), 3000);
  }
}
