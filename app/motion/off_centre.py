"""Pieces that the pads hold by their edges, as they stand too far aside for the grooves to draw them in."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from app.pieces.inventory import Transfer
from hardware.parameters import Pads
from hardware.piece_set import PIECE_SHAPES, Kind
from hardware.table import TableSettings


def aside(kind: Kind, pads: Pads, finger_position: float) -> float:
    """How far beside the tool, across the fingers, a stem stands that the pads hold by their outer edges [m].

    Too far out the groove does not draw it in: an edge presses obliquely, and friction holds what stands there. The
    edge lies ``half_width`` beside the middle and the fingers' position from it, on the stem's circle.
    """
    radius = PIECE_SHAPES[kind].stem_radius
    return pads.half_width - math.sqrt(max(0.0, radius**2 - finger_position**2))


def either_side(transfer: Transfer, finger: float, pads: Pads, table: TableSettings) -> list[Transfer]:
    """A transfer whose piece the pads' edges hold at a position of the fingers [m], once for each side where the piece
    may stand: across the fingers, along z₂.
    """
    x, y, z = table.base_from_board(np.array([*transfer.grasped_at(table), 0.0])).tolist()
    off = aside(transfer.kind, pads, finger)
    places = [table.board_from_base(np.array([x, y + way, z])).tolist() for way in (off, -off)]
    return [replace(transfer, seen=(place[0], place[1])) for place in places]
