// Where the tool is and what it holds, in words: the scene's text for those who do not see it.

const FACING = 0.0005; // [N] rounding

/** What is in the fingers, or an empty text. */
export function inFingers(game) {
  const piece = game?.pieces?.find((one) => one.name === game.held);
  return piece ? `the ${piece.colour} ${piece.kind}` : '';
}

/** The square below a point of the board's frame [m], or words for where else it is. */
function over([x, y], square) {
  const [file, rank] = [Math.floor(x / square + 4), Math.floor(y / square + 4)];
  if (file >= 0 && file < 8 && rank >= 0 && rank < 8) return `over ${'abcdefgh'[file]}${rank + 1}`;
  if (Math.abs(y) <= 4.8 * square) return x < 0 ? 'over the left tray' : 'over the right tray';
  return y > 0 ? 'behind the board' : 'before the board';
}

/** One sentence; with figures for the eye, without them for the ear. */
export function describe(frame, game, view, description, figures = true) {
  if (!frame?.tool) return 'The arm says nothing yet.';
  const at = view.inBoard(frame.tool);
  const held = inFingers(game);
  const what = held ? `holds ${held}` : 'holds nothing';
  const where = `The tool is ${over(at, description.table.square)}`;
  const doing = frame.word ? `; the arm ${frame.word.startsWith('on ') ? 'is ' : ''}${frame.word}` : '';
  if (!figures) return `${where} and ${what}.`;
  const force = Math.hypot(...frame.force);
  const push = force > FACING ? `, ${force.toFixed(1)} N on the tool` : '';
  return `${where}, ${(1000 * at[2]).toFixed(0)} mm above the board, and ${what}${push}${doing}.`;
}
