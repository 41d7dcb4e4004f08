"""The robot as frames that move and solids that rest in them: what a viewer with a tree of transforms needs.

``board`` is the root, z up; ``base`` hangs in it, z down. In ``base`` move ``tool``, ``reference``, and of each arm its
proximal link and its two rods; in ``tool`` the fingers. ``camera`` hangs in ``board`` where it is known how: x right, y
down, z along its view. A frame of a link has its z axis along the link.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from app.scene.arm import (
    ARMS,
    PROXIMAL_RADIUS,
    ROD_HALF_DISTANCE,
    ROD_RADIUS,
    ArmJoints,
    base_solids,
    finger_solids,
    tool_solids,
)
from app.scene.solids import Finish, RoundBar, Solid
from app.scene.table import board_solids
from controller.model.vectors import combine, cross, dot, minus, scaled, turn
from hardware.interfaces import Triple
from hardware.parameters import RobotParameters
from hardware.table import TableSettings

BOARD: Final = "board"
BASE: Final = "base"
TOOL: Final = "tool"
REFERENCE: Final = "reference"
CAMERA: Final = "camera"
FINGERS: Final = {1: "finger_right", -1: "finger_left"}
_SIDES: Final = {"a": -1.0, "b": 1.0}
"""Rods of a pair, and on which side of their middle along the servomotor's axis."""

Quaternion = tuple[float, float, float, float]
"""x, y, z, w."""
UNTURNED: Final[Quaternion] = (0.0, 0.0, 0.0, 1.0)
UPSIDE_DOWN: Final[Quaternion] = (1.0, 0.0, 0.0, 0.0)
"""Half a turn about x: from an axis z that points down to one that points up."""


@dataclass(frozen=True, slots=True)
class FramePose:
    """Where a frame is in another one."""

    parent: str
    child: str
    at: Triple
    """Its origin [m]."""
    turned: Quaternion = UNTURNED
    """Takes directions of the child into the parent."""


@dataclass(frozen=True, slots=True)
class FramedSolids:
    """Solids that rest in a frame."""

    name: str
    frame: str
    solids: tuple[Solid, ...]


def proximal_frame(arm: int) -> str:
    """Of the proximal link of an arm (0, 1, 2): its origin is on the servomotor's axis, x along that."""
    return f"arm{arm + 1}/proximal"


def rod_frame(arm: int, rod: str) -> str:
    """Of a rod, a or b, of an arm (0, 1, 2): its origin is at the elbow."""
    return f"arm{arm + 1}/rod_{rod}"


def fixed_frames(
    table: TableSettings, board_from_camera: Sequence[Sequence[float]] | None = None
) -> tuple[FramePose, ...]:
    """The base in the board's frame, and the camera, where that is known.

    Args:
        table: that the robot works at.
        board_from_camera: takes points of the camera's frame into the board's [m]; rotation, translation: three rows.
    """
    into_base = table.pose_in_base()
    turn_back = into_base[:3, :3].T
    x, y, z = (-turn_back @ into_base[:3, 3]).tolist()
    base = FramePose(BOARD, BASE, (x, y, z), quaternion_of(turn_back.tolist()))
    if board_from_camera is None:
        return (base,)
    rows = np.array(board_from_camera, dtype=float)
    x, y, z = rows[:, 3].tolist()
    return base, FramePose(BOARD, CAMERA, (x, y, z), quaternion_of(rows[:, :3].tolist()))


def moving_frames(joints: ArmJoints, finger: float, reference: Triple) -> tuple[FramePose, ...]:
    """All frames that move, in a pose.

    Args:
        joints: of the arm, base frame.
        finger: from a pad's front edge to the tool point [m].
        reference: where the tool is meant to be, base frame [m].
    """
    frames = [FramePose(BASE, TOOL, joints.tool), FramePose(BASE, REFERENCE, reference)]
    frames += [FramePose(TOOL, name, (side * finger, 0.0, 0.0)) for side, name in FINGERS.items()]
    for arm in range(ARMS):
        shoulder, elbow, wrist, axis = (
            joints.shoulders[arm], joints.elbows[arm], joints.wrists[arm], joints.axes[arm],
        )  # fmt: skip
        frames.append(FramePose(BASE, proximal_frame(arm), shoulder, _along(minus(elbow, shoulder), axis)))
        turned = _along(minus(wrist, elbow), axis)
        for rod, side in _SIDES.items():
            frames.append(FramePose(BASE, rod_frame(arm, rod), combine(elbow, side * ROD_HALF_DISTANCE, axis), turned))
    return tuple(frames)


