"""From what a person sees to motor programs: how to hold a piece, how high to lift it, which way to go.

Pure functions. A person looks where neighbours and the robot are, and comes from the side where there is room.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hardware.sim.hand_body import TIP_RADIUS
from hardware.sim.hand_motion import Pose, Program, Sketch
from hardware.sim.hand_sight import SeenPiece, Sight
from hardware.table import Colour, PieceShape

SQUEEZE: Final = 0.0035
"""Fingers are asked to close so much further than the piece lets them; times their stiffness it is the force [m]."""
OPEN: Final = 0.0055
"""Before and after, each fingertip is so far from the piece [m]; less where neighbours stand near."""
CLEARANCE: Final = 0.010
"""What is carried passes so far above what stands below [m]."""
LEAST_LIFT: Final = 0.012
_GRASP_LENGTH: Final = 0.016
"""So much of a stem is between the fingertips [m]."""
_GAP_AT_EASE: Final = 0.004
_DOWN_SPEED: Final = 0.22
"""Highest, down to a piece or with a piece down to the board [m/s]."""
_PRESS: Final = 0.0015
"""A piece is pushed so far into the board; times the arm's stiffness it is the force that says that it stands [m]."""
_ENOUGH_ROOM: Final = 0.004
_ENOUGH_ARM_ROOM: Final = 0.012
_COME_OUT: Final = 0.30
"""Where a hand goes around the board: so far from its middle, on the player's side [m]."""
_MOST_HOLDS: Final = 4
_DIFFERENT: Final = 0.4
"""Between two holds that are tried [rad]."""
_STAGE: Final = 0.085
"""A detour begins or ends so far from where a piece stands [m] …"""
_STAGINGS: Final = 8
"""… in one of so many directions."""
_LONGEST_RETREAT: Final = 0.35
_SHOULDER: Final = (0.22, -0.75)
"""Of a player who sits at −y, from the board's middle [m]: a right arm."""
_TURNS: Final = tuple(math.radians(7.5 * i) for i in range(-10, 11))
"""Of the hand that a person tries, from straight across the board [rad]."""


def grip_height(shape: PieceShape) -> float:
    """Height of the fingertips' ends on a standing piece [m]: at its upper part, above its foot."""
    return max(shape.height - shape.stem_radius - _GRASP_LENGTH, shape.foot_height + TIP_RADIUS + 0.002)


@dataclass(frozen=True, slots=True)
class Held:
    """A piece between the fingertips.

    Attributes:
        name: of it.
        shape: sizes.
        below: of its foot under the fingertips' ends [m].
        forward: of its foot from the middle between the fingertips, hand frame, x and y [m].
    """

    name: str
    shape: PieceShape
    below: float
    forward: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Hold:
    """How the fingertips stand about a point: turn of the hand [rad] and gap when open [m]."""

    yaw: float
    gap: float


