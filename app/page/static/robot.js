// The arm live in three dimensions: where telemetry says that it is, among the pieces where the game believes them.

import {robotAddress} from './panels/addresses.js';
import {announce, make, say, silence, toggle, useStyles} from './panels/dom.js';
import {onTheme} from './panels/theme.js';
import {watchWhileSeen} from './panels/watch.js';
import {Blend} from './robot/blend.js';
import {Orbit, VIEWS} from './robot/orbit.js';
import {describe, inFingers} from './robot/words.js';
import {View} from './robot/view.js';

const LATER = 550; // [ms] after which shadows that were left out are drawn
const NAMES = {front: 'Front', top: 'Top', person: 'Person'};
const panels = new WeakMap();
let number = 0; // of panels made, for identifiers that occur once

/** Shows the robot in an element; returns what takes it out again. */
export function mount(element, store) {
  useStyles();
  const panel = new Panel(element, store);
  panels.set(element, panel);
  panel.start();
  return () => {
    panels.delete(element);
    panel.stop();
  };
}

/**
 * What is drawn in an element, for tests: how often it has been drawn, whether the arm is, points of the base frame [m] of the
 * tool and of each piece's foot, whose piece is held, how much of the path is executed (0 to 1, null without a path). Null
 * before it is there.
 */
export function inspect(element) {
  return panels.get(element)?.inspect() ?? null;
}

class Panel {
  constructor(element, store) {
    Object.assign(this, {element, store, view: null, frame: 0, dirty: false, moved: true, drawn: 0, visible: false});
    this.blend = new Blend();
    this.ends = [];
    this.stopped = false;
    const keysId = `tm-scene-keys-${(number += 1)}`;
    this.canvas = make('canvas', {class: 'tm-scene-canvas'});
    this.stage = make(
      'div',
      {
        class: 'tm-scene',
        tabindex: '0',
        role: 'application',
        'aria-label': 'The arm over the board, in three dimensions',
        'aria-roledescription': 'view',
        'aria-describedby': keysId,
      },
      this.canvas,
    );
    this.sentence = make('p', {class: 'tm-sentence'}, 'Waiting for the arm …');
    this.live = make('p', {class: 'tm-hidden', role: 'status', 'aria-live': 'polite'});
    const keys = 'Arrow keys turn the view, with Shift they move it; plus and minus zoom.';
    this.tools = make('div', {class: 'tm-tools', role: 'group', 'aria-label': 'Views'});
    for (const name of Object.keys(VIEWS)) {
      const go = () => this.orbit?.look(VIEWS[name], performance.now());
      this.tools.append(make('button', {type: 'button', class: 'tm-button', onclick: go}, NAMES[name]));
    }
    this.tools.append(
      toggle('Path', true, (on) => this.change(() => (this.view.path.group.visible = on))),
      toggle('Force', true, (on) => this.change(() => this.showForce(on))),
    );
    this.root = make(
      'div',
      {class: 'tm-panel tm-robot'},
      this.stage,
      this.tools,
      this.sentence,
      this.live,
      make('p', {class: 'tm-hidden', id: keysId}, keys),
    );
  }

  async start() {
    this.element.append(this.root);
    try {
      const answer = await fetch(robotAddress(this.store));
      if (!answer.ok) throw new Error(`the server answered ${answer.status}`);
      this.description = await answer.json();
    } catch (error) {
      return this.fail(`The robot's description did not arrive (${error.message}): load the page again.`);
    }
    if (this.stopped) return;
    try {
      this.view = new View(this.canvas, this.description);
    } catch {
      return this.fail(
        'This browser cannot show 3-D (WebGL is missing or switched off): the board beside shows the game.',
      );
    }
    this.orbit = new Orbit(this.view.camera, this.stage, () => this.wake(false));
    this.canvas.addEventListener('webglcontextlost', (event) => {
      event.preventDefault();
      say(this.sentence, 'The graphics were lost; they come back by themselves, or with the page loaded again.');
    });
    this.canvas.addEventListener('webglcontextrestored', () => this.wake(true));
    const sizes = new ResizeObserver(() => this.resize());
    sizes.observe(this.stage);
    this.ends.push(
      () => sizes.disconnect(),
      onTheme((dark) => this.change(() => this.view.theme(dark))),
      watchWhileSeen(this.stage, this.store, 'telemetry', (seen) => this.show(seen)),
      this.store.subscribe('game', (game) => this.take(game)),
      this.store.subscribe('path', (path) => this.change(() => this.view.path.show(path))),
      ...['session', 'record'].map((section) => this.store.subscribe(section, () => this.showArm())),
      this.store.subscribe('telemetry', (frame) => this.follow(frame)),
    );
  }