def robot_solids(parameters: RobotParameters) -> tuple[FramedSolids, ...]:
    """All of the robot, in the frames of ``moving_frames`` and in ``base``."""
    g = parameters.geometry
    parts = [FramedSolids("base", BASE, base_solids(parameters))]
    for arm in range(ARMS):
        end = (0.0, 0.0, g.proximal_length)
        aside = (ROD_HALF_DISTANCE, 0.0, 0.0)
        link = RoundBar((0.0, 0.0, 0.0), end, PROXIMAL_RADIUS, Finish.ALUMINIUM)
        elbow = RoundBar(minus(end, aside), combine(end, 1.0, aside), ROD_RADIUS, Finish.METAL)
        parts.append(FramedSolids(proximal_frame(arm), proximal_frame(arm), (link, elbow)))
        rod = RoundBar((0.0, 0.0, 0.0), (0.0, 0.0, g.distal_length), ROD_RADIUS, Finish.CARBON)
        parts += [FramedSolids(rod_frame(arm, one), rod_frame(arm, one), (rod,)) for one in _SIDES]
    parts.append(FramedSolids("tool", TOOL, (*tool_solids(parameters), *_wrists(parameters))))
    parts += [FramedSolids(name, name, finger_solids(parameters, side)) for side, name in FINGERS.items()]
    return tuple(parts)


def table_solids(table: TableSettings) -> FramedSolids:
    """The board and what it lies on."""
    return FramedSolids("board", BOARD, board_solids(table))


def _wrists(parameters: RobotParameters) -> tuple[RoundBar, ...]:
    """The bars at the flange that the rods hang on, seen from the tool point."""
    g, bars = parameters.geometry, []
    for arm in range(ARMS):
        middle, axis = turn(arm, (0.0, g.flange_radius, -g.gripper_height)), turn(arm, (1.0, 0.0, 0.0))
        ends = combine(middle, -ROD_HALF_DISTANCE, axis), combine(middle, ROD_HALF_DISTANCE, axis)
        bars.append(RoundBar(*ends, ROD_RADIUS, Finish.METAL))
    return tuple(bars)


def _along(way: Triple, axis: Triple) -> Quaternion:
    """A frame with z along a way, and x as near to an axis as that lets it be."""
    z = _unit(way)
    x = _unit(combine(axis, -dot(axis, z), z))
    return quaternion_of(tuple(zip(x, cross(z, x), z, strict=True)))


def _unit(v: Triple) -> Triple:
    return scaled(1.0 / math.sqrt(dot(v, v)), v)


def quaternion_of(r: Sequence[Sequence[float]]) -> Quaternion:
    """Of a rotation matrix, row by row, by its largest component, so that nothing is divided by little."""
    trace = r[0][0] + r[1][1] + r[2][2]
    squares = (1.0 + 2.0 * r[0][0] - trace, 1.0 + 2.0 * r[1][1] - trace, 1.0 + 2.0 * r[2][2] - trace, 1.0 + trace)
    largest = max(range(4), key=squares.__getitem__)
    root = math.sqrt(squares[largest])
    if largest == 3:
        parts = [r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1], 0.0]
    else:
        i, j, k = largest, (largest + 1) % 3, (largest + 2) % 3
        parts = [0.0, 0.0, 0.0, r[k][j] - r[j][k]]
        parts[j], parts[k] = r[j][i] + r[i][j], r[k][i] + r[i][k]
    x, y, z, w = (0.5 * root if n == largest else 0.5 * part / root for n, part in enumerate(parts))
    return x, y, z, w


def turned_by(rotation: Quaternion, v: Triple) -> Triple:
    """A vector of the child's frame in the parent's: v + 2 w (q × v) + 2 q × (q × v) for the vector part q."""
    q, w = rotation[:3], rotation[3]
    first = cross(q, v)
    return combine(combine(v, 2.0 * w, first), 2.0, cross(q, first))
