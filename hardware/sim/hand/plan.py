"""From what a person sees to motor programs: how to hold a piece, how high to lift it, which way to go.

Pure functions. A person looks where neighbours and the robot are, and comes from the side where there is room.
"""

import math
from dataclasses import dataclass, replace
from typing import Final

from hardware.piece_set import Colour, PieceShape
from hardware.sim.bodies.hand import TIP_RADIUS, HandPose
from hardware.sim.hand.motion import Program, Sketch
from hardware.sim.hand.paths import CLEARANCE, EMPTY_WIDTH, ENOUGH_ARM_ROOM, LEAST_LIFT, Hold, Traveller
from hardware.sim.hand.sight import SeenPiece, TableView

SQUEEZE: Final = 0.0035
"""Fingers are asked to close so much further than the piece lets them; times their stiffness it is the force [m]."""
OPEN: Final = 0.0055
"""Before and after, each fingertip is so far from the piece [m]; less where neighbours stand near."""
_GRASP_LENGTH: Final = 0.016
"""So much of a stem is between the fingertips [m]."""
_GAP_AT_EASE: Final = 0.004
_DOWN_SPEED: Final = 0.22
"""Highest, down to a piece or with a piece down to the board [m/s]."""
_PRESS: Final = 0.0015
"""A piece is pushed so far into the board; times the arm's stiffness it is the force that says that it stands [m]."""
_ENOUGH_ROOM: Final = 0.004
_MOST_HOLDS: Final = 4
_DIFFERENT: Final = 0.4
"""Between two holds that are tried [rad]."""
_SHOULDER: Final = (0.22, -0.75)
"""Of a player who sits at −y, from the board's middle [m]: a right arm."""
_TURNS: Final = tuple(math.radians(7.5 * i) for i in range(-10, 11))
"""Of the hand that a person tries, from straight across the board [rad]."""


def grip_height(shape: PieceShape) -> float:
    """Height of the fingertips' ends on a standing piece [m]: at its upper part, above its foot."""
    return max(shape.height - shape.stem_radius - _GRASP_LENGTH, shape.foot_height + TIP_RADIUS + 0.002)


@dataclass(frozen=True, slots=True)
class Held:
    """A piece between the fingertips."""

    name: str
    shape: PieceShape
    below: float
    """Of its foot under the fingertips' ends [m]."""
    forward: tuple[float, float]
    """Of its foot from the middle between the fingertips, hand frame, x and y [m]."""


