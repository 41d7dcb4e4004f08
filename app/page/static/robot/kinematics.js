// Where the arm's joints lie for three servomotor angles and a tool point: base frame, z₃ down, arm 1 along +y [m].
// The links are rigid, so angles and tool are all that has to be told twenty times a second.

const TURN = [0, (-2 * Math.PI) / 3, (2 * Math.PI) / 3]; // of each arm about z₃

/** A point in the frame of an arm, in the base frame. */
export function turned(arm, [x, y, z]) {
  const [cos, sin] = [Math.cos(TURN[arm]), Math.sin(TURN[arm])];
  return [cos * x - sin * y, sin * x + cos * y, z];
}

/** Shoulder, elbow, wrist and the axis of its servomotor, for each of the three arms. */
export function joints(geometry, angles, tool) {
  return angles.map((angle, arm) => {
    const {base_radius: radius, proximal_length: length, flange_radius: flange, gripper_height: height} = geometry;
    const wrist = turned(arm, [0, flange, -height]);
    return {
      shoulder: turned(arm, [0, radius, 0]),
      elbow: turned(arm, [0, radius + length * Math.cos(angle), length * Math.sin(angle)]),
      wrist: wrist.map((value, k) => value + tool[k]),
      axis: turned(arm, [1, 0, 0]),
    };
  });
}
