// The pieces: where the game believes them to be, and the one in the fingers below the tool. Board frame, z up [m].

import {Group, Mesh} from '../vendor/three/three.module.js';
import {FELT, WOOD} from './materials.js';
import {pieceGeometry, pieceShape} from './shapes.js';

const LYING = 0.012; // [m] how high the middle of a piece lies that lies

/** All pieces of a game, in a group that has the board's frame. */
export class Pieces {
  constructor(description, material) {
    this.kinds = description.kinds;
    this.boxes = description.table.boxes;
    this.material = material;
    this.group = new Group();
    this.meshes = new Map(); // by the piece's name
    this.shapes = new Map(); // by kind
    this.geometries = new Map(); // by kind and colour
    this.held = null;
  }

  /** Puts every piece where it is believed to be; `held` is the name of the one in the fingers, or null. */
  place(pieces, held) {
    const gone = new Set(this.meshes.keys());
    for (const piece of pieces) {
      const mesh = this.meshes.get(piece.name) ?? this.#make(piece);
      gone.delete(piece.name);
      mesh.visible = piece.at !== null || piece.name === held; // some are not on the table
      if (piece.name === held || piece.at === null) continue;
      const [x, y] = piece.at;
      const boxed = this.boxes.some(({at, half}) => Math.abs(x - at[0]) <= half[0] && Math.abs(y - at[1]) <= half[1]);
      // what was dropped into a box lies there, nobody knows how; knights look at each other
      const facing = piece.kind === 'knight' && piece.colour === 'black' ? Math.PI : 0;
      mesh.rotation.set(boxed ? Math.PI / 2 : 0, 0, facing);
      mesh.position.set(x, y, boxed ? LYING : 0);
    }
    for (const name of gone) {
      this.group.remove(this.meshes.get(name));
      this.meshes.delete(name);
    }
    this.held = this.meshes.has(held) ? held : null;
  }

  /** Moves the held piece with the tool, which is at a point of the board's frame. */
  carry([x, y, z]) {
    if (this.held === null) return;
    const mesh = this.meshes.get(this.held);
    mesh.rotation.set(0, 0, mesh.rotation.z);
    mesh.position.set(x, y, z - this.kinds[mesh.userData.kind].grip);
  }

  #make({name, kind, colour}) {
    const key = `${kind} ${colour}`;
    if (!this.shapes.has(kind)) this.shapes.set(kind, pieceShape(this.kinds[kind]));
    if (!this.geometries.has(key)) {
      this.geometries.set(key, pieceGeometry(this.shapes.get(kind), WOOD[colour], FELT));
    }
    const mesh = new Mesh(this.geometries.get(key), this.material);
    mesh.castShadow = mesh.receiveShadow = true;
    mesh.userData = {kind, colour};
    this.meshes.set(name, mesh);
    this.group.add(mesh);
    return mesh;
  }

  dispose() {
    for (const shape of this.geometries.values()) shape.dispose();
  }
}
