"""Ways of the hand over the board: high enough over pieces, and clear of the robot's tool. Pure functions."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hardware.piece_set import Colour
from hardware.sim.bodies.hand import TIP_RADIUS, HandPose
from hardware.sim.hand.motion import Program, Sketch
from hardware.sim.hand.sight import TableView

CLEARANCE: Final = 0.010
"""What is carried passes so far above what stands below [m]."""
LEAST_LIFT: Final = 0.012
ENOUGH_ARM_ROOM: Final = 0.012
_COME_OUT: Final = 0.30
"""Where a hand goes around the board: so far from its middle, on the player's side [m]."""
_STAGE: Final = 0.085
"""A detour begins or ends so far from where a piece stands [m] …"""
_STAGINGS: Final = 8
"""… in one of so many directions."""
_LONGEST_RETREAT: Final = 0.35
EMPTY_WIDTH: Final = 0.036
"""To each side of the way of empty fingers [m]."""
_GLANCE: Final = 0.02
"""Apart, where a stroke is looked at for being too quick [s]."""
CAREFUL: Final = 0.20
"""A hand that has to pass closer to the robot goes no faster than this [m/s]."""


@dataclass(frozen=True, slots=True)
class Hold:
    """How the fingertips stand about a point: turn of the hand [rad] and gap when open [m]."""

    yaw: float
    gap: float