@dataclass(frozen=True, slots=True)
class Person:
    """Whose hand it is and how quick.

    Attributes:
        side: of the board.
        speed: highest of a reach [m/s].
    """

    side: Colour
    speed: float

    @property
    def front(self) -> float:
        """Sign of y on the person's side."""
        return -1.0 if self.side is Colour.WHITE else 1.0

    def natural_yaw(self, x: float, y: float) -> float:
        """Turn of the hand with the forearm pointing to the shoulder [rad]."""
        base = 0.0 if self.side is Colour.WHITE else math.pi
        sign = -self.front  # black's view is white's, turned by half a turn
        dx, dy = _SHOULDER[0] - sign * x, _SHOULDER[1] - sign * y
        return base + math.atan2(dx, -dy)

    # how to hold

    def holds(
        self,
        sight: Sight,
        x: float,
        y: float,
        z: float,
        lifted: float,
        radius: float,
        around: float | None = None,
        then: tuple[float, float] | None = None,
    ) -> list[Hold]:
        """Turns of the hand that leave room for neighbours and for the robot, quite different ones, best first.

        Args:
            sight: without the piece that is held.
            x: of the piece [m].
            y: likewise.
            z: of the fingertips at the piece [m].
            lifted: and when they come from above, or lift it [m].
            radius: of the stem [m].
            around: turn that would be best otherwise [rad].
            then: where the fingertips go from there, at the same height [m].
        """
        further = then or (x, y)
        best = self.natural_yaw(x, y) if around is None else around

        def cost(yaw: float) -> float:
            half = radius + OPEN + TIP_RADIUS
            room = sight.pinch_room(x, y, yaw, z, half)
            first = Pose(x, y, z, yaw, radius + OPEN)
            low = sight.arm_room(first, first._replace(x=further[0], y=further[1]))
            high = sight.arm_room(first._replace(z=lifted))  # there are other ways than straight from above
            lacking = max(0.0, 1.0 - room / _ENOUGH_ROOM) + max(0.0, 1.0 - low / _ENOUGH_ARM_ROOM)
            return 10.0 * lacking + 3.0 * max(0.0, 1.0 - high / _ENOUGH_ARM_ROOM) + abs(yaw - best)

        base = 0.0 if self.side is Colour.WHITE else math.pi
        turns = [base + turn for turn in _TURNS]
        found: list[Hold] = []
        for yaw in sorted([best, *turns], key=cost):
            if len(found) < _MOST_HOLDS and all(abs(yaw - hold.yaw) > _DIFFERENT for hold in found):
                room = sight.pinch_room(x, y, yaw, z, radius + OPEN + TIP_RADIUS)
                found.append(Hold(yaw, radius + OPEN - min(0.0025, max(0.0, _ENOUGH_ROOM / 2.0 - room))))
        return found

    # ways

    def go(
        self,
        sight: Sight,
        start: Pose,
        holds: list[Hold],
        tips: Callable[[Hold], tuple[float, float]],
        below: float,
        wide: float,
    ) -> tuple[Sketch, Hold]:
        """Up, over to a point, and no further down: the program's last pose is where the way down begins.

        Of several ways and holds it takes the first that keeps clear of the robot, else the one that does so best.

        Args:
            sight: without what is held.
            start: of the fingertips.
            holds: at the end, best first.
            tips: where the fingertips shall be for a hold, x and y [m].
            below: lowest point of what is carried, or of the fingertips, under the fingertips' ends [m].
            wide: from the way to the middle of a piece that could be touched [m].
        """
        best, most = None, -math.inf
        for hold in holds:
            x, y = tips(hold)
            end = Pose(x, y, 0.0, hold.yaw, start.gap)
            around = (self._way_out(start), self._way_out(end))
            way, room = self._clearest(sight, start, (around, *_stagings(start, end)), end, below, wide)
            if best is None or room > most:
                best, most = (way, hold), room
            if room > _ENOUGH_ARM_ROOM:
                break
        assert best is not None
        return best

    def _clearest(
        self, sight: Sight, start: Pose, detours: tuple[tuple[Pose, ...], ...], end: Pose, below: float, wide: float
    ) -> tuple[Sketch, float]:
        """Straight, or over some corners if only that keeps clear of the robot; and how clear it keeps [m]."""
        best, most = None, -math.inf
        for between in ((), *detours):
            way = self._way(sight, start, between, end, below, wide)
            room = sight.arm_room(*_samples(way.done()))
            if best is None or room > most + 0.002:
                best, most = way, room
            if room > _ENOUGH_ARM_ROOM:
                break
        assert best is not None
        return best, most

    def _way_out(self, pose: Pose) -> Pose:
        """Where the fingertips come out in front of the board if the hand is drawn back along the forearm."""
        back = math.sin(pose.yaw), -math.cos(pose.yaw)
        needed = (self.front * _COME_OUT - pose.y) / back[1] if abs(back[1]) > 0.1 else 0.0
        length = min(max(0.0, needed), _LONGEST_RETREAT)
        return pose._replace(x=pose.x + length * back[0], y=pose.y + length * back[1])

    def _way(
        self, sight: Sight, start: Pose, between: tuple[Pose, ...], end: Pose, below: float, wide: float
    ) -> Sketch:
        """On each straight part only as high as what stands below it wants."""
        sketch, corners = Sketch(start, self.speed), (*between, end)
        for pose in corners:
            line = (sketch.pose.x, sketch.pose.y), (pose.x, pose.y)
            z = max(sight.highest(*line, width=wide) + CLEARANCE, LEAST_LIFT) + below
            if z > sketch.pose.z or between:
                sketch.to(z=z, overlap=0.15)
            sketch.to(x=pose.x, y=pose.y, yaw=pose.yaw, overlap=0.25)
        return sketch.to(z=z, overlap=0.3) if z < sketch.pose.z else sketch

    # parts of actions

    def reach(self, sight: Sight, start: Pose, piece: SeenPiece) -> tuple[Program, Hold]:
        """To a standing piece, down around it and close the fingers."""
        shape, others = piece.shape, sight.without(piece.name)
        z = piece.z + grip_height(shape)
        way = (start.x, start.y), (piece.x, piece.y)
        lifted = max(piece.top, others.highest(*way, width=0.036)) + TIP_RADIUS + CLEARANCE
        holds = self.holds(others, piece.x, piece.y, z, lifted, shape.stem_radius)
        sketch, hold = self.go(sight, start, holds, lambda _: (piece.x, piece.y), TIP_RADIUS, 0.036)
        sketch.to(gap=hold.gap, overlap=1.0)
        sketch.to(z=z, overlap=0.15, speed=_DOWN_SPEED).wait(0.04)
        sketch.to(gap=shape.stem_radius - SQUEEZE).wait(0.06)
        return sketch.done(), hold

    def place(self, sight: Sight, start: Pose, held: Held, x: float, y: float, yaw: float) -> Program:
        """Carry what is held to a point, turned somewhat, and set it down; the fingers stay closed."""
        others, shape = sight.without(held.name), held.shape
        z = held.below
        wide = 0.026 + shape.foot_radius
        lifted = z + max(others.highest((start.x, start.y), (x, y), width=wide) + CLEARANCE, LEAST_LIFT)
        holds = self.holds(others, x, y, z, lifted, shape.stem_radius, around=yaw)
        sketch, _ = self.go(
            others, start, holds, lambda hold: _tips_for(x, y, hold.yaw, held.forward), held.below, wide
        )
        sketch.to(z=z - _PRESS, overlap=0.15, speed=_DOWN_SPEED).wait(0.05)
        return sketch.done()

    def let_go(self, sight: Sight, start: Pose, held: Held) -> Program:
        """Open the fingers about a piece that stands, and rise above it."""
        others = sight.without(held.name)
        half = held.shape.stem_radius + OPEN + TIP_RADIUS
        room = others.pinch_room(start.x, start.y, start.yaw, start.z, half)
        gap = held.shape.stem_radius + OPEN - min(0.0025, max(0.0, _ENOUGH_ROOM / 2.0 - room))
        sketch = Sketch(start, self.speed).to(gap=gap).wait(0.03)
        return sketch.to(z=max(start.z, held.shape.height + TIP_RADIUS + CLEARANCE)).done()

    def lift(self, start: Pose, height: float) -> Program:
        """Straight up [m]."""
        return Sketch(start, self.speed).to(z=start.z + height, speed=_DOWN_SPEED).done()

    def home(self, sight: Sight, start: Pose, home: Pose) -> Program:
        """Up, back along the forearm, and away to where the hand is parked."""
        end = home._replace(gap=start.gap)
        out = (self._way_out(start),)
        low = tuple((near, self._way_out(near)) for near in _around(start, start.yaw))
        sketch, _ = self._clearest(sight, start, (out, *low), end, TIP_RADIUS, 0.036)
        return sketch.to(z=home.z, gap=home.gap, overlap=0.5).done()

    def over(
        self,
        sight: Sight,
        start: Pose,
        x: float,
        y: float,
        z: float,
        held: Held | None = None,
        then: tuple[float, float] | None = None,
    ) -> Sketch:
        """To a point in the air, fingertips at a height above the board [m]; nearly closed if they hold nothing."""
        holds = self.holds(Sight((), sight.tool), x, y, z, z, 0.0, then=then)
        if held is None:
            sketch, _ = self.go(sight, start, holds, lambda _: (x, y), TIP_RADIUS, 0.036)
            sketch.to(gap=_GAP_AT_EASE, overlap=1.0)
        else:
            wide, others = 0.026 + held.shape.foot_radius, sight.without(held.name)
            sketch, _ = self.go(others, start, holds, lambda _: (x, y), held.below, wide)
        return sketch.to(z=z, overlap=0.15, speed=_DOWN_SPEED)


