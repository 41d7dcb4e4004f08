"""The table as solids, board frame: squares, and pieces as turned shapes that stand or are held."""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from typing import Final

import numpy as np

from app.scene.solids import Cuboid, Finish, RoundBar
from hardware.piece_set import PIECE_SHAPES, Colour, Kind, piece_profile
from hardware.table import TableSettings, square_place

BOARD_THICKNESS: Final = 0.012
"""Assumed: of the board and of the table beside it, for the eye alone [m]."""
PLACE_RADIUS: Final = 0.0135
"""Of the round mark of a place on a tray, as the page draws it [m]."""
COARSE: Final = 0.0012
"""A piece's outline may be off by so much where it is drawn with few frusta [m]."""

Outline = tuple[tuple[float, float], ...]
"""Radius and height above the board, from the foot up [m]."""


def board_solids(table: TableSettings) -> tuple[Cuboid, ...]:
    """The board, square by square from a1 to h8, and the table that it lies on; its surface is z = 0."""
    side = table.square
    squares = []
    for square in range(64):
        x, y = table.xy(square_place(square))
        light = (square // 8 + square % 8) % 2 == 1
        finish = Finish.LIGHT_SQUARE if light else Finish.DARK_SQUARE
        squares.append(Cuboid((x, y, -0.5 * BOARD_THICKNESS), (side, side, BOARD_THICKNESS), finish))
    width, depth = 2.0 * table.half_width, 2.0 * max(table.half_play[1] + 0.5 * side, 4.0 * side)
    beneath = Cuboid((0.0, 0.0, -1.5 * BOARD_THICKNESS), (width, depth, BOARD_THICKNESS), Finish.WOOD)
    return (*squares, beneath)


@cache
def piece_outline(kind: Kind, tolerance: float = COARSE) -> Outline:
    """The outline of a turned piece with as few corners as are needed to stay within a tolerance [m] of it.

    The knight, whose head is not turned, is drawn up to its height with a cone.
    """
    profile = piece_profile(kind)
    top = PIECE_SHAPES[kind].height
    if max(height for _, height in profile) < top - tolerance:
        profile = (*profile[:-1], (0.0, top))
    return _thinned(profile, tolerance)


def piece_solids(kind: Kind, colour: Colour, above: float = 0.0) -> tuple[RoundBar, ...]:
    """A piece that stands at the origin, z up; ``above``: its foot is so much higher [m]."""
    finish = Finish.WHITE_PIECE if colour is Colour.WHITE else Finish.BLACK_PIECE
    outline = piece_outline(kind)
    return tuple(
        RoundBar((0.0, 0.0, above + low), (0.0, 0.0, above + high), radius, finish, end_radius)
        for (radius, low), (end_radius, high) in pairwise(outline)
        if high > low
    )


def _thinned(outline: Outline, tolerance: float) -> Outline:
    """Ramer's and Douglas's and Peucker's: the ends, and between them the farthest corner while it is too far off."""
    if len(outline) < 3:
        return outline
    points = np.array(outline)
    start, way = points[0], points[-1] - points[0]
    length = float(np.hypot(*way))
    aside = points[1:-1] - start
    if length == 0.0:
        off = np.hypot(aside[:, 0], aside[:, 1])
    else:
        off = np.abs(aside[:, 0] * way[1] - aside[:, 1] * way[0]) / length
    farthest = int(off.argmax())
    if off[farthest] <= tolerance:
        return outline[0], outline[-1]
    cut = farthest + 1
    return (*_thinned(outline[: cut + 1], tolerance)[:-1], *_thinned(outline[cut:], tolerance))
