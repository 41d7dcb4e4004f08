// Shapes as triangles: turned pieces and what is carved of them, z up, the foot's middle at the origin [m].

import {
  BufferAttribute,
  BufferGeometry,
  ExtrudeGeometry,
  Shape,
  SplineCurve,
  Vector2,
  BoxGeometry,
} from '../vendor/three/three.module.js';

const SEGMENTS = 26; // around a turned piece that is not carved
const PER_TOOTH = {square: 10, wave: 6}; // around one that is: segments of each tooth
const LONG = 0.0018; // [m] a shorter stretch of an outline is round enough
const CREASE = Math.cos((38 * Math.PI) / 180); // two faces that meet more sharply keep their edge
const CORNER = (50 * Math.PI) / 180; // an outline that turns more than that has a corner there

/** Outline with a few more points where it is round; corners and everything from `end` on stay as they are. */
function refined(outline, end) {
  const direction = (a, b) => Math.atan2(b[1] - a[1], b[0] - a[0]);
  const turns = (i) => {
    if (i < 1 || i >= outline.length - 1) return true;
    const bend = Math.abs(direction(outline[i - 1], outline[i]) - direction(outline[i], outline[i + 1]));
    return Math.min(bend, 2 * Math.PI - bend) > CORNER;
  };
  const points = [];
  outline.forEach((point, i) => {
    points.push({point, ring: i});
    if (i + 1 >= Math.min(end, outline.length)) return;
    if (turns(i) && turns(i + 1)) return;
    if (Math.hypot(outline[i + 1][0] - point[0], outline[i + 1][1] - point[1]) < LONG) return;
    const before = turns(i) ? outline[i] : outline[i - 1];
    const after = turns(i + 1) ? outline[i + 1] : outline[i + 2];
    points.push({point: [0, 1].map((k) => catmull(before[k], point[k], outline[i + 1][k], after[k], 0.5)), ring: -1});
  });
  return points;
}

function catmull(a, b, c, d, t) {
  const m = (c - a) / 2;
  const n = (d - b) / 2;
  return (2 * b - 2 * c + m + n) * t ** 3 + (-3 * b + 3 * c - 2 * m - n) * t ** 2 + m * t + b;
}

/** Triangles (9 numbers each) of a body of revolution; felt below, wood above. */
function turned(kind) {
  const {outline, carving, felt} = kind;
  const rings = refined(outline, carving ? Math.min(...carving.rings) : outline.length);
  const around = carving ? carving.teeth * PER_TOOTH[carving.square ? 'square' : 'wave'] : SEGMENTS;
  const lift = (ring, segment) => {
    if (!carving || !carving.rings.includes(ring)) return 0;
    const share = around / carving.teeth;
    if (carving.square) return segment % share < 0.4 * share ? carving.height : 0;
    return carving.height * Math.cos((2 * Math.PI * segment) / share);
  };
  const at = ({point: [r, h], ring}, segment) => {
    const angle = (2 * Math.PI * segment) / around;
    return [r * Math.cos(angle), r * Math.sin(angle), h + lift(ring, segment % around)];
  };
  const soft = [];
  const wood = [];
  for (let i = 0; i + 1 < rings.length; i++) {
    const [low, high] = [rings[i], rings[i + 1]];
    const target = high.ring >= 0 && high.ring <= felt ? soft : wood;
    for (let s = 0; s < around; s++) {
      const [a, b, c, d] = [at(low, s), at(low, s + 1), at(high, s + 1), at(high, s)];
      if (low.point[0] > 0) target.push(...a, ...b, ...c);
      if (high.point[0] > 0) target.push(...a, ...c, ...d);
    }
  }
  return {soft, wood};
}

/** The knight's head: its outline rounded, as thick as it is, with rounded edges. */
function head({outline, half}) {
  const around = new SplineCurve([...outline, outline[0]].map(([y, z]) => new Vector2(y, z)))
    .getPoints(72)
    .slice(0, -1);
  const bevel = 0.5 * half;
  const solid = new ExtrudeGeometry(new Shape(around), {
    depth: 2 * (half - bevel),
    bevelEnabled: true,
    bevelThickness: bevel,
    bevelSize: 0.55 * bevel,
    bevelOffset: -0.4 * bevel,
    bevelSegments: 4,
    steps: 1,
  });
  const flat = solid.index ? solid.toNonIndexed() : solid;
  const triangles = [];
  const p = flat.attributes.position;
  // the outline lies in the plane of y and z, its thickness along x
  for (let i = 0; i < p.count; i++) triangles.push(p.getZ(i) - (half - bevel), p.getX(i), p.getY(i));
  return triangles;
}