  stop() {
    this.stopped = true;
    cancelAnimationFrame(this.frame);
    clearTimeout(this.later);
    this.ends.forEach((end) => end());
    this.orbit?.dispose();
    this.view?.dispose();
    silence(this.live);
    this.root.remove();
  }

  fail(text) {
    this.stage.remove();
    this.tools.remove();
    say(this.sentence, text);
  }

  show(seen) {
    this.visible = seen;
    if (seen) this.wake(true);
    else (cancelAnimationFrame(this.frame), (this.frame = 0));
  }

  resize() {
    const {clientWidth, clientHeight} = this.stage;
    if (clientWidth === 0 || clientHeight === 0) return;
    this.view.resize(clientWidth, clientHeight);
    this.orbit.place();
    this.wake(false);
  }

  take(game) {
    if (!game) return;
    this.change(() => {
      this.view.pieces.place(game.pieces ?? [], game.held ?? null);
      this.view.pieces.carry(this.view.inBoard(this.view.arm.at));
    });
    this.tell();
  }

  follow(frame) {
    // what is not finite comes as null: then the arm stays where it was
    if (!frame?.angles || [...frame.angles, ...frame.tool].includes(null)) return;
    this.blend.take(frame, performance.now(), frame.exact === true);
    this.wake(true);
    this.tell();
  }

  /** A game on the rig "board" has no arm; one that was recorded may have had. */
  showArm() {
    const {store} = this;
    const there = store.get('record') !== null || store.get('session')?.rig !== 'board';
    this.change(() => (this.view.arm.group.visible = there));
  }

  showForce(on) {
    this.view.force.wanted = on;
    this.view.force.group.visible &&= on;
  }

  change(how) {
    if (this.view === null) return;
    how();
    this.wake(true);
  }

  tell() {
    const frame = this.store.get('telemetry');
    const game = this.store.get('game');
    say(this.sentence, describe(frame, game, this.view, this.description));
    const told = inFingers(game);
    if (told !== this.told) announce(this.live, describe(frame, game, this.view, this.description, false));
    this.told = told;
  }

  wake(moved) {
    this.dirty = true;
    this.moved ||= moved;
    if (this.visible && this.frame === 0) this.frame = requestAnimationFrame((now) => this.draw(now));
  }

  draw(now) {
    this.frame = 0;
    if (now - this.drawn < this.view.frame - 2) {
      this.frame = requestAnimationFrame((later) => this.draw(later));
      return;
    }
    const eases = this.orbit.step(now);
    const clock = performance.now();
    const shown = this.blend.at(clock);
    if (shown && this.moved) this.view.pose(shown);
    const stale = this.view.render(this.moved);
    clearTimeout(this.later);
    if (stale) this.later = setTimeout(() => this.wake(false), LATER);
    this.drawn = now;
    const moving = this.blend.moving(clock);
    this.dirty = this.moved = false;
    if (eases || moving) this.wake(moving);
  }

  inspect() {
    if (this.view === null) return null;
    const {arm, pieces, path, board, renders} = this.view;
    const at = {};
    for (const [name, mesh] of pieces.meshes) at[name] = mesh.position.clone().applyMatrix4(board.matrix).toArray();
    const executed = path.mesh.visible ? path.faded / path.parts : null;
    const [{visible}, fingers] = [arm.group, arm.fingers.right.position.x];
    return {renders, arm: visible, tool: [...arm.at], pieces: at, held: pieces.held, executed, fingers};
  }
}
