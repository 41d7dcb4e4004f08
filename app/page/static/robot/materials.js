// What surfaces look like, and the light they stand in.

import {
  BackSide,
  CanvasTexture,
  Color,
  Mesh,
  MeshBasicMaterial,
  MeshStandardMaterial,
  PMREMGenerator,
  PlaneGeometry,
  Scene,
  SphereGeometry,
  SRGBColorSpace,
} from '../vendor/three/three.module.js';

/** Lacquered wood, as linear colours at the corners of the pieces. */
export const WOOD = {white: new Color('#e3c496').toArray(), black: new Color('#3a2419').toArray()};
export const FELT = new Color('#1c3d27').toArray();

const FINISHES = {
  metal: {color: '#5b626b', metalness: 0.35, roughness: 0.45},
  aluminium: {color: '#c6ccd3', metalness: 0.6, roughness: 0.32},
  carbon: {color: '#1b1d20', metalness: 0.25, roughness: 0.38},
  plastic: {color: '#25282d', metalness: 0.0, roughness: 0.55},
  pad: {color: '#f0f0ea', metalness: 0.0, roughness: 0.6},
  joint: {color: '#8b9198', metalness: 0.7, roughness: 0.28},
  place: {color: '#5a3a24', metalness: 0.0, roughness: 0.8},
  rim: {color: '#4a2f1c', metalness: 0.0, roughness: 0.5},
  box: {color: '#85613f', metalness: 0.0, roughness: 0.6},
  lining: {color: '#33455c', metalness: 0.0, roughness: 0.95},
};

/** One material for each finish, shared by all that has it; and `piece`, whose colours stand at the corners. */
export function makeMaterials() {
  const materials = {};
  for (const [name, look] of Object.entries(FINISHES)) materials[name] = new MeshStandardMaterial(look);
  materials.piece = new MeshStandardMaterial({vertexColors: true, roughness: 0.36, metalness: 0});
  return materials;
}

/** A room with a bright ceiling and two windows, for reflections; made once, a few pixels large. */
export function roomLight(renderer) {
  const room = new Scene();
  room.add(new Mesh(new SphereGeometry(5, 16, 12), new MeshBasicMaterial({color: '#8f969e', side: BackSide})));
  const panel = (width, height, brightness, [x, y, z]) => {
    const colour = new Color(brightness, brightness, brightness);
    const mesh = new Mesh(new PlaneGeometry(width, height), new MeshBasicMaterial({color: colour}));
    mesh.position.set(x, y, z);
    mesh.lookAt(0, 0, 0);
    room.add(mesh);
  };
  panel(4, 4, 7, [0, 4, 0]);
  panel(2, 2.5, 5, [-4, 1.2, 2]);
  panel(2, 2.5, 3, [4, 1.0, 1]);
  panel(8, 8, 0.12, [0, -3.5, 0]);
  const generator = new PMREMGenerator(renderer);
  const light = generator.fromScene(room, 0.05).texture;
  generator.dispose();
  room.traverse((one) => {
    one.geometry?.dispose();
    one.material?.dispose();
  });
  return light;
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
