/** A new game: colour, strength, clock and position, said as one line. */

import {button, make} from '../dom.js';
import {choices, openDialog, toggle} from './dialog.js';
import {editPosition} from './editor.js';

const CLOCKS = ['none', '3+2', '5+3', '10+5', '15+10', '30+20', '90+30'];
const WEAKEST = 400;
const STRONGEST = 3190;
/** One period of a time control, as the program reads it: 5+3, 0:30+1, 5d3, 40/90. */
const PERIOD = /^(\d{1,3}\/)?((\d{1,2}:)?\d{1,3}:[0-5]?\d|\d{1,3}(\.\d{1,3})?)([+db]\d{1,4}(\.\d{1,3})?)?$/;

/**
 * The line that begins a new game.
 * @param {{colour: string, elo: number | null, clock: string, fen: string | null}} wanted `elo` null: full strength; `fen` null: the
 *   usual position.
 */
export function newGameLine({colour, elo, clock, fen}) {
  return ['new', colour, elo === null ? 'full' : `elo ${elo}`, `clock ${clock}`, `fen ${fen ?? 'start'}`].join(' ');
}

/**
 * Open the dialog.
 * @param {import('../store.js').Store} store
 * @param {string | null} position FEN to begin from; null: the usual one.
 */
export function openNewGame(store, position = null) {
  const last = store.remembered('newgame', {});
  const side = store.get('game')?.person ?? 'white';
  const wanted = {
    colour: last.colour ?? side, elo: last.elo ?? null, clock: last.clock ?? '10+5', fen: position ?? '',
    place: position === null ? 'usual' : 'other',
  };
  const own = !CLOCKS.includes(wanted.clock);
  let slider = wanted.elo ?? 1600;

  const level = make('output', {for: 'elo'});
  const range = make('input', {
    id: 'elo', type: 'range', min: WEAKEST, max: STRONGEST, step: 10, value: slider, 'aria-label': 'Elo',
    oninput: () => {
      slider = Number(range.value);
      wanted.elo = slider;
      strength();
    },
  });
  const full = toggle('Full strength', wanted.elo === null, (on) => {
    wanted.elo = on ? null : slider;
    strength();
  });

  function strength() {
    range.disabled = wanted.elo === null;
    level.textContent = `Elo ${slider}`;
    range.parentElement.hidden = wanted.elo === null;
    range.setAttribute('aria-valuetext', `Elo ${slider}`);
  }

  const problem = make('p', {class: 'problem', role: 'alert', hidden: true});
  const clockField = make('input', {
    id: 'clock-text', type: 'text', value: own ? wanted.clock : '', placeholder: '40/90,30+30', autocomplete: 'off',
    'aria-label': 'Time control', 'aria-describedby': 'clock-help', hidden: !own,
  });
  const clockHelp = make(
    'p', {id: 'clock-help', class: 'muted', hidden: !own},
    'Minutes, and seconds for each move: 5+3; 0:30+1 with seconds; 5d3 with delay; 40/90,30+30 in periods.',
  );
  const clockChoice = choices(
    'Clock', 'clock', [...CLOCKS.map((clock) => [clock, clock === 'none' ? 'No clock' : clock]), ['own', 'Other']],
    own ? 'own' : wanted.clock,
    (value) => {
      clockField.hidden = clockHelp.hidden = value !== 'own';
      wanted.clock = value;
      if (value === 'own') clockField.focus();
    },
  );
  if (own) wanted.clock = 'own';

  const fenField = make('input', {
    id: 'new-fen', type: 'text', value: wanted.fen, autocomplete: 'off', spellcheck: 'false', 'aria-label': 'Position as FEN',
    placeholder: 'FEN',
  });
  const edit = button('Set it up on a board', 'setup', async () => {
    dialog.close();
    const fen = await editPosition(fenField.value.trim() || store.get('game')?.fen);
    openNewGame(store, fen ?? (fenField.value.trim() || null));
  });
  const other = make('div', {class: 'other-position', hidden: wanted.place === 'usual'}, fenField, edit);
  const place = choices('Position', 'place', [['usual', 'Usual'], ['other', 'Another']], wanted.place, (value) => {
    wanted.place = value;
    other.hidden = value === 'usual';
  });

  function refuse(text) {
    problem.textContent = text;
    problem.hidden = false;
  }

  function begin(event) {
    event.preventDefault();
    const clock = wanted.clock === 'own' ? clockField.value.replaceAll(/\s/g, '').toLowerCase() : wanted.clock;
    if (clock !== 'none' && !clock.split(',').every((period) => PERIOD.test(period))) {
      refuse(`'${clock}' is not a time control: write 10+5, 5d3, or 40/90,30+30`);
      clockField.focus();
      return;
    }
    const fen = wanted.place === 'usual' ? null : fenField.value.trim().replaceAll(/\s+/g, ' ');
    if (fen === '') {
      refuse('The position is missing: set it up on a board, or paste a FEN');
      fenField.focus();
      return;
    }
    store.remember('newgame', {colour: wanted.colour, elo: wanted.elo, clock});
    const colour = wanted.colour === 'either' ? ['white', 'black'][Math.floor(2 * Math.random())] : wanted.colour;
    if (store.say(newGameLine({colour, elo: wanted.elo, clock, fen}))) dialog.close();
  }

  const game = store.get('game');
  const running = game !== null && game.result === '*' && game.moves.length > 0;
  const dialog = openDialog({
    title: 'New game', name: 'newgame',
    content: [make(
      'form', {onsubmit: begin},
      choices('You play', 'colour', [['white', 'White'], ['black', 'Black'], ['either', 'Either']], wanted.colour, (value) => {
        wanted.colour = value;
      }),
      make('fieldset', {class: 'choice'}, make('legend', {}, 'Strength'), full, make('div', {class: 'slider', hidden: true}, range, level)),
      clockChoice, clockField, clockHelp, place, other, problem,
      make('p', {class: 'muted', hidden: !running}, 'The current game is given up, and the arm sets up the pieces.'),
      make(
        'div', {class: 'dialog-actions'},
        button('Cancel', null, () => dialog.close()),
        make('button', {type: 'submit', class: 'primary'}, 'Begin'),
      ),
    )],
  });
  strength();
}
