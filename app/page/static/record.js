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
        if (seen && !this.listed) this.showList();
        if (!seen) this.player?.pause();
      }),
      store.subscribe('record', (id) => this.chosen(id)),
    ];
    const place = readPlace();
    const shows = store.get('session')?.shows ?? null;
    if (place.game !== null) this.follow(place);
    else if (shows !== null && store.get('record') === null) this.open(shows, null);
  }

  stop() {
    this.close();
    this.ends.forEach((end) => end());
    silence(this.live);
    this.root.remove();
  }

  async showList() {
    this.listed = true;
    try {
      const games = await json('/games');
      this.list.replaceChildren(gameList(games, (id) => this.open(id, null)));
      if (this.player === null)
        say(this.sentence, games.length ? 'Choose a game to see it again.' : 'No game has been recorded yet.');
    } catch (error) {
      this.listed = false;
      say(this.sentence, `The list of games did not come (${error.message}): open this view again.`);
    }
  }

  /** The fragment names a game and a moment. */
  follow({game, t}) {
    if (game === null) return;
    if (this.player?.id === game) {
      if (t !== null) this.player.seek(t);
    } else {
      this.open(game, t);
    }
  }

  chosen(id) {
    if (id === null) this.close();
    else if (id !== this.player?.id && id !== this.opening) this.open(id, null);
  }

  async open(id, t) {
    this.close();
    this.opening = id;
    say(this.sentence, 'The game is being read …');
    const address = `/games/${encodeURIComponent(id)}`;
    try {
      const record = await json(`${address}/record.json`);
      if (this.opening !== id) return;
      this.player = new Player(this.store, {id, address, record});
    } catch (error) {
      if (this.opening === id) this.opening = null;
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
    this.player.start(t);
    this.readTelemetry(this.player);
    announce(this.live, `${this.player.title} is shown; the slider is below the film.`);
  }

  /** Telemetry comes after the game: it takes the server a moment. */
  async readTelemetry(player) {
    say(this.sentence, 'The telemetry is being read …');
    let telemetry = null;
    try {
      // games on the rig "board" have none, and that of a match lies in its first folder: the server knows
      const answer = await fetch(`${player.address}/telemetry.json`);
      if (answer.ok) telemetry = await answer.json();
    } catch (error) {
      console.error(error);
    }
    if (this.player !== player) return;
    say(this.sentence, telemetry === null ? 'There is no telemetry of this game: the arm stands still.' : '');
    if (telemetry !== null) player.follow(telemetry);
  }

  close() {
    this.opening = null;
    if (this.player === null) return;
    this.player.stop();
    this.player = null;
    this.store.showRecord(null);
    say(this.sentence, 'Choose a game to see it again.');
  }
}

/** What an address answers, as JSON. Throws a sentence. */
async function json(address) {
  const answer = await fetch(address);
  if (answer.ok) return answer.json();
  const text = (await answer.text()).trim();
  throw new Error(text && text.length < 300 ? text : `the server answered ${answer.status}`);
}
