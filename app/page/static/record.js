// Recorded games: the list of them, and one of them under one slider that moves film, board, arm and plots.

import {announce, make, say, silence, useStyles} from './panels/dom.js';
import {whileSeen} from './panels/watch.js';
import {readPlace, writePlace} from './record/address.js';
import {gameList} from './record/list.js';
import {Player} from './record/player.js';

/** Shows recorded games in an element; returns what takes them out again. */
export function mount(element, store) {
  useStyles();
  const records = new Records(element, store);
  return () => records.stop();
}

class Records {
  constructor(element, store) {
    Object.assign(this, {store, player: null, opening: null, listed: false});
    this.list = make('div', {class: 'tm-games'});
    this.place = make('div', {});
    this.sentence = make('p', {class: 'tm-sentence'});
    this.live = make('p', {class: 'tm-hidden', role: 'status'});
    this.root = make('div', {class: 'tm-panel tm-record'}, this.sentence, this.place, this.list, this.live);
    element.append(this.root);
    const moved = () => this.follow(readPlace());
    window.addEventListener('hashchange', moved);
    this.ends = [
      () => window.removeEventListener('hashchange', moved),
      whileSeen(this.root, (seen) => {
        if (seen && !this.listed && this.opening === null && this.player === null) this.showList();
        if (!seen) this.player?.pause();
      }),
      store.subscribe('record', (id) => this.chosen(id)),
    ];
    const {game} = readPlace();
    if (game !== null && store.get('record') === null) this.open(game);
  }

  stop() {
    this.ends.forEach((end) => end());
    this.drop();
    silence(this.live);
    this.root.remove();
  }

  async showList() {
    this.listed = true;
    try {
      const games = await json('/games');
      this.list.replaceChildren(gameList(games, (id) => this.open(id)));
      if (this.player === null)
        say(this.sentence, games.length ? 'Choose a game to see it again.' : 'No game has been recorded yet.');
    } catch (error) {
      this.listed = false;
      say(this.sentence, `The list of games did not arrive (${error.message}): open this view again.`);
    }
  }

  /** The fragment names a game and a moment. */
  follow({game, t}) {
    if (game === null) return;
    if (this.player?.id !== game) this.open(game);
    else if (t !== null) this.player.seek(t);
  }

  chosen(id) {
    if (id === null) this.drop();
    else if (id !== this.player?.id && id !== this.opening?.id) this.open(id);
  }

  /** Shows a game from the moment that the address names, or from its beginning. */
  async open(id) {
    this.drop();
    const mine = (this.opening = {id});
    const place = readPlace();
    say(this.sentence, 'The game is being read …');
    const address = `/games/${encodeURIComponent(id)}`;
    try {
      const record = await json(`${address}/record.json`);
      if (this.opening !== mine) return;
      this.player = new Player(this.store, {id, address, record});
    } catch (error) {
      if (this.opening !== mine) return;
      this.opening = null;
      say(this.sentence, `This game cannot be shown: ${error.message}`);
      return;
    }
    this.opening = null;
    this.store.showRecord(id);
    say(this.sentence, '');
    this.place.replaceChildren(this.player.root);
    this.player.onclose = () => {
      this.close();
      writePlace(null, null);
    };
    this.list.hidden = true;
    this.player.start(place.game === id ? place.t : null);
    this.readTelemetry(this.player);
    announce(this.live, `${this.player.title} is shown; the slider is below the film.`);
  }

  /** Telemetry comes after the game: it takes the server a moment. */
  async readTelemetry(player) {
    say(this.sentence, 'The telemetry is being read …');
    let telemetry = null;
    let why = '';
    try {
      // games on the rig "board" have none, and that of a match lies in its first folder: the server knows
      telemetry = await json(`${player.address}/telemetry.json`);
    } catch (error) {
      why = `The arm stands still: ${error.message}`;
    }
    if (this.player !== player) return;
    say(this.sentence, why);
    if (telemetry !== null) player.follow(telemetry);
  }

  /** Goes back to what is played. */
  close() {
    this.drop();
    this.store.showRecord(null);
    say(this.sentence, 'Choose a game to see it again.');
  }

  drop() {
    this.opening = null;
    this.player?.stop();
    this.player = null;
    this.list.hidden = false;
  }
}

/** What an address answers, as JSON. Throws a sentence. */
async function json(address) {
  const answer = await fetch(address);
  if (answer.ok) return answer.json();
  const text = (await answer.text()).trim();
  throw new Error(text && text.length < 300 ? text : `the server answered ${answer.status}`);
}
