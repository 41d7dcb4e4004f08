"""The arm in a pose: where its joints lie for three servomotor angles, and the solids it is drawn with.

Base frame: z₃ down, arm 1 along +y. Lengths come from the robot's parameters, points from the controller's kinematics.
How thick the links are is measured on the robot, and stated here once: who masks the arm in a picture uses the same.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, cast

import numpy as np

from app.scene.solids import Cuboid, Finish, RoundBar, Solid
from controller.model.constants import DeltaModel
from controller.model.reach import tool_point_at
from controller.model.vectors import combine, turn
from hardware.interfaces import Triple
from hardware.parameters import RobotParameters

ARMS: Final = 3

PROXIMAL_RADIUS: Final = 0.013
SERVO_RADIUS: Final = 0.030
SERVO_HALF_LENGTH: Final = 0.046
"""Of a servomotor along its axis, from the middle of the proximal link [m]."""
ROD_RADIUS: Final = 0.006
ROD_HALF_DISTANCE: Final = 0.024
"""Between the two rods of a pair, each from their middle [m]."""
FLANGE_THICKNESS: Final = 0.008
"""Half of it, with the joints on it [m]."""
BODY_HALF_LENGTH: Final = 0.040
BODY_RADIUS: Final = 0.021
"""Of a round bar that the gripper's body lies in [m]."""
BODY_HEIGHT: Final = 0.0635
"""Of the body's middle above the tool point [m]."""
FINGER_RADIUS: Final = 0.010


@dataclass(frozen=True, slots=True)
class ArmJoints:
    """Where the joints lie in a pose; base frame, arm by arm."""

    tool: Triple
    """The tool point, between the pads [m]."""
    shoulders: tuple[Triple, Triple, Triple]
    """On each servomotor's axis, in the plane that its arm moves in [m]."""
    elbows: tuple[Triple, Triple, Triple]
    """At the end of each proximal link, in the middle between the ends of its two rods [m]."""
    wrists: tuple[Triple, Triple, Triple]
    """At the flange, likewise [m]."""
    axes: tuple[Triple, Triple, Triple]
    """Unit vectors along the servomotors' axes; the rods of a pair lie ``ROD_HALF_DISTANCE`` along it from their
    middle, on either side, and so do their ends."""


def arm_joints(model: DeltaModel, angle: Triple) -> ArmJoints:
    """The joints of an arm at three servomotor angles [rad].

    Raises:
        PoseError: no tool point belongs to these angles.
    """
    x, y, z = tool_point_at(model, np.array(angle)).tolist()
    return joints_with_tool(model.parameters, angle, (x, y, z))


def joints_with_tool(parameters: RobotParameters, angle: Triple, tool: Triple) -> ArmJoints:
    """The joints at three servomotor angles [rad] whose tool point is known [m]."""
    g = parameters.geometry
    shoulders, elbows, wrists, axes = [], [], [], []
    for arm, servo in enumerate(angle):
        along, down = g.proximal_length * math.cos(servo), g.proximal_length * math.sin(servo)
        shoulders.append(turn(arm, (0.0, g.base_radius, 0.0)))
        elbows.append(turn(arm, (0.0, g.base_radius + along, down)))
        wrists.append(combine(tool, 1.0, turn(arm, (0.0, g.flange_radius, -g.gripper_height))))
        axes.append(turn(arm, (1.0, 0.0, 0.0)))
    return ArmJoints(tool, _three(shoulders), _three(elbows), _three(wrists), _three(axes))


def base_solids(parameters: RobotParameters) -> tuple[RoundBar, ...]:
    """What does not move, base frame: the plate and the three servomotors."""
    radius = parameters.geometry.base_radius
    plate = RoundBar((0.0, 0.0, -SERVO_RADIUS), (0.0, 0.0, -0.5 * SERVO_RADIUS), radius, Finish.METAL)
    return (plate, *servo_solids(parameters))


