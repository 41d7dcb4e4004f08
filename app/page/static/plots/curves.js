// What is plotted: pure figures of telemetry frames, and the last seconds of them.

export const SPAN = 20; // [s] of plant time are shown
const LEAST_STEP = 0.02; // [s] frames closer to each other are thinned

/** Stiffness k_p [1/s²] at the executed sample of a path: [in the plane, along z₃], or null where none is known. */
export function stiffnessAt(path, motion, executed) {
  if (!path?.stiffness?.length || path.motion !== motion || !(path.stride > 0)) return null;
  const at = Math.min(path.stiffness.length - 1, Math.max(0, Math.round(executed / path.stride)));
  const [x, y, z] = path.stiffness[at];
  return [Math.min(x, y), z];
}

/** The error that protection admits at a stiffness [m]. */
export function admitted(stiffness, {acceleration, least, most}) {
  return Math.max(least, Math.min(most, acceleration / Math.max(stiffness, 1)));
}

const micro = (seconds) => (seconds === null || seconds === undefined ? null : 1e6 * seconds);
const inPlane = (frame) => 1e3 * Math.hypot(frame.reference[0] - frame.tool[0], frame.reference[1] - frame.tool[1]);
const upright = (frame) => 1e3 * Math.abs(frame.reference[2] - frame.tool[2]);
const limit = (axis) => (frame, gains, limits) =>
  gains && limits ? 1e3 * admitted(gains[axis], limits.tracking) : null;

/** The charts from top to bottom. `value(frame, gains, limits)`: what is drawn, null: nothing is known. */
export const CHARTS = [
  {
    title: 'Tracking error',
    unit: 'mm',
    digits: 2,
    least: 0.5,
    series: [
      {name: 'in the plane', colour: 0, value: inPlane},
      {name: 'vertical', colour: 1, value: upright},
      {name: 'limit in the plane', colour: 0, dash: [2, 4], value: limit(0)},
      {name: 'limit vertical', colour: 1, dash: [8, 4], value: limit(1)},
    ],
  },
  {
    title: 'Forces',
    unit: 'N',
    digits: 1,
    least: 6.5,
    series: [
      {name: 'right pad', colour: 0, value: (frame) => frame.tactile[0]},
      {name: 'left pad', colour: 1, value: (frame) => frame.tactile[1]},
      {name: 'on the tool', colour: 2, value: (frame) => Math.hypot(...frame.force)},
      {
        name: 'limit of the gripper',
        colour: 3,
        dash: [8, 4],
        value: (_frame, _gains, limits) => limits?.finger ?? null,
      },
    ],
  },
  {
    title: 'Stiffness',
    unit: '1/s²',
    digits: 0,
    least: 100,
    series: [
      {name: 'in the plane', colour: 0, value: (_frame, gains) => gains?.[0] ?? null},
      {name: 'vertical', colour: 1, value: (_frame, gains) => gains?.[1] ?? null},
    ],
  },
  {
    title: 'Ticks',
    unit: 'µs',
    digits: 0,
    least: 200,
    series: [
      {name: 'lateness', colour: 0, value: (frame) => micro(frame.late)},
      {name: 'work', colour: 1, value: (frame) => micro(frame.work)},
      {
        name: 'length of a tick',
        colour: 3,
        dash: [8, 4],
        value: (_frame, _gains, limits) => micro(limits?.tick ?? null),
      },
    ],
  },
];

/** All values of a frame, chart after chart. */
export function valuesOf(frame, path, limits) {
  const gains = stiffnessAt(path, frame.motion, frame.executed);
  return CHARTS.flatMap(({series}) => series.map(({value}) => value(frame, gains, limits)));
}

/** The last 20 s as columns: times [s], then a column for each series. */
export class Recent {
  constructor() {
    this.clear();
  }

  clear() {
    this.times = [];
    this.columns = CHARTS.flatMap(({series}) => series.map(() => []));
  }

  /** Takes a frame; time that runs back begins anew. Returns whether something was added. */
  take(frame, path, limits) {
    const last = this.times[this.times.length - 1];
    if (frame.t < last) this.clear();
    else if (frame.t - last < LEAST_STEP) return false;
    this.times.push(frame.t);
    valuesOf(frame, path, limits).forEach((value, i) => this.columns[i].push(value));
    const old = this.times.findIndex((time) => time >= frame.t - SPAN);
    if (old > 64) {
      // seldom, and then many at once
      this.times.splice(0, old);
      for (const column of this.columns) column.splice(0, old);
    }
    return true;
  }
}
