/** The bar beside the board: what the player thinks of the position that is shown. */

import {byId} from '../dom.js';

/**
 * Make the bar.
 * @param {import('../store.js').Store} store
 */
export function mountEvaluation(store) {
  const bar = byId('evaluation');
  const [white, text] = [bar.querySelector('.white'), bar.querySelector('.score')];

  function draw() {
    const game = store.get('game');
    bar.hidden = game === null || !game.assists || game.sets_up || !evaluationShown(store);
    if (bar.hidden) return;
    const upTo = store.get('viewing') ?? game.moves.length;
    const score = game.moves.slice(0, upTo).findLast((move) => move.score !== null)?.score ?? null;
    bar.style.setProperty('--share', String(share(score)));
    bar.classList.toggle('from-black', store.get('orientation') === 'black');
    text.textContent = score === null ? '' : short(score);
    const words = score === null ? 'not known yet' : inWords(score);
    bar.setAttribute('aria-label', `Evaluation: ${words}`);
    bar.title = `Evaluation: ${words}`;
    bar.classList.toggle('black-better', share(score) < 0.5);
    white.hidden = false;
  }
  for (const section of ['game', 'viewing', 'orientation', 'evaluation']) store.subscribe(section, draw);
}

/** Whether this browser shows evaluations: against the machine only where somebody has asked for it. */
export function evaluationShown(store) {
  const chosen = store.get('evaluation') ?? store.remembered('evaluation', null);
  return chosen ?? (store.get('game')?.person ?? null) === null;
}

/** White's share of the bar; the curve turns pawns into chances as one is used to it. */
export function share(score) {
  if (score === null) return 0.5;
  if (score.startsWith('#')) return score.startsWith('#-') ? 0 : 1;
  return 1 / (1 + Math.exp(-0.368 * Number(score)));
}

function short(score) {
  return score.startsWith('#') ? score.replace('#-', '#') : Math.abs(Number(score)).toFixed(1);
}

function inWords(score) {
  if (score.startsWith('#')) {
    const many = score.replace(/[#+-]/g, '');
    return `${score.startsWith('#-') ? 'Black' : 'White'} mates in ${many}`;
  }
  const pawns = Number(score);
  if (Math.abs(pawns) < 0.005) return 'equal';
  return `${pawns > 0 ? 'White' : 'Black'} is better by ${Math.abs(pawns).toFixed(2)}`;
}
