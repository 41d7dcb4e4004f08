// Between two telemetry frames: what is drawn follows the newest one by the time from frame to frame.

const SHORTEST = 20; // [ms] frames that come faster are taken as if they came so
const LONGEST = 150; // [ms] a pause is not smeared over more
const JUMP = 0.15; // [m] further from frame to frame nobody moves: another moment of a record

/** Takes frames as they come, and says what to draw at a time of the browser's clock [ms]. */
export class Blend {
  #from = null;
  #to = null;
  #arrived = 0;
  #span = 50;

  /** A frame that has come; `exactly`: it is drawn as it is, at once. */
  take(frame, now, exactly = false) {
    const moved = this.#to ? Math.hypot(...frame.tool.map((value, k) => value - this.#to.tool[k])) : Infinity;
    if (exactly || moved > JUMP) {
      this.#from = this.#to = frame;
    } else {
      this.#from = this.at(now);
      this.#to = frame;
      this.#span = Math.min(LONGEST, Math.max(SHORTEST, now - this.#arrived));
    }
    this.#arrived = now;
  }

  /** Whether the newest frame is not reached yet. */
  moving(now) {
    return this.#from !== this.#to && now < this.#arrived + this.#span;
  }

  /** Angles, tool, finger, force and executed samples at a time; null before the first frame. */
  at(now) {
    if (this.#to === null) return null;
    const share = Math.min(1, Math.max(0, (now - this.#arrived) / this.#span));
    if (share >= 1 || this.#from === this.#to) return this.#to;
    const mix = (a, b) => a + share * (b - a);
    const mixed = {...this.#to};
    for (const name of ['tool', 'angles', 'force'])
      mixed[name] = this.#to[name].map((value, k) => mix(this.#from[name][k], value));
    mixed.finger = mix(this.#from.finger, this.#to.finger);
    if (this.#from.motion === this.#to.motion) mixed.executed = mix(this.#from.executed, this.#to.executed);
    return mixed;
  }
}
