// What surfaces look like, and the light they stand in.

import {
  CanvasTexture,
  Color,
  CubeTexture,
  MeshPhongMaterial,
  MixOperation,
  SRGBColorSpace,
} from '../vendor/three/three.module.js';

/** Lacquered wood, as linear colours at the corners of the pieces. */
export const WOOD = {white: new Color('#e3c496').toArray(), black: new Color('#3a2419').toArray()};
export const FELT = new Color('#1c3d27').toArray();

// colour; share of the room that is reflected; highlight and how sharp it is
const FINISHES = {
  metal: ['#59606a', 0.16, '#555555', 40],
  aluminium: ['#b9c0c8', 0.34, '#777777', 60],
  carbon: ['#1d1f23', 0.1, '#666666', 50],
  plastic: ['#25282d', 0.03, '#333333', 20],
  pad: ['#f0f0ea', 0, '#222222', 10],
  joint: ['#8b9198', 0.42, '#999999', 80],
  place: ['#6b472e', 0, '#000000', 1],
  rim: ['#553722', 0.03, '#222222', 20],
  box: ['#85613f', 0, '#222222', 10],
  lining: ['#33455c', 0, '#000000', 1],
};

/**
 * One material for each finish, shared by all that has it; and `piece`, whose colours stand at the corners. Phong's model
 * with a room of six small pictures: physically based materials would filter that room first, which takes a computer
 * without a graphics card half a minute.
 */
export function makeMaterials() {
  const room = roomTexture(64);
  const make = (reflectivity, rest) =>
    new MeshPhongMaterial({...rest, ...(reflectivity > 0 ? {envMap: room, combine: MixOperation, reflectivity} : {})});
  const materials = {};
  for (const [name, [color, reflectivity, specular, shininess]] of Object.entries(FINISHES)) {
    materials[name] = make(reflectivity, {color, specular, shininess});
  }
  materials.piece = make(0.045, {vertexColors: true, specular: '#5a5a5a', shininess: 55});
  return materials;
}

/** A room with a bright ceiling and two windows, for reflections: six pictures. */
function roomTexture(size) {
  const face = (paint) => {
    const canvas = document.createElement('canvas');
    canvas.width = canvas.height = size;
    paint(canvas.getContext('2d'));
    return canvas;
  };
  const wall = (window) =>
    face((pen) => {
      const fade = pen.createLinearGradient(0, 0, 0, size);
      fade.addColorStop(0, '#dfe4e9');
      fade.addColorStop(0.5, '#8b939b');
      fade.addColorStop(1, '#34383d');
      pen.fillStyle = fade;
      pen.fillRect(0, 0, size, size);
      if (!window) return;
      pen.fillStyle = '#ffffff';
      pen.fillRect(0.28 * size, 0.14 * size, 0.44 * size, 0.3 * size);
    });
  const flat = (colour, lamp) =>
    face((pen) => {
      pen.fillStyle = colour;
      pen.fillRect(0, 0, size, size);
      pen.fillStyle = lamp;
      pen.fillRect(0.2 * size, 0.3 * size, 0.6 * size, 0.4 * size);
    });
  const faces = [
    wall(true),
    wall(true),
    flat('#dfe4e9', '#ffffff'),
    flat('#34383d', '#34383d'),
    wall(false),
    wall(true),
  ];
  const texture = new CubeTexture(faces);
  texture.colorSpace = SRGBColorSpace;
  texture.needsUpdate = true;
  return texture;
}

/** A sequence that is the same in every browser: the grain of the wood. */
function sequence(seed) {
  let state = seed;
  return () => {
    state = (state * 1664525 + 1013904223) >>> 0;
    return state / 4294967296;
  };
}

/** The board from above with grain, a1 at the lower left; its side is eight squares. */
export function boardTexture(size) {
  const canvas = document.createElement('canvas');
  canvas.width = canvas.height = size;
  const pen = canvas.getContext('2d');
  const side = size / 8;
  const random = sequence(7);
  for (let rank = 0; rank < 8; rank++) {
    for (let file = 0; file < 8; file++) {
      const light = (rank + file) % 2 === 1;
      const [x, y] = [file * side, size - (rank + 1) * side];
      const shade = 0.94 + 0.12 * random();
      const [r, g, b] = (light ? [226, 198, 152] : [132, 82, 48]).map((value) => Math.round(value * shade));
      pen.fillStyle = `rgb(${r} ${g} ${b})`;
      pen.fillRect(x, y, side, side);
      pen.save();
      pen.beginPath();
      pen.rect(x, y, side, side);
      pen.clip();
      for (let line = 0; line < 26; line++) {
        const start = y + side * random();
        const bend = side * 0.14 * (random() - 0.5);
        pen.strokeStyle = `rgb(${light ? '120 80 40' : '40 18 6'} / ${0.05 + 0.12 * random()})`;
        pen.lineWidth = 0.5 + (1.6 * random() * size) / 1024;
        pen.beginPath();
        pen.moveTo(x, start);
        pen.quadraticCurveTo(x + side / 2, start + bend, x + side, start + bend * random());
        pen.stroke();
      }
      pen.restore();
    }
  }
  return asTexture(canvas);
}

/** Letters and numbers around the board: a sheet as large as the rim, without a background. */
export function coordinateTexture(half, square, size) {
  const canvas = document.createElement('canvas');
  const scale = size / Math.max(half[0], half[1]) / 2;
  canvas.width = Math.round(2 * half[0] * scale);
  canvas.height = Math.round(2 * half[1] * scale);
  const pen = canvas.getContext('2d');
  pen.fillStyle = 'rgb(226 198 152 / 0.85)';
  pen.font = `600 ${Math.round(0.0105 * scale)}px system-ui, sans-serif`;
  pen.textAlign = 'center';
  pen.textBaseline = 'middle';
  const write = (text, x, y) => pen.fillText(text, (x + half[0]) * scale, (half[1] - y) * scale);
  const beyond = 4 * square + 0.0085;
  for (let i = 0; i < 8; i++) {
    const along = (i - 3.5) * square;
    for (const side of [-1, 1]) {
      write('abcdefgh'[i], along, side * beyond);
      write(String(i + 1), side * beyond, along);
    }
  }
  return asTexture(canvas);
}

/** White in the middle, nothing at the rim: what a round floor fades out with. */
export function fadeTexture(size, inner) {
  const canvas = document.createElement('canvas');
  canvas.width = canvas.height = size;
  const pen = canvas.getContext('2d');
  const fade = pen.createRadialGradient(size / 2, size / 2, (inner * size) / 2, size / 2, size / 2, size / 2);
  fade.addColorStop(0, '#ffffff');
  fade.addColorStop(1, '#000000');
  pen.fillStyle = fade;
  pen.fillRect(0, 0, size, size);
  return new CanvasTexture(canvas);
}

function asTexture(canvas) {
  const texture = new CanvasTexture(canvas);
  texture.colorSpace = SRGBColorSpace;
  texture.anisotropy = 4;
  return texture;
}
