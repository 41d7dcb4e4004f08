// The arm: what stands still, three legs, flange with gripper, two fingers. Everything in the base frame [m].

import {
  BoxGeometry,
  CylinderGeometry,
  Group,
  Mesh,
  Quaternion,
  SphereGeometry,
  Vector3,
} from '../vendor/three/three.module.js';
import {joints} from './kinematics.js';

const UP = new Vector3(0, 1, 0); // a cylinder of three lies along y
const AROUND = 28; // corners of a round bar

/** The robot that robot.json describes; `pose(angles, tool, finger)` moves it. */
export class Arm {
  constructor(description, materials) {
    this.geometry = description.geometry;
    this.group = new Group();
    this.tool = new Group();
    this.fingers = {right: new Group(), left: new Group()};
    this.legs = [0, 1, 2].map(() => this.#leg(description.links, materials));
    // what hangs above the board has a look of its own, since it is seen through from above
    this.above = materials.metal.clone();
    this.above.transparent = true;
    for (const solid of description.base) this.group.add(solidMesh(solid, {[solid.finish]: this.above}));
    for (const solid of description.tool) this.tool.add(solidMesh(solid, materials));
    for (const [side, finger] of Object.entries(this.fingers)) {
      for (const solid of description.fingers[side]) finger.add(solidMesh(solid, materials));
      this.tool.add(finger);
    }
    this.group.add(this.tool);
    this.group.traverse((one) => {
      if (one.isMesh) one.castShadow = one.receiveShadow = true;
    });
    this.at = [0, 0, 0];
  }

  #leg(links, materials) {
    const rod = links.rod.radius;
    const bar = (radius, finish) => {
      const mesh = new Mesh(new CylinderGeometry(radius, radius, 1, AROUND), materials[finish]);
      this.group.add(mesh);
      return mesh;
    };
    const ball = (radius) => {
      const mesh = new Mesh(new SphereGeometry(radius, 20, 14), materials.joint);
      this.group.add(mesh);
      return mesh;
    };
    return {
      aside: links.rod.aside,
      proximal: bar(links.proximal.radius, links.proximal.finish),
      elbowAxle: bar(links.axle.radius, links.axle.finish),
      wristAxle: bar(links.axle.radius, links.axle.finish),
      rods: [bar(rod, links.rod.finish), bar(rod, links.rod.finish)],
      balls: [0, 1, 2, 3].map(() => ball(1.45 * rod)),
      elbow: ball(1.15 * links.proximal.radius),
    };
  }

  /** Lets a camera that looks down from above see the board through the base. */
  seeThrough(camera) {
    const {x, y, z} = camera.position;
    const aside = Math.atan2(Math.hypot(x, z), y); // from straight above [rad]
    this.above.opacity = Math.min(1, Math.max(0.12, (aside - 0.35) / 0.35));
    this.above.depthWrite = this.above.opacity === 1;
  }

  /** Moves all parts: servomotor angles [rad], tool point [m], a pad's front edge from the tool point [m]. */
  pose(angles, tool, finger) {
    joints(this.geometry, angles, tool).forEach(({shoulder, elbow, wrist, axis}, arm) => {
      const leg = this.legs[arm];
      const beside = (point, side) => point.map((value, k) => value + side * leg.aside * axis[k]);
      span(leg.proximal, shoulder, elbow);
      span(leg.elbowAxle, beside(elbow, -1), beside(elbow, 1));
      span(leg.wristAxle, beside(wrist, -1), beside(wrist, 1));
      leg.elbow.position.set(...elbow);
      [-1, 1].forEach((side, i) => {
        span(leg.rods[i], beside(elbow, side), beside(wrist, side));
        leg.balls[2 * i].position.set(...beside(elbow, side));
        leg.balls[2 * i + 1].position.set(...beside(wrist, side));
      });
    });
    this.tool.position.set(...tool);
    this.fingers.right.position.x = finger;
    this.fingers.left.position.x = -finger;
    this.at = [...tool];
  }
}

const from = new Vector3();
const along = new Vector3();
const turn = new Quaternion();

/** Lays a cylinder of length 1 from a point to another. */
function span(mesh, start, end) {
  from.set(...start);
  along.set(...end).sub(from);
  const length = along.length();
  mesh.position.copy(from).addScaledVector(along, 0.5);
  mesh.scale.set(1, length, 1);
  mesh.quaternion.copy(turn.setFromUnitVectors(UP, along.divideScalar(length || 1)));
}

/** A round bar or a block of robot.json. */
export function solidMesh(solid, materials) {
  if (solid.centre) {
    const mesh = new Mesh(new BoxGeometry(...solid.size), materials[solid.finish]);
    mesh.position.set(...solid.centre);
    return mesh;
  }
  const [low, high] = solid.radii;
  const corners = Math.max(low, high) > 0.05 ? 64 : AROUND;
  const mesh = new Mesh(new CylinderGeometry(high, low, 1, corners), materials[solid.finish]);
  span(mesh, solid.start, solid.end);
  return mesh;
}