def _around(pose: Pose, yaw: float) -> list[Pose]:
    """Points about a pose from which one may come to it, or to which one may leave it."""
    circle = [2.0 * math.pi * i / _STAGINGS for i in range(_STAGINGS)]
    return [pose._replace(x=pose.x + _STAGE * math.cos(a), y=pose.y + _STAGE * math.sin(a), yaw=yaw) for a in circle]


def _stagings(start: Pose, end: Pose) -> list[tuple[Pose, ...]]:
    """Corners that let a hand leave low before it rises, and come down before it arrives, under the robot's tool."""
    leaving, coming = _around(start, start.yaw), _around(end, end.yaw)
    return [(b,) for b in coming] + [(a,) for a in leaving] + [(a, b) for a in leaving for b in coming]


def _tips_for(x: float, y: float, yaw: float, forward: tuple[float, float]) -> tuple[float, float]:
    cos, sin = math.cos(yaw), math.sin(yaw)
    return x - cos * forward[0] + sin * forward[1], y - sin * forward[0] - cos * forward[1]


def held_now(piece: SeenPiece, pose: Pose) -> Held:
    """How a piece is held by fingertips in a pose."""
    dx, dy = piece.x - pose.x, piece.y - pose.y
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    return Held(piece.name, piece.shape, pose.z - piece.z, (cos * dx + sin * dy, -sin * dx + cos * dy))


def _samples(program: Program, spacing: float = 0.03) -> list[Pose]:
    times: NDArray[np.float64] = np.arange(0.0, program.duration + spacing, spacing)
    return [Pose(*program.at(float(time)).position.tolist()) for time in times]
