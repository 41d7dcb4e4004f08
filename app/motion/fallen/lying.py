"""Pieces that lie, as plans need them: where each is, what of the table it covers, and strips to keep free.

Which way a piece lies is known in plan alone: it rests on the rim of its foot and on its head.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from app.motion.obstacles import Crowd, Obstacle
from app.motion.path import Vector
from hardware.piece_set import PIECE_SHAPES, Kind, piece_profile
from hardware.table import TableSettings, square_place

_DISCS: Final = 6
"""A piece that lies is kept clear of as so many discs along its axis."""


@dataclass(frozen=True, slots=True)
class Lying:
    """A piece that lies."""

    kind: Kind
    """Its shape."""
    base: tuple[float, float]
    """Middle of its foot's underside, seen from above, board frame (x, y) [m]."""
    yaw: float
    """From the base to the head, from the x axis, counter-clockwise [rad]."""
    name: str = ""
    """Of the piece, for people."""

    @property
    def called(self) -> str:
        """For sentences."""
        return self.name or f"lying {self.kind}"

    @property
    def outwards(self) -> Vector:
        """Away from the head along the board, unit vector (2,)."""
        return -np.array([math.cos(self.yaw), math.sin(self.yaw)])

    @property
    def head(self) -> tuple[float, float]:
        """Its top, seen from above, board frame (x, y) [m]."""
        return self.along(PIECE_SHAPES[self.kind].height)

    def along(self, way: float) -> tuple[float, float]:
        """The point of its axis so far from its base [m], seen from above, board frame (x, y) [m]."""
        x, y = (np.array(self.base) - way * self.outwards).tolist()
        return x, y


class LoosePieces(NamedTuple):
    """Pieces that are not where an inventory has them: those that stand, and those that lie."""

    standing: tuple[Obstacle, ...] = ()
    lying: tuple[Lying, ...] = ()


NO_LOOSE_PIECES: Final = LoosePieces()


def standing_near(crowd: Iterable[Obstacle], lying: Iterable[Lying], table: TableSettings) -> Crowd:
    """What is in the way: pieces that stand, where they do, and others that lie, which count as rows of low discs."""
    stands = Crowd.of(crowd, table)
    rows, pieces = [stands.table], list(stands.pieces)
    for piece in lying:
        for way, radius, top in discs_of(piece.kind):
            x, y = piece.along(way)
            rows.append(np.array([[x, y, top, radius, radius, top]]))
            pieces.append(Obstacle(piece.called, square_place(_square(x, y, table)), x, y, piece.kind))
    return Crowd(tuple(pieces), np.concatenate(rows), stands.boxes)


def crowd_of(scene: LoosePieces, table: TableSettings, without: str = "") -> Crowd:
    """All of a scene, but for one piece, as `standing_near`."""
    standing = (piece for piece in scene.standing if piece.name != without)
    return standing_near(standing, (piece for piece in scene.lying if piece.name != without), table)


@lru_cache(maxsize=16)
def discs_of(kind: Kind) -> tuple[tuple[float, float, float], ...]:
    """A piece that rests on the rim of its foot and on its head: of parts along it the middle's distance from the base,
    the largest radius, and how high it reaches [m].
    """
    shape = PIECE_SHAPES[kind]
    fine = np.linspace(0.0, shape.height, 10 * _DISCS + 1)
    radius = radii(kind, fine)
    axis = np.interp(fine, (0.0, shape.height), (shape.foot_radius, shape.stem_radius))
    discs = []
    for part in np.array_split(np.arange(fine.size), _DISCS):
        largest, top = float(radius[part].max()), float((axis[part] + radius[part]).max())
        discs.append((float(fine[part].mean()), largest, top))
    return tuple(discs)


def radii(kind: Kind, heights: Vector) -> Vector:
    """Of a piece at heights above the board [m]."""
    profile = np.array(piece_profile(kind))
    radius: Vector = np.interp(heights, profile[:, 1], profile[:, 0])
    # a knight's head is no part of its profile
    return np.maximum(radius, PIECE_SHAPES[kind].stem_radius) if kind is Kind.KNIGHT else radius


def _square(x: float, y: float, table: TableSettings) -> int:
    """The nearest one."""
    column, row = (min(7, max(0, math.floor(at / table.square + 4.0))) for at in (x, y))
    return column + 8 * row


class Strip(NamedTuple):
    """A rectangle over the table: the middle of one short side, board frame [m]; unit vector along; length, half
    width, the height from which on the room over it is needed, and by how much more on all sides, rounded [m].
    """

    start: tuple[float, float]
    along: Vector
    length: float
    half_width: float
    above: float = 0.0
    around: float = 0.0

    def distance(self, x: float, y: float) -> float:
        """From a point [m]; 0 inside."""
        dx, dy = x - self.start[0], y - self.start[1]
        forward = dx * self.along[0] + dy * self.along[1]
        aside = abs(dy * self.along[0] - dx * self.along[1])
        off = math.hypot(max(-forward, forward - self.length, 0.0), max(aside - self.half_width, 0.0))
        return float(max(0.0, off - self.around))


def _room(strip: Strip, row: Sequence[float]) -> float:
    """Between a strip and one of a crowd [m]; above its foot, a piece is slim."""
    x, y, height, foot, stem, foot_height = row
    if strip.above >= height:
        return math.inf
    return strip.distance(x, y) - (foot if strip.above < foot_height else stem)


def meets_box(strip: Strip, others: Crowd, margin: float) -> bool:
    """Whether a strip comes nearer than a margin to a box [m]: as no axis of either parts them."""
    across = np.array([-strip.along[1], strip.along[0]])
    middle = np.array(strip.start) + 0.5 * strip.length * strip.along
    for x, y, half_x, half_y, _ in others.boxes.tolist():
        axes = np.array([[1.0, 0.0], [0.0, 1.0], strip.along, across])
        apart = np.abs(axes @ (middle - (x, y)))
        strips = np.abs(axes @ strip.along) * 0.5 * strip.length + np.abs(axes @ across) * strip.half_width
        boxes = np.abs(axes) @ np.array([half_x, half_y])
        if (apart < strips + boxes + strip.around + margin).all():
            return True
    return False


def in_the_strip(strips: Sequence[Strip], others: Crowd, margin: float) -> Obstacle | None:
    """The piece that is nearest to these strips, if it is nearer than a margin [m]; None: they are free."""
    found, nearest = None, margin
    for piece, row in zip(others.pieces, others.table.tolist(), strict=True):
        distance = min(_room(strip, row) for strip in strips)
        if distance < nearest:
            found, nearest = piece, distance
    return found
