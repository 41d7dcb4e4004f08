/** Reads moves and questions out: in a line for screen readers, and by voice where this browser is told to. */

import {byId} from '../dom.js';
import {isOver, other, outcome, spoken, turnOf} from '../game/position.js';

/**
 * Read out what happens.
 * @param {import('../store.js').Store} store
 * @param {(sentence: string) => void} speak says a sentence aloud, where that is wanted.
 * @returns {(sentence: string) => void} puts a sentence into the line.
 */
export function mountAnnouncements(store, speak) {
  const line = byId('announce');
  let game = null;
  let asked = null;  // id of the last question; null: the game has said nothing yet
  let heard = null;  // id of the last entry of the log that was read

  function announce(sentence) {
    // the same sentence twice is a change as well
    line.textContent = line.textContent === sentence ? `${sentence}\u00a0` : sentence;
  }

  function moved(next) {
    const before = game;
    game = next === null ? null : {id: next.id, plies: next.moves.length, over: isOver(next)};
    if (before === null || game === null || before.id !== game.id) return;
    if (game.plies > before.plies) {
      // both sides' at once where news came late; of a game that was away for longer only the last ones
      const words = next.moves.slice(Math.max(before.plies, game.plies - 2))
        .map((move) => `${side(other(turnOf(move.fen)))}: ${spoken(move.san)}`);
      announce(words.join('; '));
      words.forEach(speak);
    } else if (game.plies < before.plies) {
      announce('taken back');
      speak('taken back');
    }
    if (game.over && !before.over) {
      const words = `The game is over: ${outcome(next)}`;
      announce(words);
      speak(words);
    }
  }

  store.subscribe('game', moved);
  store.subscribe('prompt', (prompt) => {
    const first = asked === null;  // it has been asked before this browser came
    asked ??= 0;
    if (prompt === null || prompt.id === asked) return;
    asked = prompt.id;
    announce(prompt.text);
    // that it is one's move is heard from the other's move; what else the robot asks is said
    if (!prompt.turn && !first) speak(prompt.text);
  });
  store.subscribe('log', (log) => {
    const entries = log ?? [];
    const last = entries.at(-1)?.id ?? 0;
    if (heard !== null) {
      for (const entry of entries.filter(({id, kind}) => id > heard && (kind === 'say' || kind === 'trouble'))) {
        speak(entry.text);
      }
    }
    heard = last;
  });
  return announce;
}

function side(colour) {
  return colour === 'white' ? 'White' : 'Black';
}
