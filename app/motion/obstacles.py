"""What stands in the tool's way: how high to pass, and whether the open fingers fit."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from app.motion.path import Vector
from app.motion.sampling import highest_needs
from hardware.parameters import Pads
from hardware.table import PIECE_SHAPES, Kind, PieceShape, Place, TableSettings


@dataclass(frozen=True, slots=True)
class Standing:
    """A piece on the table: its place, centre in the board frame [m] and kind."""

    place: Place
    x: float
    y: float
    kind: Kind


def standing(pieces: Iterable[tuple[Place, Kind]], table: TableSettings) -> tuple[Standing, ...]:
    """Pieces with their nominal centres."""
    return tuple(Standing(place, *table.xy(place), kind) for place, kind in pieces)


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


def needed_heights(
    points: Vector, moving: Moving, others: Sequence[Standing], beside: float, clearance: float
) -> Vector:
    """How high the tool must be over points of the board, so that what moves passes over what stands there.

    Args:
        points: (n, 2), board frame [m].
        moving: fingers and piece.
        others: pieces that stand.
        beside: pieces closer than this are passed over [m].
        clearance: above them [m].

    Returns:
        Heights of the tool over the board, (n,), 0 where nothing stands [m].
    """
    if not others:
        return np.zeros(len(points))
    shapes = [PIECE_SHAPES[piece.kind] for piece in others]
    height = np.array([shape.height for shape in shapes])
    radius = np.array([shape.foot_radius for shape in shapes]) + beside
    reach, foot = np.full(len(others), -1.0), np.zeros(len(others))
    if moving.carried is not None:
        reach, foot = moving.carried.foot_radius + radius, height + moving.carried.grip_height + clearance
    return highest_needs(
        np.ascontiguousarray(points), np.array([(piece.x, piece.y) for piece in others]), moving.half_x + radius,
        moving.half_y + radius, reach, np.concatenate([height + moving.below + clearance, foot]),
    )  # fmt: skip


def closed_position(kind: Kind, pads: Pads) -> float:
    """Finger position (pad's front edge from the tool centre) when the V-grooves hold a stem [m]."""
    depth = pads.half_width * math.tan(pads.groove_angle)
    return PIECE_SHAPES[kind].stem_radius / math.sin(pads.groove_angle) - depth


def blocking_neighbour(
    x: float, y: float, finger_position: float, tip_height: float, others: Iterable[Standing], pads: Pads
) -> Standing | None:
    """The first piece that open fingers would touch on their way down, or None.

    Args:
        x: centre of the grasp, board frame [m].
        y: the same along the ranks [m].
        finger_position: of the open fingers [m].
        tip_height: of the finger tips above the board at the lowest [m].
        others: pieces that stay where they are.
        pads: shape of the fingers.
    """
    moving = Moving.of(pads, finger_position)
    for piece in others:
        shape = PIECE_SHAPES[piece.kind]
        radius = shape.foot_radius if tip_height < shape.foot_height else shape.stem_radius
        near = abs(piece.x - x) < moving.half_x + radius and abs(piece.y - y) < moving.half_y + radius
        if near and tip_height < shape.height:
            return piece
    return None
