"""What stands in the tool's way: how high to pass, and whether the open fingers fit."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from hardware.parameters import Pads
from hardware.table import PIECE_SHAPES, Kind, Place, TableSettings


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


def tallest_on_way(
    start: tuple[float, float], end: tuple[float, float], others: Iterable[Standing], corridor: float
) -> float:
    """Height of the tallest piece within ``corridor`` of the straight way between two points of the board [m]."""
    return max(
        (
            PIECE_SHAPES[piece.kind].height
            for piece in others
            if _distance_to_segment((piece.x, piece.y), start, end) < corridor
        ),
        default=0.0,
    )


def _distance_to_segment(point: tuple[float, float], start: tuple[float, float], end: tuple[float, float]) -> float:
    dx, dy = end[0] - start[0], end[1] - start[1]
    squared = dx * dx + dy * dy
    along = ((point[0] - start[0]) * dx + (point[1] - start[1]) * dy) / squared if squared > 0.0 else 0.0
    along = min(1.0, max(0.0, along))
    return math.hypot(point[0] - start[0] - along * dx, point[1] - start[1] - along * dy)


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
    depth = pads.half_width * math.tan(pads.groove_angle)
    outer = finger_position + depth + pads.back
    half_width = pads.half_width + pads.back
    for piece in others:
        shape = PIECE_SHAPES[piece.kind]
        radius = shape.foot_radius if tip_height < shape.foot_height else shape.stem_radius
        if tip_height < shape.height and abs(piece.x - x) < outer + radius and abs(piece.y - y) < half_width + radius:
            return piece
    return None
