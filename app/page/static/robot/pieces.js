// The pieces: where the game believes them to be, and the one in the fingers below the tool. Board frame, z up [m].

import {Group, Mesh} from '../vendor/three/three.module.js';
import {FELT, WOOD} from './materials.js';
import {pieceGeometry} from './shapes.js';

/** All pieces of a game, in a group that has the board's frame. */
export class Pieces {
  constructor(description, material) {
    this.kinds = description.kinds;
    this.places = description.table.places;
    this.material = material;
    this.group = new Group();
    this.meshes = new Map(); // by the piece's name
    this.shapes = new Map(); // geometries by kind and colour
    this.held = null;
  }

  /** Puts every piece where it is believed to be; `held` is the name of the one in the fingers, or null. */
  place(pieces, held) {
    const gone = new Set(this.meshes.keys());
    for (const piece of pieces) {
      const mesh = this.meshes.get(piece.name) ?? this.#make(piece);
      gone.delete(piece.name);
      const [x, y] = piece.at ?? this.places[piece.place];
      const boxed = piece.place.startsWith('B');
      if (piece.name !== held) {
        // what was dropped into a box lies there, nobody knows how
        mesh.rotation.set(
          boxed ? Math.PI / 2 : 0,
          0,
          piece.kind === 'knight' && piece.colour === 'black' ? Math.PI : 0,
        );
        mesh.position.set(x, y, boxed ? 0.012 : 0);
      }
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
    if (!this.shapes.has(key)) this.shapes.set(key, pieceGeometry(this.kinds[kind], WOOD[colour], FELT));
    const mesh = new Mesh(this.shapes.get(key), this.material);
    mesh.castShadow = mesh.receiveShadow = true;
    mesh.userData = {kind, colour};
    this.meshes.set(name, mesh);
    this.group.add(mesh);
    return mesh;
  }

  dispose() {
    for (const shape of this.shapes.values()) shape.dispose();
  }
}
