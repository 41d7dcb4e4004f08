"""Where pieces and board of a simulated world really stand."""

import math
from dataclasses import dataclass
from typing import Final

from hardware.table import PieceSpec

FOOT_SIDE: Final = 0.85
"""Half a side of the square that stands for a foot, in radii of the foot: it tips over as late as the round one on
average. A cylinder's points of contact wander around its rim, and a piece that rocks on them never comes to rest."""


@dataclass(frozen=True, slots=True)
class StandingPiece:
    """One piece as it is put down before the start: its spec and exact pose in the board frame [m, rad]."""

    spec: PieceSpec
    """Name, kind, colour, place."""
    x: float
    """Of its centre."""
    y: float
    """Of its centre."""
    yaw: float = 0.0
    """About its axis."""
    height: float = 0.0
    """Of what it stands on, above the board."""
    mass: float = 1.0
    """In masses of its kind."""
    friction: float = 1.0
    """In frictions of its felt and its stem."""
    tip: float = 0.0
    """By how much it leans, about its own x axis, before it is turned; at π/2 it lies [rad]."""


@dataclass(frozen=True, slots=True)
class BoardOffset:
    """Where the table really stands: the true board's pose in the frame of the board as the robot believes it to be."""

    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Of its centre [m]."""
    turn: float = 0.0
    """About the vertical [rad]."""

    def in_true(self, point: tuple[float, float, float]) -> tuple[float, float, float]:
        """A point of the believed board frame in the true one [m]."""
        x, y, z = (a - b for a, b in zip(point, self.shift, strict=True))
        cos, sin = math.cos(self.turn), math.sin(self.turn)
        return cos * x + sin * y, cos * y - sin * x, z


AS_BELIEVED = BoardOffset()
