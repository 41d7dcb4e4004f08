"""Pieces that are let go in the air, over a box: from how high, and how long they take to leave the fingers."""

from __future__ import annotations

import math
from typing import Final

from app.motion.settings import MotionSettings
from hardware.parameters import Pads
from hardware.table import PIECE_SHAPES, Kind, Place, TableSettings

GRAVITY: Final = 9.81
"""[m/s²]"""


def tool_height(kind: Kind, place: Place, table: TableSettings, settings: MotionSettings) -> float:
    """Height of the tool over the board when it takes a piece from a place, or lets go of it there [m].

    Over a box the foot stays clear of whatever may lie in it, so that nothing of the arm is ever between the walls.
    """
    height = PIECE_SHAPES[kind].grip_height
    return height + table.box_fill + settings.clearance if place.in_box else height


def fall_time(kind: Kind, pads: Pads) -> float:
    """From let go until all of a piece has fallen out of the fingers: s = g t² / 2 [s]."""
    shape = PIECE_SHAPES[kind]
    return math.sqrt(2.0 * (shape.height - shape.grip_height + pads.half_height) / GRAVITY)
