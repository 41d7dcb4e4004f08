// The reference's path, pale where the arm has been, and the force on the tool as an arrow. Base frame [m].

import {
  BufferGeometry,
  CatmullRomCurve3,
  ConeGeometry,
  CylinderGeometry,
  Group,
  Mesh,
  MeshBasicMaterial,
  MeshPhongMaterial,
  TubeGeometry,
  Vector3,
} from '../vendor/three/three.module.js';

const RADIUS = 0.0022; // of the line [m]
const CORNERS = 6;
const PER_NEWTON = 0.012; // length of the arrow [m/N]
const LEAST = 0.4; // [N] less is not shown
const MOST = 0.2; // [m] the arrow is no longer
const COLOURS = {path: '#19a0b8', force: '#e2502d'};

/** The path of the motion under way. */
export class Path {
  constructor() {
    this.group = new Group();
    this.ahead = new MeshBasicMaterial({color: COLOURS.path, transparent: true, opacity: 0.95});
    this.behind = new MeshBasicMaterial({color: COLOURS.path, transparent: true, opacity: 0.18, depthWrite: false});
    this.mesh = new Mesh(new BufferGeometry(), [this.behind, this.ahead]);
    this.mesh.visible = false;
    this.group.add(this.mesh);
    this.parts = 0;
    this.motion = null;
  }

  /** Another path, or none: the section `path` of the page's state. */
  show(path) {
    const points = distinct(path?.points ?? []);
    this.mesh.visible = points.length > 1;
    this.motion = path?.motion ?? null;
    this.mesh.geometry.dispose();
    if (!this.mesh.visible) return;
    this.length = (path.points.length - 1) * path.stride;
    this.parts = Math.min(160, 3 * points.length);
    const curve = new CatmullRomCurve3(
      points.map((point) => new Vector3(...point)),
      false,
      'centripetal',
    );
    curve.arcLengthDivisions = 4 * this.parts;
    this.mesh.geometry = new TubeGeometry(curve, this.parts, RADIUS, CORNERS, false);
    this.along = shares(path.points);
    this.faded = -1;
    this.execute(0);
  }

  /** So many samples of it have been executed. */
  execute(samples) {
    if (!this.mesh.visible) return;
    const at = Math.min(1, Math.max(0, samples / this.length)) * (this.along.length - 1);
    const i = Math.min(this.along.length - 2, Math.floor(at));
    const share = this.along[i] + (at - i) * (this.along[i + 1] - this.along[i]);
    const faded = Math.round(share * this.parts);
    if (faded === this.faded) return;
    this.faded = faded;
    const per = CORNERS * 6;
    this.mesh.geometry.clearGroups();
    this.mesh.geometry.addGroup(0, faded * per, 0);
    this.mesh.geometry.addGroup(faded * per, (this.parts - faded) * per, 1);
  }
}

/** Points of which none repeats the one before it: a curve must not stand still. */
function distinct(points) {
  return points.filter(
    (point, i) => i === 0 || Math.hypot(...point.map((value, k) => value - points[i - 1][k])) > 1e-4,
  );
}

/** How much of the path's length lies behind each of its points, 0 to 1. */
function shares(points) {
  const sums = [0];
  for (let i = 1; i < points.length; i++) {
    sums.push(sums[i - 1] + Math.hypot(...points[i].map((value, k) => value - points[i - 1][k])));
  }
  return sums.map((sum) => sum / (sums[sums.length - 1] || 1));
}

/** The force on the tool. */
export class ForceArrow {
  constructor() {
    const material = new MeshPhongMaterial({color: COLOURS.force});
    this.shaft = new Mesh(new CylinderGeometry(0.003, 0.003, 1, 12), material);
    this.tip = new Mesh(new ConeGeometry(0.008, 0.02, 16), material);
    this.group = new Group();
    this.group.add(this.shaft, this.tip);
    this.group.visible = false;
    this.wanted = true;
  }

  /** A force at the tool, both in the base frame [N, m]. */
  show(tool, force) {
    const strength = Math.hypot(...force);
    this.group.visible = this.wanted && strength >= LEAST;
    if (!this.group.visible) return;
    const length = Math.min(MOST, 0.02 + PER_NEWTON * strength);
    this.shaft.scale.y = length - 0.02;
    this.shaft.position.y = (length - 0.02) / 2;
    this.tip.position.y = length - 0.01;
    this.group.position.set(...tool);
    this.group.quaternion.setFromUnitVectors(new Vector3(0, 1, 0), new Vector3(...force).divideScalar(strength));
  }
}
