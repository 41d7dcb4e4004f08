// The last 20 s in figures: tracking error, forces, stiffness, ticks, on one axis of plant time.

import {announce, make, say, silence, toggle, useStyles} from './panels/dom.js';
import {coloursNow, onTheme} from './panels/theme.js';
import {watchWhileSeen} from './panels/watch.js';
import {robotAddress} from './panels/addresses.js';
import {CHARTS, Recent, SPAN} from './plots/curves.js';
import uPlot from './vendor/uplot/uPlot.esm.js';

const PERIOD = 100; // [ms] between two drawings
const HEIGHT = 132; // of a chart [px]
const WORTH = 2; // a limit is drawn that is no further off than so many times what was measured
const LOWEST = 158; // of the one with the axis of time
const TOKENS = ['--muted', '--line', '--curve-0', '--curve-1', '--curve-2', '--curve-3']; // what a canvas is painted with

/** Plots in an element what the store's telemetry says; returns what takes them out again. */
export function mount(element, store) {
  useStyles();
  useStyles('./vendor/uplot/uPlot.min.css');
  const plots = new Plots(element, store);
  return () => plots.stop();
}

class Plots {
  constructor(element, store) {
    Object.assign(this, {store, recent: new Recent(), limits: null, path: null, timer: 0, paused: false, seen: false});
    this.charts = [];
    this.colours = coloursNow(TOKENS);
    this.root = make('div', {class: 'tm-panel tm-plots'});
    this.state = make('p', {class: 'tm-sentence'}, 'Waiting for the arm …');
    this.live = make('p', {class: 'tm-hidden', role: 'status'});
    this.pause = toggle('Pause', false, (on) => this.hold(on));
    this.root.append(make('div', {class: 'tm-tools'}, this.pause, this.state), this.live);
    this.sync = uPlot.sync(`tm-${Math.random()}`);
    for (const chart of CHARTS) this.add(chart);
    element.append(this.root);
    this.sizes = new ResizeObserver(() => this.resize());
    this.sizes.observe(this.root);
    this.ends = [
      onTheme(() => this.recolour()),
      watchWhileSeen(this.root, store, 'telemetry', (seen) => this.show(seen)),
      store.subscribe('path', (path) => (this.path = path)),
      store.subscribe('telemetry', (frame) => this.take(frame)),
    ];
    fetch(robotAddress(store))
      .then((answer) => (answer.ok ? answer.json() : null))
      .then((robot) => (this.limits = robot?.limits ?? null))
      .catch(() => (this.limits = null)); // without limits there are fewer lines, and nothing else is missing
  }

  add(chart) {
    const first = this.charts.reduce((sum, one) => sum + one.chart.series.length, 0);
    const last = chart === CHARTS[CHARTS.length - 1];
    const values = chart.series.map(() => make('td', {}, '–'));
    const rows = chart.series.map(({name, colour, dash}, i) =>
      make('tr', {}, make('th', {scope: 'row'}, swatch(colour, dash), name), values[i]),
    );
    const table = make(
      'table',
      {class: 'tm-legend'},
      make('caption', {}, `${chart.title} [${chart.unit}]`),
      make('tbody', {}, ...rows),
    );
    const drawing = make('div', {
      class: 'tm-chart',
      role: 'img',
      'aria-label': `${chart.title} over time; the table has the newest figures`,
    });
    this.root.append(make('div', {class: 'tm-figure'}, table, drawing));
    const paint = (token) => () => this.colours[token];
    const axis = {
      stroke: paint('--muted'),
      grid: {stroke: paint('--line'), width: 1},
      ticks: {stroke: paint('--line'), width: 1},
      font: '12px system-ui, sans-serif',
    };
    const plot = new uPlot(
      {
        width: 300,
        height: last ? LOWEST : HEIGHT,
        legend: {show: false},
        pxAlign: false,
        padding: [8, 14, 0, 0],
        cursor: {sync: {key: this.sync.key}, drag: {x: false, y: false}, points: {size: 5}},
        scales: {
          x: {time: false, range: () => this.span()},
          y: {range: (self) => heights(self, chart)},
        },
        axes: [
          {
            ...axis,
            values: (_, splits) => splits.map((t) => (last && t >= 0 ? String(t) : '')),
            label: last ? 'plant time [s]' : undefined,
            labelSize: last ? 18 : 0,
            labelFont: '12px system-ui, sans-serif',
            size: last ? 30 : 4,
          },
          {...axis, size: 54},
        ],
        series: [
          {},
          ...chart.series.map(({name, colour, dash}) => ({
            label: name,
            width: dash ? 1.25 : 1.75,
            dash,
            points: {show: false},
            spanGaps: false,
            stroke: paint(`--curve-${colour}`),
          })),
        ],
        hooks: {setCursor: [(self) => this.read(self.cursor.idx)]},
      },
      [[], ...chart.series.map(() => [])],
      drawing,
    );
    this.charts.push({chart, plot, values, first});
  }

