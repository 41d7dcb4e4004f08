/** What this browser remembers: how the page looks and sounds; and the addresses and keys that it has. */

import {make} from '../dom.js';
import {evaluationShown} from '../game/evaluation.js';
import {choices, openDialog, toggle} from './dialog.js';

const KEYS = [
  ['Esc Esc', 'STOP'],
  ['← →', 'walk through the moves; Home and End to the first and the newest'],
  ['Arrows, Enter, Esc', 'on the board: choose a square, lift or put down, cancel'],
  ['/', 'type a move or a word'],
  ['f', 'flip the board'],
];

/**
 * Open the dialog.
 * @param {import('../store.js').Store} store
 * @param {{sounds: ReturnType<typeof import('../talk/sound.js').makeSounds>, voice: ReturnType<typeof import('../talk/speech.js').makeVoice>}} made
 */
export function openSettings(store, {sounds, voice}) {
  const theme = choices(
    'Colours', 'theme', [['auto', 'System'], ['light', 'Light'], ['dark', 'Dark']],
    document.documentElement.dataset.theme,
    (value) => {
      document.documentElement.dataset.theme = value;
      store.remember('theme', value);
      store.set('theme', value);
    },
  );
  const assists = store.get('game')?.assists !== false;
  const evaluation = toggle('Evaluation bar', assists && evaluationShown(store), (on) => {
    store.remember('evaluation', on);
    store.set('evaluation', on);
  }, {disabled: !assists});
  const streams = ['camera', 'film'].map((view) => {
    const address = new URL(`/stream/${view}`, window.location.href).href;
    return make(
      'label', {class: 'field'},
      make('span', {}, view === 'camera' ? 'Camera' : 'Film view'),
      make('input', {type: 'text', readonly: true, '.value': address, onfocus: (event) => event.target.select()}),
    );
  });
  openDialog({
    title: 'Settings', name: 'settings',
    content: [
      theme,
      make(
        'fieldset', {class: 'choice'},
        make('legend', {}, 'In this browser'),
        toggle('Sounds', sounds.isOn(), sounds.turn),
        toggle('Voice: says the moves, and what the robot asks', voice.isOn(), voice.turn, {disabled: !voice.there}),
        evaluation,
        make('p', {class: 'muted', hidden: assists}, 'In a game between people no evaluation and no hint is shown.'),
      ),
      make(
        'fieldset', {class: 'choice'},
        make('legend', {}, 'Pictures for streaming (MJPEG)'),
        ...streams,
      ),
      make(
        'fieldset', {class: 'choice'},
        make('legend', {}, 'Keys'),
        make('dl', {class: 'keys'}, ...KEYS.flatMap(([keys, what]) => [make('dt', {}, make('kbd', {}, keys)), make('dd', {}, what)])),
      ),
    ],
  });
}
