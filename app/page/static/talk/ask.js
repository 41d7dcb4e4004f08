/** The card that says what goes on, or what the robot needs, and takes the answer. */

import {byId, button, capital, icon, make} from '../dom.js';
import {openGames} from '../dialogs/games.js';
import {openNewGame} from '../dialogs/newgame.js';
import {isOver, outcome, seeks} from '../game/position.js';
import {WORDS, answerLabel, suggested} from './words.js';

const BARE = 10;  // 'done?', 'go on?' [characters]

/**
 * Make the card.
 * @param {import('../store.js').Store} store
 * @param {ReturnType<typeof import('../game/board.js').mountBoard>} board
 */
export function mountAsk(store, board) {
  const card = byId('ask');
  const parts = {
    picture: make('span', {class: 'ask-picture', 'aria-hidden': 'true'}),
    title: make('h2', {class: 'ask-title'}),
    detail: make('p', {class: 'ask-detail'}),
    answers: make('div', {class: 'answers'}),
  };
  card.append(make('div', {class: 'ask-head'}, parts.picture, make('div', {}, parts.title, parts.detail)), parts.answers);
  let drawn = '';

  /** What the robot has just said, unless something has been said or done since; what takes many lines is in the log. */
  function context() {
    const last = (store.get('log') ?? []).at(-1);
    const said = last?.kind === 'say' || last?.kind === 'trouble';
    return said && !last.text.includes('\n') ? last.text : '';
  }

  function what() {
    const [session, game, prompt, controls, phase, remote] = ['session', 'game', 'prompt', 'controls', 'phase', 'remote'].map(store.get);
    const holds = store.holds();
    if (session === null) return {mood: 'wait', title: 'Connecting to the game', detail: ''};
    if (store.get('connection') !== 'open' && session.live !== false) {
      return {mood: 'wait', title: 'Waiting for the connection', detail: 'The board shows its last known position.'};
    }
    if (store.get('record') !== null) {
      return {mood: 'over', title: 'A recorded game', detail: game === null ? '' : `${game.white} – ${game.black}`};
    }
    if (session.live === false && !session.ended) {
      return {mood: 'wait', title: 'Recorded games', detail: 'Choose one to look at.', games: true};
    }
    if (session.live === false) {
      return {mood: 'over', title: 'The program has ended', detail: capital(session.ended ?? '')};
    }
    const watching = controls?.holder === null ? 'Nobody has the controls: take them to play.'
      : 'You watch; whoever has the controls answers.';
    if (prompt !== null && !prompt.turn) {
      const question = capital(prompt.text.replace(/\s*\(yes or no\)$/, '').replace(/\? q, r, b or n$/, '?'));
      const before = capital(context());
      // what was said is the sentence where the question is only whether it is done
      const bare = before !== '' && question.length <= BARE;
      const detail = before !== question && !bare ? before : '';
      return {
        mood: 'ask', title: bare ? before : question, detail: holds ? detail : `${detail} ${watching}`.trim(),
        answers: holds ? prompt.answers : [],
      };
    }
    if (isOver(game) && prompt === null && !seeks(remote)) {
      const again = holds && session.person !== null && remote === null;
      return {mood: 'over', title: 'The game is over', detail: outcome(game), again};
    }
    if (prompt !== null) {
      const pending = board.pending();
      if (pending !== null) return {mood: 'work', title: 'Your move is being made', detail: capital(phase ?? '')};
      const side = capital(game?.turn ?? session.person ?? '');
      if (!holds) return {mood: 'wait', title: `${side} to move`, detail: watching};
      const said = context();
      const how = session.sees && !session.hands ? 'Make it on the board; the camera sees it' : `You play ${side}`;
      return {
        mood: 'turn', title: 'Your move', detail: said === '' ? how : capital(said), answers: answers(said, remote),
      };
    }
    const said = context();
    return {
      mood: 'work', title: capital(phase || 'The robot is at work'), detail: capital(said),
      answers: remote !== null && holds && session.person !== null ? answers(said, remote) : [],
    };
  }

  /** What a sentence tells one to say; against somebody elsewhere while that makes sense. */
  function answers(sentence, remote) {
    return suggested(sentence).filter((word) => remote === null || remote.words.includes(word));
  }

  function draw() {
    const now = what();
    const session = store.get('session');
    const key = JSON.stringify(now);
    if (key === drawn) return;
    drawn = key;
    card.dataset.mood = now.mood;
    const pictures = {ask: 'ask', turn: 'turn', work: 'work', over: 'over', wait: 'wait'};
    parts.picture.replaceChildren(icon(pictures[now.mood]));
    parts.title.textContent = now.title;
    parts.title.classList.toggle('long', now.title.length > 70);
    parts.detail.textContent = now.detail;
    parts.detail.hidden = now.detail === '';
    const chooses = session?.person && store.get('remote') === null;
    const made = (now.answers ?? []).map((answer, index) => button(
      answerLabel(answer), WORDS[answer]?.picture ?? null,
      () => (answer === 'new' && chooses ? openNewGame(store) : store.say(answer)),
      {class: index === 0 ? 'primary' : '', 'data-answer': answer},
    ));
    if (now.games) made.push(button('Recorded games', 'games', () => openGames(store), {class: 'primary'}));
    if (now.again) made.push(button('New game', 'new', () => openNewGame(store), {class: 'primary'}));
    const inside = parts.answers.contains(document.activeElement);
    parts.answers.replaceChildren(...made);
    parts.answers.hidden = made.length === 0;
    if (inside && made.length > 0) made[0].focus();
  }

  for (const section of ['session', 'game', 'prompt', 'controls', 'phase', 'log', 'connection', 'remote']) {
    store.subscribe(section, draw);
  }
  board.listen(draw);
}
