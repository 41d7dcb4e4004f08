"""Pieces that the pads hold by their edges, as they stand too far aside for the grooves to draw them in."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from app import UserError
from app.pieces.inventory import Transfer
from hardware.parameters import Pads
from hardware.piece_set import PIECE_SHAPES, Kind
from hardware.table import TableSettings

DRAWN_IN: Final = 0.0018
"""What stands so far beside the middle slides into the grooves as the fingers close, at any friction we know [m]."""


def aside(kind: Kind, pads: Pads, finger_position: float) -> float:
    """How far beside the tool, across the fingers, a stem stands that the pads hold by their outer edges [m].

    Too far out the groove does not draw it in: an edge presses obliquely, and friction holds what stands there. The
    edge lies ``half_width`` beside the middle and the fingers' position from it, on the stem's circle.
    """
    radius = PIECE_SHAPES[kind].stem_radius
    return pads.half_width - math.sqrt(max(0.0, radius**2 - finger_position**2))


def either_side(transfer: Transfer, finger: float, pads: Pads, table: TableSettings) -> list[Transfer]:
    """A transfer whose piece the pads' edges hold at a position of the fingers [m], taken further to one side and to
    the other: across the fingers, along z₂.

    By no more than it has to be: on the wrong side they close further still from its middle, and hold it by their edges
    again; from 5.5 mm aside on they squeeze it away there. Of what is wider than its stem nothing is known: none.
    """
    if finger > PIECE_SHAPES[transfer.kind].stem_radius:
        return []
    x, y, z = table.base_from_board(np.array([*transfer.grasped_at(table), 0.0])).tolist()
    off = aside(transfer.kind, pads, finger) - DRAWN_IN
    places = [table.board_from_base(np.array([x, y + way, z])).tolist() for way in (off, -off)]
    return [replace(transfer, seen=(place[0], place[1])) for place in places]


class UntriedSides:
    """Of one job's transfers, numbered from 0: which sides are left to try. No pad feels on which a piece stands.

    Args:
        pads: of the fingers.
        table: that the pieces stand on.
    """

    def __init__(self, pads: Pads, table: TableSettings) -> None:
        self._pads, self._table = pads, table
        self._left = dict[int, list[Transfer]]()
        self._first = dict[int, UserError]()

    def note(self, index: int, transfer: Transfer, finger: float, held: UserError) -> None:
        """The edges held a transfer's piece, at a position of the fingers [m]; its sides are those of where it was
        first taken to stand.
        """
        if index not in self._first:
            self._first[index] = held
            self._left[index] = either_side(transfer, finger, self._pads, self._table)

    def knows(self, index: int) -> bool:
        """Whether a transfer's piece was held so."""
        return index in self._first

    def next(self, index: int) -> Transfer | None:
        """A transfer as it is tried next; None: neither side is left, or its piece was never held so."""
        left = self._left.get(index)
        return left.pop(0) if left else None

    def cause(self, index: int, failure: UserError) -> UserError:
        """Why a transfer's piece is not grasped: what was felt first says it, and not what followed from it."""
        return self._first.get(index, failure)
