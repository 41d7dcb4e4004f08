// The telemetry of a recorded game as columns, and a frame of it for any moment.

import {CHARTS, SPAN, valuesOf} from '../plots/curves.js';

const POINTS = 64; // of a path
const MIXED = ['tool', 'reference', 'velocity', 'angles', 'force', 'torque', 'tactile', 'finger'];

/** Made once of telemetry.json: `columns` by the names of a telemetry frame, of vectors a list for each component. */
export class Trace {
  constructor({columns}) {
    this.columns = columns;
    this.t = columns.t;
    this.path = null;
    this.values = null;
  }

  /** Index of the last row that is not later than a time; 0 before the first. */
  at(t) {
    let [low, high] = [0, this.t.length - 1];
    while (low < high) {
      const middle = Math.ceil((low + high) / 2);
      if (this.t[middle] <= t) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  /** The frame of a row. */
  row(index) {
    const frame = {type: 'telemetry', exact: true};
    for (const [name, column] of Object.entries(this.columns)) {
      frame[name] = Array.isArray(column[0]) ? column.map((one) => one[index]) : column[index];
    }
    return frame;
  }

  /** The frame at a time, between two rows where they follow each other closely. */
  frame(t) {
    const i = this.at(t);
    const frame = this.row(i);
    const next = i + 1;
    if (next >= this.t.length || t <= this.t[i]) return frame;
    const share = Math.min(1, (t - this.t[i]) / (this.t[next] - this.t[i]));
    const after = this.row(next);
    for (const name of MIXED) {
      if (Array.isArray(frame[name])) frame[name] = frame[name].map((value, k) => mix(value, after[name][k], share));
      else frame[name] = mix(frame[name], after[name], share);
    }
    if (this.columns.motion[i] === this.columns.motion[next]) {
      frame.executed = mix(this.columns.executed[i], this.columns.executed[next], share);
    }
    frame.t = Math.min(t, this.t[next]);
    return frame;
  }

  /** The section `path` at a time: the reference of the motion under way, from its own telemetry; null between motions. */
  pathAt(t) {
    const motions = this.columns.motion;
    const i = this.at(t);
    const motion = motions[i];
    if (motion === 0) return null;
    if (this.path?.motion === motion) return this.path;
    let [first, last] = [i, i];
    while (first > 0 && motions[first - 1] === motion) first -= 1;
    while (last + 1 < motions.length && motions[last + 1] === motion) last += 1;
    const samples = this.columns.executed[last];
    const count = Math.max(2, Math.min(POINTS, last - first + 1));
    const points = Array.from({length: count}, (_, k) => {
      // points a stride of samples apart, as live: by samples, not by rows, since a motion can be stretched
      const sample = (k * samples) / (count - 1);
      let row = first;
      while (row < last && this.columns.executed[row + 1] <= sample) row += 1;
      return this.columns.reference.map((column) => column[row]);
    });
    this.path = {label: '', motion, points, stiffness: [], stride: samples / (count - 1)};
    return this.path;
  }

  /** The 20 s before a time as the plots want them: times and a column for each series. */
  until(t, limits) {
    if (this.values === null || this.limits !== limits) {
      this.limits = limits;
      this.values = CHARTS.flatMap(({series}) => series.map(() => []));
      for (let i = 0; i < this.t.length; i += 1) {
        valuesOf(this.row(i), null, limits).forEach((value, k) => this.values[k].push(value));
      }
    }
    const end = this.at(t) + 1;
    const start = this.at(t - SPAN);
    return {times: this.t.slice(start, end), columns: this.values.map((column) => column.slice(start, end))};
  }
}

function mix(a, b, share) {
  return a === null || b === null ? a : a + share * (b - a);
}