function block({size, height}) {
  const flat = new BoxGeometry(...size).translate(0, 0, height).toNonIndexed();
  return [...flat.attributes.position.array];
}

/** Normals of triangles: smooth, but for edges. */
function normals(triangles) {
  const faces = triangles.length / 9;
  const normal = new Float32Array(faces * 3);
  const around = new Map();
  const area = new Float32Array(faces);
  for (let f = 0; f < faces; f++) {
    const o = f * 9;
    const [ux, uy, uz] = [0, 1, 2].map((k) => triangles[o + 3 + k] - triangles[o + k]);
    const [vx, vy, vz] = [0, 1, 2].map((k) => triangles[o + 6 + k] - triangles[o + k]);
    const n = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    area[f] = Math.hypot(...n) || 1e-20;
    n.forEach((value, k) => (normal[3 * f + k] = value / area[f]));
    for (let c = 0; c < 3; c++) {
      const k = corner(triangles, o + 3 * c);
      if (!around.has(k)) around.set(k, []);
      around.get(k).push(f);
    }
  }
  const smooth = new Float32Array(triangles.length);
  for (let f = 0; f < faces; f++) {
    for (let c = 0; c < 3; c++) {
      const o = f * 9 + 3 * c;
      const sum = [0, 0, 0];
      for (const g of around.get(corner(triangles, o))) {
        const along =
          normal[3 * f] * normal[3 * g] + normal[3 * f + 1] * normal[3 * g + 1] + normal[3 * f + 2] * normal[3 * g + 2];
        if (along >= CREASE) for (let k = 0; k < 3; k++) sum[k] += area[g] * normal[3 * g + k];
      }
      const length = Math.hypot(...sum) || 1;
      for (let k = 0; k < 3; k++) smooth[o + k] = sum[k] / length;
    }
  }
  return smooth;
}

/** The shape of one kind of piece, and how many of its corners are felt: what both colours share. */
export function pieceShape(kind) {
  const body = turned(kind);
  const carved = [...(kind.head ? head(kind.head) : []), ...(kind.blocks ?? []).flatMap(block)];
  const shape = {position: [], normal: [], index: [], felt: 0};
  for (const triangles of [body.soft, body.wood, carved]) {
    addCorners(shape, triangles, normals(triangles));
    if (triangles === body.soft) shape.felt = shape.position.length / 3;
  }
  const numbers = (list) => new BufferAttribute(new Float32Array(list), 3);
  return {...shape, position: numbers(shape.position), normal: numbers(shape.normal)};
}

/** Adds triangles to a shape; corners that are the same in place and normal become one. */
function addCorners({position, normal, index}, triangles, smooth) {
  const known = new Map();
  for (let i = 0; i < triangles.length; i += 3) {
    const key = corner(triangles, i);
    if (!known.has(key)) known.set(key, []);
    const same = known
      .get(key)
      .find((at) => [0, 1, 2].every((k) => Math.abs(normal[3 * at + k] - smooth[i + k]) < 0.02));
    if (same !== undefined) {
      index.push(same);
      continue;
    }
    const added = position.length / 3;
    known.get(key).push(added);
    index.push(added);
    for (let k = 0; k < 3; k += 1) {
      position.push(triangles[i + k]);
      normal.push(smooth[i + k]);
    }
  }
}

/** A corner's place in micrometres as one whole number: far below 2^53, and quicker than a text. */
function corner(triangles, i) {
  let key = 0;
  for (let k = 0; k < 3; k += 1) key = key * 262144 + Math.round(triangles[i + k] * 1e6) + 131072;
  return key;
}

/** A piece's geometry in its colours (linear, three numbers each), which stand at the corners: it is drawn at once. */
export function pieceGeometry({position, normal, index, felt: below}, wood, felt) {
  const colour = new Float32Array(position.array.length);
  for (let i = 0; i < colour.length; i += 1) colour[i] = (i < 3 * below ? felt : wood)[i % 3];
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', position);
  geometry.setAttribute('normal', normal);
  geometry.setAttribute('color', new BufferAttribute(colour, 3));
  geometry.setIndex(index);
  geometry.computeBoundingSphere();
  return geometry;
}
