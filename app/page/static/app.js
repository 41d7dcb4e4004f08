/** Entry of the page: the store, the connection, and the parts of the page, the heavy ones when they are first opened. */

import {connect} from './connection.js';
import {openGames} from './dialogs/games.js';
import {openSettings} from './dialogs/settings.js';
import {button, byId, takesKeys} from './dom.js';
import {mountBoard} from './game/board.js';
import {mountEvaluation} from './game/evaluation.js';
import {layGrid} from './game/grid.js';
import {mountMoves} from './game/moves.js';
import {mountPlayers} from './game/players.js';
import {mountPanels} from './panels.js';
import {readPlace} from './record/address.js';
import {createStore} from './store.js';
import {mountActions} from './talk/actions.js';
import {mountAnnouncements} from './talk/announce.js';
import {mountAsk} from './talk/ask.js';
import {makeBanners, mountNews} from './talk/banners.js';
import {mountControls} from './talk/controls.js';
import {mountLog} from './talk/log.js';
import {makeSounds} from './talk/sound.js';
import {makeVoice} from './talk/speech.js';
import {mountStop} from './talk/stop.js';

const store = createStore();
const banners = makeBanners();
mountStop(store, banners);  // before everything that could fail
const board = mountBoard(store);
const voice = makeVoice(store);
const announce = mountAnnouncements(store, voice.speak);
const sounds = makeSounds(store);
layGrid(byId('board-frame'), board, announce, 'Chess board: arrow keys move, Enter lifts and puts down, Escape cancels');
mountPlayers(store, (side) => {
  const person = store.get('game')?.person ?? null;
  if (person === null || person === side) sounds.play('low');
});
mountMoves(store);
mountEvaluation(store);
mountAsk(store, board);
mountActions(store, board);
mountLog(store, board.mark);
mountControls(store, banners);
mountNews(store, banners);
mountPanels(store);

byId('open-games').addEventListener('click', () => openGames(store));
byId('open-settings').addEventListener('click', () => openSettings(store, {sounds, voice}));

// a record that a link leads to, that the program was started to show, or that somebody chose
let linked = readPlace().game;
let told = null;
store.subscribe('session', (session) => {
  if (session === null) return;
  document.body.classList.toggle('recorded', session.live === false && !session.ended);
  const shows = linked ?? (session.shows === told ? null : session.shows);  // told again, it is not chosen again
  linked = null;
  told = session.shows ?? null;
  if (shows) store.showRecord(shows);
});
store.subscribe('record', (id) => {
  const back = button('Back to the game', 'back', () => store.showRecord(null), {class: 'primary'});
  const live = store.get('session')?.live !== false;
  banners.set('record', id !== null && live ? {kind: 'note', text: 'A recorded game is shown.', actions: [back]} : null);
});

document.addEventListener('keydown', (event) => {
  if (event.altKey || event.ctrlKey || event.metaKey || takesKeys(event.target)) return;
  if (event.key === '/') {
    event.preventDefault();
    byId('line').focus();
  } else if (event.key === 'f') {
    board.flip();
  }
});

connect(store);
