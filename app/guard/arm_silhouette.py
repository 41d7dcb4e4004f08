"""Where the arm is in the board frame, as capsules: what a camera must not take for a hand.

Links lie, and are as thick, as ``app.scene.arm`` says. What the fingers may hold counts as a part of the arm, whether
they hold something or not.
"""

from __future__ import annotations

import bisect
import math
import threading
from collections import deque
from typing import Final, NamedTuple

import numpy as np

from app.scene.arm import (
    BODY_HALF_LENGTH,
    BODY_HEIGHT,
    BODY_RADIUS,
    FINGER_RADIUS,
    FLANGE_THICKNESS,
    arm_joints,
    leg_solids,
    servo_solids,
)
from controller.model.constants import DeltaModel
from controller.protocol.datagram_fields import Flag
from controller.protocol.messages import Telemetry
from controller.settings import ControllerSettings
from hardware.interfaces import Triple
from hardware.parameters import RobotParameters
from hardware.piece_set import PIECE_SHAPES
from hardware.table import TableSettings
from vision.arrays import Array
from vision.board.view import BoardView
from vision.hands.arm_mask import Capsules, Hidden, draw_mask

MARGIN: Final = 0.008  # the arm is masked so much thicker than it is: what calibration and interpolation may err [m] …
APART: Final = 0.020
"""What is measured so far off the arm is not the arm [m]: besides that margin, what depth errs, and how far an arm at
full speed moves in the time by which a frame's stamp errs."""
GROW: Final = 4  # … and so much wider in the picture: edges that a depth camera smears [px]
HELD_RADIUS: Final = 0.002 + max(shape.foot_radius for shape in PIECE_SHAPES.values())
HELD_BELOW: Final = max(shape.grip_height for shape in PIECE_SHAPES.values())
HELD_ABOVE: Final = max(shape.height - shape.grip_height for shape in PIECE_SHAPES.values())
"""From the tool point to both ends of the tallest piece that it may hold [m]."""
_FAN: Final = 4  # the flange is drawn as so many bars across it
_PLATE_BARS: Final = 3  # the marker's plate is drawn as so many bars along it
_EVERY: Final = ControllerSettings().telemetry_ticks
"""On a lockstep bus one of so many ticks is kept, the first: that is told in every run [ticks]."""
_MOST_WAIT: Final = 2.0  # for telemetry that is on its way [s, wall]


class ArmPose(NamedTuple):
    """Servomotor angles (3,) [rad] and how far a finger is open [m]."""

    angle: Triple
    finger: float


def arm_capsules(parameters: RobotParameters, table: TableSettings, pose: ArmPose) -> Capsules:
    """All links of an arm in a pose, board frame, by the lengths of the robot and where the board is below its base.

    Raises:
        PoseError: no tool point belongs to these angles.
    """
    joints = arm_joints(DeltaModel(parameters), pose.angle)
    tool = np.array(joints.tool)
    ends, radii = list[tuple[Array, Array]](), list[float]()
    for bar in (*servo_solids(parameters), *leg_solids(joints)):
        ends.append((np.array(bar.start), np.array(bar.end)))
        radii.append(bar.radius)
    tool_parts = (*_flange(parameters, tool), *_gripper(parameters, tool, pose.finger), *_marker(parameters, tool))
    for start, end, radius in tool_parts:
        ends.append((start, end))
        radii.append(radius)
    return Capsules(table.board_from_base(np.array(ends)), np.array(radii))


def _flange(parameters: RobotParameters, tool: Array) -> list[tuple[Array, Array, float]]:
    """A disc, as bars across it that overlap at its rim."""
    g = parameters.geometry
    centre = tool - [0.0, 0.0, g.gripper_height]
    radius = g.flange_radius * math.sin(math.pi / (2 * _FAN))
    reach = g.flange_radius - radius + FLANGE_THICKNESS
    bars = []
    for angle in np.arange(_FAN) * math.pi / _FAN:
        way = reach * np.array([math.cos(angle), math.sin(angle), 0.0])
        bars.append((centre - way, centre + way, radius))
    return bars


def _gripper(parameters: RobotParameters, tool: Array, finger: float) -> list[tuple[Array, Array, float]]:
    pads, aside = parameters.pads, np.array([BODY_HALF_LENGTH - BODY_RADIUS / 2.0, 0.0, 0.0])
    body = tool - [0.0, 0.0, BODY_HEIGHT]
    links = [(body - aside, body + aside, BODY_RADIUS)]
    out = finger + pads.half_width * math.tan(pads.groove_angle) + 0.5 * pads.back
    for side in (-1.0, 1.0):
        tip = tool + np.array([side * out, 0.0, 0.0])
        links.append((tip - [0.0, 0.0, BODY_HEIGHT], tip, FINGER_RADIUS))
    below, above = HELD_BELOW - HELD_RADIUS / 2.0, HELD_ABOVE - HELD_RADIUS / 2.0
    links.append((tool - [0.0, 0.0, above], tool + np.array([0.0, 0.0, below]), HELD_RADIUS))
    return links


