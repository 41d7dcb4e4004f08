/** The game's buttons, and the field in which a move or a word is typed. */

import {byId, button, icon, make} from '../dom.js';
import {confirm} from '../dialogs/dialog.js';
import {openEditor} from '../dialogs/editor.js';
import {openNewGame} from '../dialogs/newgame.js';
import {isOver} from '../game/position.js';
import {mountHand} from './hand.js';
import {ELSEWHERE, WORDS} from './words.js';

const FIRST = ['takeback', 'hint', 'draw', 'resign', 'pause', 'decline', 'claim', 'abort'];
const MORE = ['look', 'fix', 'side', 'keep', 'quit'];
const ASKED = ['takeback', 'hint'];  // make sense only while a move is asked for
const ONLY_ELSEWHERE = ['decline', 'claim', 'abort'];
const KEPT = ['takeback', 'draw', 'resign', 'quit'];  // buttons that keep their places, also while they make no sense
const REMEMBERED = 50;  // lines that the field can show again

/**
 * Make them.
 * @param {import('../store.js').Store} store
 * @param {ReturnType<typeof import('../game/board.js').mountBoard>} board
 */
export function mountActions(store, board) {
  const buttons = new Map();
  const one = (word) => {
    const {label, picture, about} = WORDS[word];
    const made = button(label, picture, () => act(word), {title: about, 'data-word': word});
    buttons.set(word, made);
    return made;
  };
  const fresh = button('New game', 'new', another, {title: WORDS.new.about, 'data-word': 'new'});
  const setUp = button('Set up a position', 'setup', () => openEditor(store), {'data-word': 'setup'});
  buttons.set('new', fresh);
  buttons.set('setup', setUp);
  const flip = button('Flip the board', 'flip', () => board.flip(), {'data-word': 'flip'});
  const more = make(
    'details', {class: 'more'},
    make('summary', {}, icon('more'), make('span', {class: 'label'}, 'More')),
    make('div', {class: 'words'}, ...MORE.slice(0, 4).map(one), setUp, flip, one('quit')),
  );
  const menu = make('div', {class: 'more-menu'}, more.querySelector('.words'));
  more.append(menu);
  mountHand(store, board, menu);
  // where it lies over the page, it folds up again once something was chosen, or something else is looked at
  const fold = () => getComputedStyle(menu).position === 'absolute' && more.removeAttribute('open');
  menu.addEventListener('click', (event) => event.target.closest('button') !== null && fold());
  document.addEventListener('pointerdown', (event) => !more.contains(event.target) && fold());
  more.addEventListener('keydown', (event) => {
    if (event.key === 'Escape' && more.open) {
      fold();
      more.querySelector('summary').focus();
    }
  });
  const field = make('input', {
    id: 'line', type: 'text', maxlength: 200, autocomplete: 'off', autocapitalize: 'off', spellcheck: 'false',
    enterkeyhint: 'send', 'aria-label': 'Type a move or a word',
  });
  const send = make('button', {type: 'submit', class: 'quiet', 'aria-label': 'Send'}, icon('send'));
  const form = make('form', {class: 'type', onsubmit: submitted}, field, send);
  byId('actions').append(make('div', {class: 'words first'}, ...FIRST.map(one), fresh), more, form);

  const lines = [];
  let back = 0;

  function submitted(event) {
    event.preventDefault();
    const text = field.value.trim();
    if (text === '' || !store.say(text)) return;
    lines.push(text);
    lines.splice(0, lines.length - REMEMBERED);
    back = 0;
    field.value = '';
  }

  field.addEventListener('keydown', (event) => {
    const step = {ArrowUp: 1, ArrowDown: -1}[event.key];
    if (step === undefined || lines.length === 0) return;
    event.preventDefault();
    back = Math.max(0, Math.min(lines.length, back + step));
    field.value = back === 0 ? '' : lines[lines.length - back];
  });

  async function another() {
    if (store.get('session')?.person) {
      openNewGame(store);
      return;
    }
    const text = 'The current game is given up, and the arm sets up the pieces.';
    if (isOver(store.get('game')) || await confirm({title: 'Another game?', text, yes: 'Begin'})) store.say('new');
  }

  async function act(word) {
    const asks = {
      resign: ['Give up the game?', 'The game is then lost.', 'Resign'],
      quit: ['Leave the game?', "The program ends; 'touchmove resume' continues the game later.", 'Leave'],
      keep: ['Play on from the board as it stands?', 'This game ends, and another begins from what the camera sees.', 'Begin'],
      abort: ['Abort the game?', 'It ends without a result.', 'Abort'],
    };
    if (store.get('remote') !== null) asks.quit[1] = `${ELSEWHERE.quit}.`;
    if (word in asks) {
      const [title, text, yes] = asks[word];
      if (!await confirm({title, text, yes, danger: word !== 'keep'})) return;
    }
    store.say(buttons.get(word).dataset.says ?? word);
  }

  function draw() {
    const [session, game, prompt, remote] = ['session', 'game', 'prompt', 'remote'].map(store.get);
    const holds = store.holds();
    const plays = session !== null && session.person !== null;
    const paused = prompt !== null && prompt.answers.length === 1 && prompt.answers[0] === 'go';
    const over = isOver(game);
    for (const [word, made] of buttons) made.disabled = !holds || (over && !['new', 'setup', 'quit', 'keep'].includes(word));
    for (const word of ASKED) {
      const made = buttons.get(word);
      const waits = remote === null && holds && !over && prompt?.turn !== true;
      made.disabled ||= waits;
      made.title = waits ? `${WORDS[word].about} (once it is your turn)` : WORDS[word].about;
    }
    for (const word of ['takeback', 'draw', 'resign', 'side', 'setup', 'keep']) buttons.get(word).hidden = !plays;
    buttons.get('hint').hidden = !plays || game?.assists === false;
    for (const word of ['look', 'keep', 'fix']) buttons.get(word).hidden = !plays || !session.sees;
    for (const word of ONLY_ELSEWHERE) buttons.get(word).hidden = !plays || remote === null;
    if (remote !== null) elsewhere(remote);
    const {label, picture, about} = WORDS[paused ? 'go' : 'pause'];
    const pause = buttons.get('pause');
    if (pause.dataset.says !== (paused ? 'go' : 'pause')) {
      pause.dataset.says = paused ? 'go' : 'pause';
      pause.title = about;
      pause.replaceChildren(icon(picture), make('span', {class: 'label'}, label));
    }
    const away = store.get('connection') !== 'open';
    const idle = store.get('record') === null ? 'You watch: nothing can be typed here' : 'A recorded game is shown';
    field.disabled = !holds;
    send.disabled = !holds;
    field.placeholder = holds ? (plays ? 'Type a move or a word: Nf3, e2e4, help' : 'Type a word: help') : away ? 'No connection' : idle;
  }

  /** Against somebody elsewhere the game says which words make sense; setting up a position is a new game, too. */
  function elsewhere({words}) {
    for (const [word, made] of buttons) {
      const sense = words.includes(word === 'setup' ? 'new' : word);
      made.disabled ||= !sense;
      if (!KEPT.includes(word)) made.hidden ||= !sense;
      if (word in ELSEWHERE) made.title = ELSEWHERE[word];
    }
  }

  for (const section of ['session', 'game', 'prompt', 'controls', 'connection', 'remote']) store.subscribe(section, draw);
}