@dataclass(frozen=True, slots=True)
class Person(Traveller):
    """How somebody holds pieces, and the programs of which actions are made."""

    def natural_yaw(self, x: float, y: float) -> float:
        """Turn of the hand with the forearm pointing to the shoulder [rad]."""
        base = 0.0 if self.side is Colour.WHITE else math.pi
        sign = -self.front  # black's view is white's, turned by half a turn
        dx, dy = _SHOULDER[0] - sign * x, _SHOULDER[1] - sign * y
        return base + math.atan2(dx, -dy)

    # how to hold

    def holds(
        self,
        sight: TableView,
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
            x: of the piece, as y [m].
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
            first = HandPose(x, y, z, yaw, radius + OPEN)
            low = sight.arm_room(first, first._replace(x=further[0], y=further[1]))
            high = sight.arm_room(first._replace(z=lifted))  # there are other ways than straight from above
            lacking = max(0.0, 1.0 - room / _ENOUGH_ROOM) + max(0.0, 1.0 - low / ENOUGH_ARM_ROOM)
            return 10.0 * lacking + 3.0 * max(0.0, 1.0 - high / ENOUGH_ARM_ROOM) + abs(yaw - best)

        base = 0.0 if self.side is Colour.WHITE else math.pi
        turns = [base + turn for turn in _TURNS]
        found: list[Hold] = []
        for yaw in sorted([best, *turns], key=cost):
            if len(found) < _MOST_HOLDS and all(abs(yaw - hold.yaw) > _DIFFERENT for hold in found):
                found.append(Hold(yaw, _opened(sight, HandPose(x, y, z, yaw, radius + OPEN), radius)))
        return found

    # parts of actions

    def reach(self, sight: TableView, start: HandPose, piece: SeenPiece) -> tuple[Program, Hold]:
        """To a standing piece, down around it and close the fingers."""
        shape, others = piece.shape, sight.without(piece.name)
        z = piece.z + grip_height(shape)
        way = (start.x, start.y), (piece.x, piece.y)
        lifted = max(piece.top, others.highest(*way, width=EMPTY_WIDTH)) + TIP_RADIUS + CLEARANCE
        holds = self.holds(others, piece.x, piece.y, z, lifted, shape.stem_radius)
        sketch, hold = self.go(sight, start, holds, lambda _: (piece.x, piece.y), TIP_RADIUS, EMPTY_WIDTH)
        sketch.to(gap=hold.gap, overlap=1.0)
        sketch.to(z=z, overlap=0.15, speed=_DOWN_SPEED).wait(0.04)
        sketch.to(gap=shape.stem_radius - SQUEEZE).wait(0.06)
        return sketch.done(), hold

    def place(self, sight: TableView, start: HandPose, held: Held, x: float, y: float, yaw: float) -> Program:
        """Carry what is held to a point, turned somewhat, and set it down; the fingers stay closed."""
        others, shape = sight.without(held.name), held.shape
        z = held.below
        wide = 0.026 + shape.foot_radius
        lifted = z + max(others.highest((start.x, start.y), (x, y), width=wide) + CLEARANCE, LEAST_LIFT)
        holds = self.holds(others, x, y, z, lifted, shape.stem_radius, around=yaw)
        sketch, _ = self.go(others, start, holds, lambda hold: tips_for(x, y, hold.yaw, held.forward), held.below, wide)
        sketch.to(z=z - _PRESS, overlap=0.15, speed=_DOWN_SPEED).wait(0.05)
        return sketch.done()

    def let_go(self, sight: TableView, start: HandPose, held: Held) -> Program:
        """Open the fingers about a piece that stands, and rise above it."""
        others = sight.without(held.name)
        sketch = Sketch(start, self.speed).to(gap=_opened(others, start, held.shape.stem_radius)).wait(0.03)
        return sketch.to(z=max(start.z, held.shape.height + TIP_RADIUS + CLEARANCE)).done()

    def lift(self, start: HandPose, height: float) -> Program:
        """Straight up [m]."""
        return Sketch(start, self.speed).to(z=start.z + height, speed=_DOWN_SPEED).done()

    def home(self, sight: TableView, start: HandPose, home: HandPose) -> Program:
        """Up, back along the forearm, and away to where the hand is parked."""
        end = home._replace(gap=start.gap)
        sketch = self.leave(sight, start, Hold(home.yaw, start.gap), end)
        return sketch.to(z=home.z, gap=home.gap, overlap=0.5).done()

    def over(
        self,
        sight: TableView,
        start: HandPose,
        x: float,
        y: float,
        z: float,
        held: Held | None = None,
        then: tuple[float, float] | None = None,
        gap: float = _GAP_AT_EASE,
    ) -> Sketch:
        """To a point in the air, fingertips at a height above the board [m]; so far open if they hold nothing [m]."""
        holds = self.holds(replace(sight, pieces=()), x, y, z, z, 0.0, then=then)
        if held is None:
            sketch, _ = self.go(sight, start, holds, lambda _: (x, y), TIP_RADIUS, EMPTY_WIDTH)
            sketch.to(gap=gap, overlap=1.0)
        else:
            wide, others = 0.026 + held.shape.foot_radius, sight.without(held.name)
            sketch, _ = self.go(others, start, holds, lambda _: (x, y), held.below, wide)
        return sketch.to(z=z, overlap=0.15, speed=_DOWN_SPEED)


def _opened(sight: TableView, tips: HandPose, radius: float) -> float:
    """Gap of open fingers about a stem: less where neighbours stand near [m]."""
    room = sight.pinch_room(tips.x, tips.y, tips.yaw, tips.z, radius + OPEN + TIP_RADIUS)
    return radius + OPEN - min(0.0025, max(0.0, _ENOUGH_ROOM / 2.0 - room))


def tips_for(x: float, y: float, yaw: float, forward: tuple[float, float]) -> tuple[float, float]:
    """Where the fingertips are when a foot that is so far forward of them is at a point, x and y [m]."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    return x - cos * forward[0] + sin * forward[1], y - sin * forward[0] - cos * forward[1]


def held_now(piece: SeenPiece, pose: HandPose) -> Held:
    """How a piece is held by fingertips in a pose."""
    dx, dy = piece.x - pose.x, piece.y - pose.y
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    return Held(piece.name, piece.shape, pose.z - piece.z, (cos * dx + sin * dy, -sin * dx + cos * dy))