  stop() {
    clearInterval(this.timer);
    this.sizes.disconnect();
    this.ends.forEach((end) => end());
    silence(this.live);
    for (const {plot} of this.charts) plot.destroy();
    this.root.remove();
  }

  show(seen) {
    this.seen = seen;
    clearInterval(this.timer);
    if (seen) {
      this.timer = setInterval(() => this.draw(), PERIOD);
      this.fresh = true;
      this.resize();
    }
  }

  hold(on) {
    this.paused = on;
    this.fresh = true;
    announce(this.live, on ? 'The plots are paused.' : 'The plots continue.');
  }

  take(frame) {
    if (!frame?.tool || frame.tool.includes(null) || this.paused) return;
    const trace = this.store.get('trace');
    if (trace && frame.exact) {
      this.recent = trace.until(frame.t, this.limits);
      this.fresh = true;
    } else {
      if (!(this.recent instanceof Recent)) this.recent = new Recent(); // those of a record were shown
      if (this.recent.take(frame, this.path, this.limits)) this.fresh = true;
    }
    this.newest = frame;
  }

  span() {
    const {times} = this.recent;
    const end = times[times.length - 1] ?? SPAN;
    return [end - SPAN, end];
  }

  draw() {
    if (!this.fresh) return;
    this.fresh = false;
    const {times, columns} = this.recent;
    for (const {chart, plot, first} of this.charts) {
      plot.setData([times, ...columns.slice(first, first + chart.series.length)]);
    }
    this.read(null);
    if (this.newest) {
      const running = this.paused ? 'Paused' : 'Newest figures';
      say(
        this.state,
        `${running} at ${this.newest.t.toFixed(1)} s of plant time${this.newest.word ? `: ${this.newest.word}` : ''}`,
      );
    }
  }

  /** Figures beside the charts: below the cursor, else the newest. */
  read(index) {
    const {times, columns} = this.recent;
    if (times.length === 0) return;
    const at = index ?? times.length - 1;
    for (const {chart, values, first} of this.charts) {
      chart.series.forEach((_, i) => {
        const value = columns[first + i][at];
        say(values[i], figure(value, chart.digits));
      });
    }
  }

  resize() {
    for (const {plot} of this.charts) {
      const width = plot.root.parentElement.clientWidth;
      if (width > 0 && width !== plot.width) plot.setSize({width, height: plot.height});
    }
  }

  recolour() {
    this.colours = coloursNow(TOKENS);
    for (const {plot} of this.charts) plot.redraw(false, true);
  }
}

/** From zero, or below, to what was measured; up to a limit where that is not far above it. */
function heights(plot, {series, least}) {
  let [low, high, limit] = [0, least, 0];
  const [from, to] = plot.series[0].idxs ?? [0, -1];
  series.forEach(({dash}, i) => {
    for (let k = from; k <= to; k += 1) {
      const value = plot.data[i + 1][k];
      if (value === null || value === undefined) continue;
      if (dash) limit = Math.max(limit, value);
      else [low, high] = [Math.min(low, value), Math.max(high, value)];
    }
  });
  return [low, 1.08 * (limit <= WORTH * high ? Math.max(high, limit) : high)];
}

/** A number without a sign before zero; a dash where there is none. */
function figure(value, digits) {
  if (value === null || value === undefined) return '–';
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace('-', '') : text;
}

/** A short piece of line as in the chart; its look is a class of the style sheet. */
function swatch(colour, dash) {
  return make('span', {class: `tm-swatch tm-curve-${colour}${dash ? ' tm-dashed' : ''}`, 'aria-hidden': 'true'});
}