def _marker(parameters: RobotParameters, tool: Array) -> list[tuple[Array, Array, float]]:
    """The printed marker's plate, as bars along it that overlap at its corners."""
    marker = parameters.marker
    if marker is None:
        return []
    half = 0.5 * marker.plate
    up = np.array([0.0, math.sin(marker.tilt), -math.cos(marker.tilt)])
    radius = 1.1 * half / _PLATE_BARS
    links = []
    for number in range(_PLATE_BARS):
        middle = tool + marker.centre + ((2 * number + 1) / _PLATE_BARS - 1.0) * half * up
        aside = np.array([half, 0.0, 0.0])
        links.append((middle - aside, middle + aside, radius))
    return links


class ArmHistory:
    """Where the arm was a moment ago, from its telemetry: frames arrive later than they were exposed. ``tick`` is the
    length of one, poses are ``kept`` for so long [s].
    """

    def __init__(self, tick: float, kept: float = 1.0) -> None:
        self._tick = tick
        self._ticks: deque[int] = deque()
        self._poses: deque[ArmPose] = deque()
        self._kept = round(kept / tick)
        self._news = threading.Condition()

    def take(self, telemetry: Telemetry) -> None:
        """Keep what one telemetry tells, unless it is older than the last; a listener of the controller's client."""
        with self._news:
            if self._ticks and telemetry.tick <= self._ticks[-1]:
                return
            if (
                telemetry.flags & Flag.LOCKSTEP
                and self._ticks
                and telemetry.tick // _EVERY == self._ticks[-1] // _EVERY
            ):
                return  # sent besides, by the wall clock: so two runs know the same
            self._ticks.append(telemetry.tick)
            self._poses.append(ArmPose(telemetry.angle, telemetry.finger_position))
            while self._ticks[-1] - self._ticks[0] > self._kept and len(self._ticks) > 2:
                self._ticks.popleft()
                self._poses.popleft()
            self._news.notify_all()

    @property
    def newest(self) -> float:
        """Plant time of the newest telemetry [s]; -∞ before the first."""
        with self._news:
            return self._ticks[-1] * self._tick if self._ticks else -math.inf

    def at(self, stamp: float) -> ArmPose | None:
        """The pose at a plant time [s], between the telemetry before and after it.

        Waits for telemetry that is still on its way. None where nobody can say: it is older than all that is kept, or
        no telemetry of that time came.
        """
        tick = stamp / self._tick
        with self._news:
            self._news.wait_for(lambda: bool(self._ticks) and self._ticks[-1] >= tick - 0.5, _MOST_WAIT)
            if not self._ticks or self._ticks[0] > tick + 0.5 or self._ticks[-1] < tick - 0.5:
                return None
            after = min(bisect.bisect_left(self._ticks, tick), len(self._ticks) - 1)
            before = max(after - 1, 0)
            first, last = self._ticks[before], self._ticks[after]
            share = min(max((tick - first) / (last - first), 0.0), 1.0) if last > first else 1.0
            return _between(self._poses[before], self._poses[after], share)


def _between(one: ArmPose, other: ArmPose, share: float) -> ArmPose:
    a, b, c = ((1.0 - share) * p + share * q for p, q in zip(one.angle, other.angle, strict=True))
    return ArmPose((a, b, c), (1.0 - share) * one.finger + share * other.finger)


class ArmMasks:
    """Where the arm of a robot, above a table, is before that in a frame of a view, by the history of where it was."""

    def __init__(self, view: BoardView, parameters: RobotParameters, table: TableSettings, history: ArmHistory) -> None:
        self._view, self._parameters, self._table, self._history = view, parameters, table, history
        self._last: tuple[ArmPose, Hidden] | None = None

    def at(self, stamp: float) -> Hidden | None:
        """Where it was in a frame of this stamp [s]; None where nobody knows."""
        pose = self._history.at(stamp)
        if pose is None:
            return None
        if self._last is None or self._last[0] != pose:
            capsules = arm_capsules(self._parameters, self._table, pose)
            self._last = pose, Hidden(draw_mask(self._view, capsules, MARGIN, GROW), capsules.grown(APART))
        return self._last[1]
