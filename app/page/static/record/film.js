// The film of a recorded game beside the slider; where there is none, the camera's picture after the last ply.

import {make, say} from '../panels/dom.js';

const DRIFT = 0.12; // [s] a film that plays may be off by so much before it is set right
const STILL_DRIFT = 0.04; // [s] and one that stands

/** Shows what was filmed at a moment of plant time. */
export class Film {
  constructor(record, address) {
    this.address = address;
    this.frame = null;
    // a film that does not say when it begins was begun with the game
    this.begins = record.film ? (record.film_begins ?? record.span[0]) : null;
    this.video = make('video', {
      class: 'tm-video',
      muted: '',
      playsinline: '',
      preload: 'auto',
      'aria-label': 'Film of the game',
      hidden: true,
    });
    this.video.muted = true;
    this.still = make('img', {class: 'tm-video', alt: '', hidden: true});
    this.caption = make('p', {class: 'tm-sentence'});
    this.box = make('div', {class: 'tm-film-frame'}, this.video, this.still);
    this.root = make('div', {class: 'tm-film'}, this.box, this.caption);
    this.video.addEventListener('seeked', () => this.#again());
    this.video.addEventListener('loadedmetadata', () => this.show(this.t, this.ply, this.speed));
    this.video.addEventListener('error', () => {
      this.begins = null;
      this.show(this.t, this.ply, 0);
    });
    Object.assign(this, {t: record.span[0], ply: null, speed: 0, waits: false});
    if (this.begins !== null) this.video.src = `${address}/film`;
  }

  /** A moment: plant time [s], the ply done last (null: none), how fast time runs (0: it stands). */
  show(t, ply, speed) {
    Object.assign(this, {t, ply, speed});
    const at = this.begins === null ? -1 : t - this.begins;
    const filmed = at >= 0 && at <= this.video.duration;
    this.video.hidden = !filmed;
    if (filmed) this.#roll(at, speed);
    else if (!this.video.paused) this.video.pause();
    this.#picture(filmed ? null : ply);
    this.box.hidden = !filmed && this.still.hidden; // nothing but a dark field
    say(this.caption, filmed ? 'Film' : this.still.hidden ? 'Nothing was filmed at this moment.' : this.still.alt);
  }

  #roll(at, speed) {
    const off = Math.abs(this.video.currentTime - at);
    if (speed > 0) {
      // the browser plays it, and it is set right when it has run away
      this.video.playbackRate = speed;
      if (this.video.paused) this.video.play().catch(() => this.#seek(at)); // one that may not play is at least wound
      if (off > DRIFT * Math.max(1, speed)) this.#seek(at);
    } else {
      if (!this.video.paused) this.video.pause();
      if (off > STILL_DRIFT) this.#seek(at);
    }
  }

  #seek(at) {
    this.waits = this.video.seeking;
    if (!this.waits) this.video.currentTime = at;
  }

  #again() {
    if (this.waits) this.show(this.t, this.ply, this.speed);
  }

  #picture(ply) {
    const frame = ply?.frame ?? null;
    this.still.hidden = frame === null;
    if (frame === null || frame === this.frame) return;
    this.frame = frame;
    this.still.src = `${this.address}/frames/${frame}`;
    this.still.alt = `The camera's picture after ${ply.name}`;
  }

  dispose() {
    this.video.pause();
    this.video.removeAttribute('src');
    this.video.load();
    this.root.remove();
  }
}
