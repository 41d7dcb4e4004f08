/** The words of the terminal as the page's buttons have them. */

/** Of a word: what its button says, its picture, and what it does. */
export const WORDS = {
  takeback: {label: 'Take back', picture: 'takeback', about: 'The arm takes back your last move and its own'},
  hint: {label: 'Hint', picture: 'hint', about: 'What the engine would play for you'},
  draw: {label: 'Draw', picture: 'draw', about: 'Offer a draw, or claim one'},
  resign: {label: 'Resign', picture: 'resign', about: 'Give up the game'},
  pause: {label: 'Pause', picture: 'pause', about: 'Stop the clocks'},
  go: {label: 'Continue', picture: 'go', about: 'Continue after a pause'},
  decline: {label: 'Decline', picture: 'decline', about: 'Decline what your opponent proposes'},
  claim: {label: 'Claim', picture: 'claim', about: 'Claim the game, as your opponent has left it'},
  abort: {label: 'Abort', picture: 'abort', about: 'End the game without a result, as it has hardly begun'},
  look: {label: 'Look', picture: 'look', about: 'The camera looks at the board'},
  fix: {label: 'Put right', picture: 'fix', about: 'The arm puts the board right'},
  side: {label: 'Change sides', picture: 'side', about: 'The engine plays for you, and you for it'},
  new: {label: 'New game', picture: 'new', about: 'Give up this game and play another'},
  keep: {label: 'Play on from the board', picture: 'keep', about: 'Another game begins from what the camera sees'},
  quit: {label: 'Leave', picture: 'quit', about: "End the program; 'touchmove resume' continues the game"},
};

/** What some of them do in a game against somebody elsewhere. */
export const ELSEWHERE = {
  takeback: 'Propose to take back your last move, or agree to what your opponent proposes',
  draw: 'Offer a draw, accept the one that is offered, or claim one',
  quit: "Leave the table: the game and its clock go on; 'touchmove resume' takes it up",
};

/** What an answer's button says, where that is not the answer itself. */
const ANSWERS = {
  q: 'Queen', r: 'Rook', b: 'Bishop', n: 'Knight', y: 'Yes', done: 'Done', go: 'Continue', w: 'White',
};

/** What the button of an answer says. */
export function answerLabel(answer) {
  return ANSWERS[answer] ?? WORDS[answer]?.label ?? answer.charAt(0).toUpperCase() + answer.slice(1);
}

/** The words that a sentence tells one to say: those in quotation marks that have a button. */
export function suggested(sentence) {
  const found = [...sentence.matchAll(/'([a-z]+)'/g)].map(([, word]) => word);
  return [...new Set(found)].filter((word) => word in WORDS || word === 'done');
}
