"""What is in the tool's way: how high to pass over pieces and boxes, and whether the open fingers fit."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from app.motion.path import Vector
from app.pieces.inventory import Inventory, Transfer
from controller.model.compiled import PAIR, ROW, SCALAR, STATUS, TABLE, FloatArray, compiled_as
from hardware.parameters import Pads
from hardware.piece_set import PIECE_SHAPES, Kind, PieceShape
from hardware.table import Place, TableSettings


class Obstacle(NamedTuple):
    """A piece on the table: its name, its place, its centre in the board frame [m] and its kind."""

    name: str
    place: Place
    x: float
    y: float
    kind: Kind

    @classmethod
    def at(cls, name: str, place: Place, kind: Kind, table: TableSettings) -> Obstacle:
        """At the centre of its place."""
        return cls(name, place, *table.xy(place), kind)


_SHAPES: Final = {
    kind: (shape.height, shape.foot_radius, shape.stem_radius, shape.foot_height)
    for kind, shape in PIECE_SHAPES.items()
}


_NO_BOXES: Final = np.zeros((0, 5))


def _boxes(table: TableSettings | None) -> Vector:
    if table is None:
        return _NO_BOXES
    rows = [
        (box.x, box.y, box.half_x + box.wall, box.half_y + box.wall, max(table.box_fill, box.height))
        for box in table.boxes()
    ]
    return np.array(rows, dtype=float).reshape((len(rows), 5))


@dataclass(frozen=True, slots=True)
class Crowd:
    """Pieces that stand, and boxes."""

    pieces: tuple[Obstacle, ...]
    table: Vector
    """Of each x and y of its centre, height, foot's radius, stem's radius, foot's height, (n, 6) [m]."""
    boxes: Vector
    """Of each x and y of its centre, half its extent along x and y with its walls, and how high up it or what lies in
    it reaches, (m, 5) [m]."""

    @classmethod
    def of(cls, pieces: Iterable[Obstacle], table: TableSettings | None = None) -> Crowd:
        """Of pieces, and of a table's boxes."""
        pieces = tuple(pieces)
        rows = [(piece.x, piece.y, *_SHAPES[piece.kind]) for piece in pieces]
        return cls(pieces, np.array(rows, dtype=float).reshape((len(rows), 6)), _boxes(table))

    @classmethod
    def before(cls, transfers: Sequence[Transfer], inventory: Inventory) -> Crowd:
        """What stands on the table before transfers: at the centres of places, or where those say it was seen."""
        table, seen = inventory.table, dict[str, tuple[float, float]]()
        for transfer in reversed(transfers):  # of a piece that is carried twice, the first time counts
            seen[transfer.name] = transfer.grasped_at(table)
        standing = (piece for piece in inventory if not piece.place.in_box)
        return cls.of(
            (Obstacle(p.name, p.place, *seen.get(p.name, table.xy(p.place)), p.kind) for p in standing), table
        )

    def without(self, name: str) -> Crowd:
        """But for one."""
        left = tuple(piece for piece in self.pieces if piece.name != name)
        if len(left) == len(self.pieces):
            return self
        i = self._index(name)
        return Crowd(left, np.concatenate([self.table[:i], self.table[i + 1 :]]), self.boxes)

    def with_moved(self, moved: Obstacle) -> Crowd:
        """With the piece of that name there."""
        i, pieces, table = self._index(moved.name), list(self.pieces), np.array(self.table)
        pieces[i], table[i, 0:2] = moved, (moved.x, moved.y)
        return Crowd(tuple(pieces), table, self.boxes)

    def _index(self, name: str) -> int:
        return next(i for i, piece in enumerate(self.pieces) if piece.name == name)


class Moving(NamedTuple):
    """What moves with the tool, seen from above: half the extent of the fingers along x and y, and how far above the
    tool's height minus ``below`` nothing is [m]; and what they carry.
    """

    half_x: float
    half_y: float
    below: float
    carried: PieceShape | None = None

    @classmethod
    def of(cls, pads: Pads, finger_position: float, carried: PieceShape | None = None) -> Moving:
        """Fingers at a position."""
        outer = finger_position + pads.half_width * math.tan(pads.groove_angle) + pads.back
        return cls(outer, pads.half_width + pads.back, pads.half_height, carried)


