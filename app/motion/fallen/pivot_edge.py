"""The pivot edge of a piece that lies, and the way of the closed fingers that draw it over; pure geometry.

Frame ``over``: along the board outwards, away from the head, from the middle of the foot's underside as seen from
above; and up from the board [m]. The piece rests on the inner rim of its foot and on its head, which is thinner: it
leans by a few degrees, until it is pressed flat.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from app.motion.path import Vector
from app.motion.timing.reference import eased
from hardware.frozen import FrozenFinite
from hardware.parameters import Pads
from hardware.piece_set import PieceShape

_BAR: Final = 0.006
"""Half the width of a finger's bar, across the finger axis [m]; its other sides are the pad's."""
_SLIDES: Final = 0.0055
"""So far does the foot slide back towards the head while it is pressed and drawn over (measured in the world) [m]."""
_SAMPLES: Final = 16
"""Of a way that is checked."""
MASS_HEIGHT: Final = 0.38
"""Of a piece's centre of mass, in heights of the piece: it is weighted low."""


class PivotSettings(FrozenFinite):
    """How a lying piece is drawn over its pivot edge. Tried in the world: see docs/fallen.md."""

    rim: PositiveFloat = 0.9
    """How far the foot's rim is from the axis where it rests, in radii of the foot: profiles are rounded there."""
    inside: PositiveFloat = 0.0035
    """The fingers' edge comes down so far inside of the foot's underside [m]: it may err by as much."""
    press: PositiveFloat = 2.0
    """The fingers press so hard before they move [N] …"""
    press_more: NonNegativeFloat = 4.0
    """… and by so much more two thirds of the way round, where an error of the place takes the most of it [N]."""
    frequency: PositiveFloat = 35.0
    """Of the tool's height while it presses: a force is a way [rad/s]."""
    beyond: PositiveFloat = 0.20
    """The fingers go round the rim until the centre of mass is so far beyond it [rad]."""
    lowest: PositiveFloat = 0.004
    """No lower are the tips told to go [m]."""
    away: PositiveFloat = 0.014
    """Then they go outwards by so much, so that the piece can fall onto its foot [m]."""
    rise: PositiveFloat = 0.005
    """… and up by so much [m]."""
    pressing_time: PositiveFloat = 0.25
    turning_time: PositiveFloat = 1.0
    leaving_time: PositiveFloat = 0.35
    settling_time: PositiveFloat = Field(default=0.25)
    """[s], each: for the press, the circle, the way outwards, and until the piece stands still."""
    margin: PositiveFloat = 0.002
    """What stands stays so far from all that moves [m]."""
    wall_margin: PositiveFloat = 0.001
    """… and walls, which do not fall [m]."""


@dataclass(frozen=True, slots=True)
class PivotEdge:
    """Where a lying piece's pivot edge is, frame ``over``."""

    rim: float
    """Outwards to the rim on which the piece turns [m]."""
    contact: tuple[float, float]
    """Where the fingers press, (2,) [m]."""
    turn: float
    """By how much they go round the rim [rad]."""
    stands: float
    """Outwards to the middle of the foot once the piece stands [m]."""


def pivot_of(shape: PieceShape, how: PivotSettings) -> PivotEdge:
    """Of a kind of piece."""
    radius = how.rim * shape.foot_radius
    lean = math.atan2(radius - shape.stem_radius, shape.height - shape.stem_radius - shape.foot_height)
    sin, cos = math.sin(lean), math.cos(lean)
    rim = radius * sin
    contact = -radius * sin - how.inside * cos, 2.0 * radius * cos + (shape.foot_height - how.inside) * sin
    over = math.atan2(MASS_HEIGHT * shape.height, radius)
    return PivotEdge(rim, contact, over + how.beyond, rim + radius - _SLIDES)


def reach(pads: Pads, direction: Vector) -> float:
    """How far the closed fingers reach from the tool's centre towards a direction of the board, (2,) [m]."""
    return float((footprint(pads) @ direction).max())


def footprint(pads: Pads) -> Vector:
    """Corners of the closed fingers, seen from above, from the tool's centre, (n, 2) [m]."""
    depth = pads.half_width * math.tan(pads.groove_angle)
    face = math.hypot(depth, pads.half_width)
    behind = pads.back / face * np.array([pads.half_width, depth])
    quarter = np.array([
        np.array([0.0, pads.half_width]) + behind, np.array([depth, 0.0]) + behind, [depth + pads.back, _BAR],
    ])  # fmt: skip
    return np.concatenate([quarter * sign for sign in ([1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0])])


def sweep(pivot: PivotEdge, how: PivotSettings) -> list[tuple[float, float]]:
    """Where the fingers' inner lower edge comes by, frame ``over``: outwards and up [m]."""
    across, up = pivot.contact[0] - pivot.rim, pivot.contact[1]
    radius, begin = math.hypot(across, up), math.atan2(up, across)
    angles = begin - pivot.turn * np.linspace(0.0, 1.0, _SAMPLES)
    way = [(pivot.rim + radius * math.cos(a), max(how.lowest, radius * math.sin(a))) for a in angles.tolist()]
    return [*way, (way[-1][0] + how.away, way[-1][1])]


def circle(pivot: PivotEdge, how: PivotSettings, stiffness: float, ticks: int, tick: float) -> Vector:
    """The way round the rim, from rest to rest in some ticks: the fingers' inner lower edge in frame ``over``.

    Outwards and up, each with velocity and acceleration, at 1, 2, … ticks: (ticks, 2, 3) [m, m/s, m/s²]. Heights are
    those of the pivot edge, lowered by what presses on the tool's ``stiffness`` in height [N/m].
    """
    share = eased(ticks, tick)
    across, up = pivot.contact[0] - pivot.rim, pivot.contact[1]
    radius, begin = math.hypot(across, up), math.atan2(up, across)
    angle, rate, change = begin - pivot.turn * share[:, 0], -pivot.turn * share[:, 1], -pivot.turn * share[:, 2]
    sin, cos = np.sin(angle), np.cos(angle)
    way = np.empty((ticks, 2, 3))
    way[:, 0] = np.stack([pivot.rim + radius * cos, -radius * sin * rate, -radius * (cos * rate**2 + sin * change)], 1)
    way[:, 1] = np.stack([radius * sin, radius * cos * rate, -radius * (sin * rate**2 - cos * change)], 1)
    way[:, 1] -= _pressed(share, how, float(way[-1, 1, 0]), stiffness)
    return way


def _pressed(share: Vector, how: PivotSettings, end: float, stiffness: float) -> Vector:
    """By how much the way is lower than the pivot edge, (n, 3) [m, m/s, m/s²]: it would end at a height ``end`` [m].

    The most is at two thirds of the way, where an error of where the rim is takes the most of it; in the end as much
    as leaves the tips above the board.
    """
    q, rate, change = share.T
    most, pressed = how.press_more / stiffness, how.press / stiffness
    last = min(most, end - pressed - how.lowest)
    a, b = 6.75 * most, last  # 6.75 q² (1 - q) is 1 at its peak
    value = a * q**2 * (1.0 - q) + b * q**2
    slope, bend = a * (2.0 * q - 3.0 * q**2) + 2.0 * b * q, a * (2.0 - 6.0 * q) + 2.0 * b
    return np.stack([pressed + value, slope * rate, bend * rate**2 + slope * change], axis=1)
