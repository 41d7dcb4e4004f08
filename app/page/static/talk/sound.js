/** Sounds, made as they are needed: wood on wood for moves, tones for check and for time that runs out. */

import {isOver} from '../game/position.js';

const LOUD = 0.5;

/**
 * Make the sounds.
 * @param {import('../store.js').Store} store
 */
export function makeSounds(store) {
  let on = store.remembered('sound', true);
  let context = null;
  let game = null;

  // browsers admit sound only after somebody has touched the page
  function wake() {
    context ??= new AudioContext();
    if (context.state === 'suspended') context.resume();
  }
  for (const kind of ['pointerdown', 'keydown']) document.addEventListener(kind, () => on && wake(), {capture: true});

  function ready() {
    return on && context !== null && context.state === 'running';
  }

  /** A piece that is put down: a short burst of noise through a resonance, and the board's low note under it. */
  function knock(delay, strength, pitch) {
    const start = context.currentTime + delay;
    const length = Math.floor(0.06 * context.sampleRate);
    const buffer = context.createBuffer(1, length, context.sampleRate);
    const samples = buffer.getChannelData(0);
    for (let i = 0; i < length; i += 1) samples[i] = (2 * Math.random() - 1) * Math.exp(-i / (0.008 * context.sampleRate));
    const noise = new AudioBufferSourceNode(context, {buffer});
    const body = new BiquadFilterNode(context, {type: 'bandpass', frequency: pitch, Q: 1.2});
    const volume = new GainNode(context, {gain: LOUD * strength});
    noise.connect(body).connect(volume).connect(context.destination);
    noise.start(start);
    tone(delay, pitch / 8, 0.07, 0.35 * strength, 'sine');
  }

  function tone(delay, frequency, length, strength, type = 'triangle') {
    const start = context.currentTime + delay;
    const oscillator = new OscillatorNode(context, {type, frequency});
    const volume = new GainNode(context, {gain: 0});
    volume.gain.setValueAtTime(0, start);
    volume.gain.linearRampToValueAtTime(LOUD * strength, start + 0.005);
    volume.gain.exponentialRampToValueAtTime(0.001, start + length);
    oscillator.connect(volume).connect(context.destination);
    oscillator.start(start);
    oscillator.stop(start + length);
  }

  const sounds = {
    move: () => knock(0, 1, 1100),
    capture: () => {
      knock(0, 0.8, 1700);
      knock(0.07, 1, 900);
    },
    check: () => {
      knock(0, 1, 1100);
      tone(0.05, 660, 0.25, 0.25);
      tone(0.17, 880, 0.3, 0.25);
    },
    low: () => [0, 0.18, 0.36].forEach((delay) => tone(delay, 990, 0.12, 0.3)),
    end: () => [523, 659, 784].forEach((frequency, index) => tone(0.11 * index, frequency, 0.5, 0.22)),
    ask: () => tone(0, 587, 0.3, 0.22),
  };

  /** Make a sound, unless it is quiet here. @param {keyof typeof sounds} name */
  function play(name) {
    if (ready()) sounds[name]();
  }

  store.subscribe('game', (next) => {
    const before = game;
    game = next === null ? null : {id: next.id, plies: next.moves.length, over: isOver(next)};
    if (before === null || game === null || before.id !== game.id) return;
    if (game.over && !before.over) play('end');
    else if (game.plies > before.plies) {
      const {san} = next.moves.at(-1);
      play(/[+#]/.test(san) ? 'check' : san.includes('x') ? 'capture' : 'move');
    }
  });
  let asked = null;
  store.subscribe('prompt', (prompt) => {
    if (asked !== null && prompt !== null && prompt.id !== asked && !prompt.turn) play('ask');
    asked = prompt?.id ?? asked ?? 0;
  });

  function turn(next) {
    on = next;
    store.remember('sound', on);
    if (on) {
      wake();
      setTimeout(() => play('move'), 50);
    }
  }

  return {play, turn, isOn: () => on};
}