@compiled_as(ROW(ROW, PAIR, PAIR, TABLE, TABLE, SCALAR, SCALAR, SCALAR, SCALAR, SCALAR, SCALAR, SCALAR))
def _highest_needs(
    share: FloatArray, start: tuple[float, float], end: tuple[float, float], pieces: FloatArray, boxes: FloatArray,
    half_x: float, half_y: float, below: float, foot: float, hangs: float, beside: float, clearance: float,
) -> FloatArray:  # fmt: skip
    """See `needed_heights`; ``foot``: the carried piece's radius, negative: none; it ``hangs`` below the tool [m]."""
    needed = np.zeros(share.size)
    for i in range(share.size):
        x, y = start[0] + share[i] * (end[0] - start[0]), start[1] + share[i] * (end[1] - start[1])
        for j in range(pieces.shape[0]):
            dx, dy = abs(x - pieces[j, 0]), abs(y - pieces[j, 1])
            radius = pieces[j, 3] + beside
            if dx < half_x + radius and dy < half_y + radius:
                needed[i] = max(needed[i], pieces[j, 2] + below + clearance)
            reach = foot + radius
            if foot >= 0.0 and dx * dx + dy * dy < reach * reach:
                needed[i] = max(needed[i], pieces[j, 2] + hangs + clearance)
        for j in range(boxes.shape[0]):
            dx, dy = abs(x - boxes[j, 0]) - boxes[j, 2] - beside, abs(y - boxes[j, 1]) - boxes[j, 3] - beside
            if dx < half_x and dy < half_y:
                needed[i] = max(needed[i], boxes[j, 4] + below + clearance)
            if dx < foot and dy < foot:
                needed[i] = max(needed[i], boxes[j, 4] + hangs + clearance)
    return needed


@compiled_as(STATUS(SCALAR, SCALAR, SCALAR, TABLE, SCALAR, SCALAR))
def _first_touched(x: float, y: float, tip_height: float, pieces: FloatArray, half_x: float, half_y: float) -> int:
    """See `blocking_neighbour`; which one, or -1. Pieces alone: `box_in_the_way` looks at boxes."""
    for j in range(pieces.shape[0]):
        radius = pieces[j, 3] if tip_height < pieces[j, 5] else pieces[j, 4]
        near = abs(pieces[j, 0] - x) < half_x + radius and abs(pieces[j, 1] - y) < half_y + radius
        if near and tip_height < pieces[j, 2]:
            return j
    return -1


def needed_heights(
    share: Vector,
    start: tuple[float, float],
    end: tuple[float, float],
    moving: Moving,
    others: Crowd,
    beside: float,
    clearance: float,
) -> Vector:
    """How high over the board the tool must be, so that what moves passes over what stands there, (n,), 0: nothing does
    [m].

    At shares (n,) of a straight way from one point (x, y) of the board to another [m]; pieces closer than ``beside``
    are passed over with a ``clearance`` [m].
    """
    foot, hangs = -1.0, 0.0
    if moving.carried is not None:
        foot, hangs = moving.carried.foot_radius, moving.carried.grip_height
    return _highest_needs(
        share, start, end, others.table, others.boxes, moving.half_x, moving.half_y, moving.below, foot, hangs, beside,
        clearance,
    )  # fmt: skip


def box_in_the_way(x: float, y: float, finger_position: float, tip_height: float, others: Crowd, pads: Pads) -> bool:
    """Whether open fingers would touch a box, or what may lie in it, on their way down; as `blocking_neighbour`."""
    moving = Moving.of(pads, finger_position)
    away = np.abs(others.boxes[:, 0:2] - (x, y)) - others.boxes[:, 2:4] - (moving.half_x, moving.half_y)
    return bool(np.any((away < 0.0).all(axis=1) & (others.boxes[:, 4] > tip_height)))


def closed_position(kind: Kind, pads: Pads) -> float:
    """Finger position (pad's front edge from the tool centre) when the pads hold a stem [m].

    Faces that lean by β touch a stem of radius r where r / cos β is left from its axis to their apex; flat ones, β = 0,
    at r.
    """
    depth = pads.half_width * math.tan(pads.groove_angle)
    return PIECE_SHAPES[kind].stem_radius / math.cos(pads.groove_angle) - depth


def blocking_neighbour(
    x: float, y: float, finger_position: float, tip_height: float, others: Crowd, pads: Pads
) -> Obstacle | None:
    """The first piece that open fingers around a point of the board would touch on their way down, or None;
    ``tip_height`` is that of their tips above the board at the lowest; all [m].
    """
    moving = Moving.of(pads, finger_position)
    found = _first_touched(x, y, tip_height, others.table, moving.half_x, moving.half_y)
    return None if found < 0 else others.pieces[found]
