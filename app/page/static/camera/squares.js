// The squares of a look at the board, in the picture and in words.

const FILES = 'abcdefgh';

/** Name of a square, 0 = a1, 1 = b1, … 63 = h8. */
export function squareName(index) {
  return `${FILES[index % 8]}${Math.floor(index / 8) + 1}`;
}

/** Every square with its corners in the picture [px], its middle, its size and what is thought of it; none without a grid. */
export function quads(look) {
  const {grid, squares, unsure} = look;
  if (grid?.length !== 81) return [];
  return Array.from({length: 64}, (_, index) => {
    const first = 9 * Math.floor(index / 8) + (index % 8);
    const corners = [grid[first], grid[first + 1], grid[first + 10], grid[first + 9]];
    const centre = [0, 1].map((k) => corners.reduce((sum, corner) => sum + corner[k], 0) / 4);
    const size = Math.sqrt(area(corners));
    const name = squareName(index);
    const {seen = 'empty', sure = 0} = squares?.[index] ?? {};
    return {name, corners, centre, size, seen, sure, unsure: (unsure ?? []).includes(name)};
  });
}

function area(corners) {
  const twice = corners.reduce((sum, [x, y], i) => {
    const [u, v] = corners[(i + 1) % corners.length];
    return sum + x * v - u * y;
  }, 0);
  return Math.abs(twice) / 2;
}

/** How many pieces of each side are seen. */
export function seenInWords({squares}) {
  if (!squares?.length) return '';
  const count = (side) => squares.filter(({seen}) => seen === side).length;
  return `Seen: ${count('white')} white and ${count('black')} black pieces.`;
}

/** The squares that vision is unsure of, each with what it thinks. */
export function unsureInWords({squares, unsure}) {
  if (!unsure?.length) return '';
  const each = unsure.map((name) => {
    const index = FILES.indexOf(name[0]) + 8 * (Number(name[1]) - 1);
    const square = squares?.[index];
    return square ? `${name} (${square.seen}, ${Math.round(100 * square.sure)} %)` : name;
  });
  return `Not sure of ${each.join(', ')}.`;
}