@dataclass(frozen=True, slots=True)
class Traveller:
    """Whose hand it is and how quick."""

    side: Colour
    """Of the board."""
    speed: float
    """Highest of a reach [m/s]."""

    @property
    def front(self) -> float:
        """Sign of y on the person's side."""
        return -1.0 if self.side is Colour.WHITE else 1.0

    def go(
        self,
        sight: TableView,
        start: HandPose,
        holds: list[Hold],
        tips: Callable[[Hold], tuple[float, float]],
        below: float,
        wide: float,
    ) -> tuple[Sketch, Hold]:
        """Up, over to a point, and no further down: the program's last pose is where the way down begins.

        Of several ways and holds, best first, it takes the first that keeps clear of the robot, else the one that does
        so best. ``sight`` is without what is held; ``tips`` says where the fingertips shall be for a hold, x and y [m];
        ``below`` is the lowest point of what is carried, or of the fingertips, under the fingertips' ends, and ``wide``
        from the way to the middle of a piece that could be touched [m].
        """
        ways: list[tuple[Hold, HandPose, list[tuple[HandPose, ...]]]] = []
        for hold in holds:
            x, y = tips(hold)
            end = HandPose(x, y, 0.0, hold.yaw, start.gap)
            out = (self.way_out(start), self.way_out(end))
            ways.append((hold, end, [(), out, *_stagings(start, end)]))
        tried = [(hold, end, corners[i]) for i in range(len(ways[0][2])) for hold, end, corners in ways]
        hold, sketch = self._first_clear(sight, start, tried, below, wide)
        return sketch, hold

    def leave(self, sight: TableView, start: HandPose, hold: Hold, end: HandPose) -> Sketch:
        """Likewise to a place in the air, with empty fingers."""
        out = (self.way_out(start),)
        low = [(near, self.way_out(near)) for near in around(start, start.yaw)]
        tried = [(hold, end, corners) for corners in [(), out, *low]]
        return self._first_clear(sight, start, tried, TIP_RADIUS, EMPTY_WIDTH)[1]

    def _first_clear(
        self,
        sight: TableView,
        start: HandPose,
        tried: list[tuple[Hold, HandPose, tuple[HandPose, ...]]],
        below: float,
        wide: float,
    ) -> tuple[Hold, Sketch]:
        """Of holds, ends and corners in between the first that keeps clear of the robot, or the best one.

        Where that passes close to the robot it is slow, and only there: people do not creep all the way.
        """
        best, most = tried[0], -math.inf
        for hold, end, between in tried:
            sketch = self._way(sight, start, between, end, below, wide)
            room = sight.arm_room(*_samples(sketch.done()))
            if room > ENOUGH_ARM_ROOM:
                return hold, sketch
            if room > most:
                best, most = (hold, end, between), room
        hold, end, between = best
        return hold, self._way(sight, start, between, end, below, wide, careful=most < ENOUGH_ARM_ROOM / 2.0)

    def way_out(self, pose: HandPose) -> HandPose:
        """Where the fingertips come out in front of the board if the hand is drawn back along the forearm."""
        back = math.sin(pose.yaw), -math.cos(pose.yaw)
        needed = (self.front * _COME_OUT - pose.y) / back[1] if abs(back[1]) > 0.1 else 0.0
        length = min(max(0.0, needed), _LONGEST_RETREAT)
        return pose._replace(x=pose.x + length * back[0], y=pose.y + length * back[1])

    def _way(
        self, sight: TableView, start: HandPose, between: tuple[HandPose, ...], end: HandPose, below: float,
        wide: float, *, careful: bool = False,
    ) -> Sketch:  # fmt: skip
        """On each straight part only as high as what stands below it wants, and as fast as the robot's tool allows."""
        sketch, before = Sketch(start, self.speed), self.speed

        def stroke(end: HandPose, overlap: float) -> None:
            nonlocal before
            here = sketch.pose
            speed = CAREFUL if careful and self._hurries_past(sight, here, end) else self.speed
            # what is slow is not left sooner than what is quick
            by = overlap * min(1.0, before / speed)
            sketch.to(x=end.x, y=end.y, z=end.z, yaw=end.yaw, overlap=by, speed=speed)
            before = speed

        for pose in (*between, end):
            line = (sketch.pose.x, sketch.pose.y), (pose.x, pose.y)
            z = max(sight.highest(*line, width=wide) + CLEARANCE, LEAST_LIFT) + below
            if z > sketch.pose.z or between:
                stroke(sketch.pose._replace(z=z), 0.15)
            stroke(pose._replace(z=sketch.pose.z), 0.25)
        if z < sketch.pose.z:
            stroke(sketch.pose._replace(z=z), 0.3)
        return sketch

    def _hurries_past(self, sight: TableView, start: HandPose, end: HandPose) -> bool:
        """Whether a stroke would be faster than ``CAREFUL`` close to the robot: corners may make it closer still."""
        stroke = Sketch(start, self.speed).to(x=end.x, y=end.y, z=end.z, yaw=end.yaw).done()
        for time in np.arange(0.0, stroke.duration, _GLANCE).tolist():
            position, velocity, _ = stroke.at(time)
            if np.linalg.norm(velocity[:3]) > CAREFUL and sight.arm_room(HandPose(*position)) < ENOUGH_ARM_ROOM:
                return True
        return False


def around(pose: HandPose, yaw: float) -> list[HandPose]:
    """Points about a pose from which one may come to it, or to which one may leave it."""
    circle = [2.0 * math.pi * i / _STAGINGS for i in range(_STAGINGS)]
    return [pose._replace(x=pose.x + _STAGE * math.cos(a), y=pose.y + _STAGE * math.sin(a), yaw=yaw) for a in circle]


def _stagings(start: HandPose, end: HandPose) -> list[tuple[HandPose, ...]]:
    """Corners that let a hand leave low before it rises, and come down before it arrives, under the robot's tool."""
    leaving, coming = around(start, start.yaw), around(end, end.yaw)
    both = [(a, min(coming, key=lambda b: math.dist(a[:2], b[:2]))) for a in leaving]
    return [*((b,) for b in coming), *((a,) for a in leaving), *both]


def _samples(program: Program, spacing: float = 0.05) -> list[HandPose]:
    times: NDArray[np.float64] = np.arange(0.0, program.duration + spacing, spacing)
    return [HandPose(*program.at(float(time)).position.tolist()) for time in times]
