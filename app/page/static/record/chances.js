// What an engine thinks of a recorded game that was analysed: White's winning chances, and what is said of the ply shown.

import {make, say} from '../panels/dom.js';

const SVG = 'http://www.w3.org/2000/svg';
const [WIDTH, HEIGHT] = [1000, 200]; // of the drawing, which is stretched to where it stands
const WORDS = {inaccuracy: '?!', mistake: '?', blunder: '??'};

/** A chart below the film; `seek(ply)` is called for the ply that somebody chooses. */
export class Chances {
  constructor(analysis, seek) {
    this.analysis = analysis;
    this.seek = seek;
    const {moves} = analysis;
    this.width = Math.max(1, moves.length);
    this.now = draw('line', {class: 'tm-chances-now', y1: 0, y2: HEIGHT});
    const wins = [analysis.start_white_wins, ...moves.map((move) => move.white_wins)];
    const points = wins.map((win, ply) => `${this.#x(ply)},${y(win)}`);
    const picture = draw(
      'svg',
      {viewBox: `0 0 ${WIDTH} ${HEIGHT}`, preserveAspectRatio: 'none', 'aria-hidden': 'true'},
      draw('polygon', {class: 'tm-chances-white', points: `0,${HEIGHT} ${points.join(' ')} ${this.#x(moves.length)},${HEIGHT}`}),
      draw('line', {class: 'tm-chances-half', x1: 0, x2: WIDTH, y1: HEIGHT / 2, y2: HEIGHT / 2}),
      this.now,
    );
    this.chart = make('div', {class: 'tm-chances-chart', onclick: (event) => this.#clicked(event)}, picture);
    this.judged = make('ol', {class: 'tm-troubles'}, ...moves.filter((move) => move.judgement).map((move) => this.#judged(move)));
    this.note = make('p', {class: 'tm-sentence', 'aria-live': 'polite'});
    const {opening, engine, sides} = analysis;
    const accuracy = ['white', 'black']
      .filter((side) => sides[side].accuracy !== null)
      .map((side) => `${side === 'white' ? 'White' : 'Black'} ${Math.round(sides[side].accuracy)} % accurate`);
    const lead = [opening && `${opening.eco} ${opening.name}`, ...accuracy, engine].filter(Boolean).join(' · ');
    this.root = make(
      'section',
      {class: 'tm-chances', 'aria-label': 'Analysis'},
      make('h3', {class: 'tm-title'}, 'White’s winning chances'),
      make('p', {class: 'tm-sentence'}, lead),
      this.chart,
      this.note,
      this.judged,
    );
  }

  /** The ply that is shown; 0: the beginning. */
  show(ply) {
    const at = this.#x(ply);
    this.now.setAttribute('x1', at);
    this.now.setAttribute('x2', at);
    const move = this.analysis.moves[ply - 1];
    const wins = Math.round(move ? move.white_wins : this.analysis.start_white_wins);
    say(this.note, `${move ? named(move) : 'At the beginning'}: ${wins} %. ${move?.note ?? ''}`.trim());
  }

  #x(ply) {
    return (WIDTH * ply) / this.width;
  }

  #clicked(event) {
    const box = this.chart.getBoundingClientRect();
    this.seek(Math.round(((event.clientX - box.left) / box.width) * this.width));
  }

  #judged(move) {
    const go = make(
      'button',
      {type: 'button', class: `tm-button tm-${move.judgement}`, onclick: () => this.seek(move.ply)},
      `${named(move)} ${WORDS[move.judgement]}`,
    );
    return make('li', {}, go, ` ${move.note}`);
  }
}

function named(move) {
  return `${move.number}${move.side === 'white' ? '.' : '…'} ${move.san}`;
}

function y(win) {
  return (HEIGHT * (100 - win)) / 100;
}

function draw(name, attributes, ...children) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...children);
  return element;
}