def servo_solids(parameters: RobotParameters) -> tuple[RoundBar, ...]:
    """The three servomotors, base frame."""
    radius, servos = parameters.geometry.base_radius, []
    for arm in range(ARMS):
        shoulder, axis = turn(arm, (0.0, radius, 0.0)), turn(arm, (1.0, 0.0, 0.0))
        ends = combine(shoulder, -SERVO_HALF_LENGTH, axis), combine(shoulder, SERVO_HALF_LENGTH, axis)
        servos.append(RoundBar(*ends, SERVO_RADIUS, Finish.METAL))
    return tuple(servos)


def leg_solids(joints: ArmJoints) -> tuple[RoundBar, ...]:
    """The links of all arms, base frame: of each its proximal link, the bars at elbow and wrist, and its two rods."""
    bars = []
    for arm in range(ARMS):
        elbow, wrist, axis = joints.elbows[arm], joints.wrists[arm], joints.axes[arm]
        one, other = (combine(elbow, side, axis) for side in (-ROD_HALF_DISTANCE, ROD_HALF_DISTANCE))
        one_end, other_end = (combine(wrist, side, axis) for side in (-ROD_HALF_DISTANCE, ROD_HALF_DISTANCE))
        bars += [
            RoundBar(joints.shoulders[arm], elbow, PROXIMAL_RADIUS, Finish.ALUMINIUM),
            RoundBar(one, other, ROD_RADIUS, Finish.METAL),
            RoundBar(one_end, other_end, ROD_RADIUS, Finish.METAL),
            RoundBar(one, one_end, ROD_RADIUS, Finish.CARBON),
            RoundBar(other, other_end, ROD_RADIUS, Finish.CARBON),
        ]
    return tuple(bars)


def tool_solids(parameters: RobotParameters) -> tuple[Solid, ...]:
    """Flange and gripper's body: along the base's axes, as the flange never turns, seen from the tool point [m]."""
    g = parameters.geometry
    flange = RoundBar(
        (0.0, 0.0, -g.gripper_height - FLANGE_THICKNESS), (0.0, 0.0, -g.gripper_height + FLANGE_THICKNESS),
        g.flange_radius, Finish.ALUMINIUM,
    )  # fmt: skip
    thickness = math.sqrt(2.0) * BODY_RADIUS  # the square bar within the round one
    body = Cuboid((0.0, 0.0, -BODY_HEIGHT), (2.0 * BODY_HALF_LENGTH, thickness, thickness), Finish.PLASTIC)
    return flange, body


def finger_solids(parameters: RobotParameters, side: int) -> tuple[Solid, ...]:
    """One finger with its pad, from the middle of the pad's front edge: to the right (side 1) or left (-1) of the tool.

    That point lies ``side`` times the finger's position along x from the tool point; axes of the base frame [m].
    """
    pads = parameters.pads
    depth = pads.half_width * math.tan(pads.groove_angle)
    thickness = depth + pads.back
    size = (thickness, 2.0 * pads.half_width, 2.0 * pads.half_height)
    pad = Cuboid((side * 0.5 * thickness, 0.0, 0.0), size, Finish.PAD)
    bar = RoundBar(
        (side * (depth + 0.5 * pads.back), 0.0, -BODY_HEIGHT), (side * (depth + 0.5 * pads.back), 0.0, 0.0),
        0.5 * FINGER_RADIUS, Finish.METAL,
    )  # fmt: skip
    return bar, pad


def moved(solid: Solid, by: Triple) -> Solid:
    """The same solid elsewhere [m]."""
    if isinstance(solid, Cuboid):
        return Cuboid(combine(solid.centre, 1.0, by), solid.size, solid.finish)
    start, end = combine(solid.start, 1.0, by), combine(solid.end, 1.0, by)
    return RoundBar(start, end, solid.radius, solid.finish, solid.end_radius)


def _three(points: list[Triple]) -> tuple[Triple, Triple, Triple]:
    return cast("tuple[Triple, Triple, Triple]", tuple(points))
