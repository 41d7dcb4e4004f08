"""Which corner is a1, told from the pieces.

A piece is seen as the middle of a square that differs from the square's own corners, and white from black as the
lighter from the darker of the two sides, relative to their squares: no colour is known beforehand, and light that falls
off across the board does not count.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import chess
import numpy as np
from numpy.typing import ArrayLike

from vision.arrays import Array, Picture
from vision.board.alternation import sample
from vision.board.grid import CORNERS
from vision.board.lattice import fit_homography, project

LUMA: Final = np.array([0.299, 0.587, 0.114])  # how much red, green and blue count for lightness (ITU-R BT.601)
LEAST_AGREEMENT: Final = 0.85  # share of squares that must be occupied or empty as in the placement
LEAST_MARGIN: Final = 4.0  # how much better the best turn must fit than any other [standard errors]


@dataclass(frozen=True, slots=True, eq=False)
class Orientation:
    """How a board lies."""

    corners: Array  # outer corners a1, h1, h8, a8, shape (4, 2) [px]
    sure: bool  # False where the pieces do not tell; the corners are then as they were given


def orient(colour: Picture, corners: ArrayLike, placement: chess.BaseBoard | None = None) -> Orientation:
    """Turn the outer corners of a board, counter-clockwise (4, 2) [px], until its pieces stand where they should.

    All four turns are tried: people do lay boards with a light a1. ``placement`` is what stands on the board; None: the
    start position.
    """
    given = np.asarray(corners, dtype=float)
    board = chess.BaseBoard() if placement is None else placement
    expected = _expected(board)
    relief, lightness = _squares(colour, given)
    turned = [(np.rot90(relief, -turn), np.rot90(lightness, -turn)) for turn in range(4)]
    fits = np.array([_fit(one, light, expected) for one, light in turned])
    best = int(fits.argmax())
    margin = float(fits[best] - np.max(np.delete(fits, best)))
    sure = margin > LEAST_MARGIN and _agreement(turned[best][0], expected) > LEAST_AGREEMENT
    return Orientation(np.roll(given, -best, axis=0) if sure else given, sure)


def _expected(board: chess.BaseBoard) -> Array:
    """1 for white, -1 for black, 0 for empty, shape (8, 8): [file, rank]."""
    result = np.zeros((8, 8))
    for square, piece in board.piece_map().items():
        result[chess.square_file(square), chess.square_rank(square)] = 1.0 if piece.color else -1.0
    return result


def _squares(colour: Picture, corners: Array) -> tuple[Array, Array]:
    """How much the middle of each square differs from its corners, and how much lighter it is, each shape (8, 8)."""
    homography = fit_homography(CORNERS, corners)
    step = np.linspace(0.06, 0.94, 23)
    spot = np.stack(np.meshgrid(step, step, indexing="ij"), axis=-1)
    i, j = np.meshgrid(np.arange(8.0), np.arange(8.0), indexing="ij")
    places = np.stack([i, j], axis=-1)[:, :, None, None] + spot
    values = sample(colour, project(homography, places))
    light = np.log1p(values @ LUMA / 20.0)
    values = np.log1p(values / 20.0)
    radius = np.hypot(spot[..., 0] - 0.5, spot[..., 1] - 0.5)
    middle, outer = radius < 0.3, (np.abs(spot - 0.5) > 0.3).all(axis=-1)
    ground = np.nanmedian(values[:, :, outer], axis=2)
    difference = values[:, :, middle] - ground[:, :, None]
    relief = np.nanmean(np.abs(difference).max(axis=-1), axis=2)
    lightness = np.nanmean(light[:, :, middle], axis=2) - np.nanmedian(light[:, :, outer], axis=2)
    return np.nan_to_num(relief), np.nan_to_num(lightness)


def _fit(relief: Array, lightness: Array, expected: Array) -> float:
    """How well occupied squares stand out and white is lighter than black [standard errors]."""
    occupied = expected != 0.0
    result = 0.0
    for one, other, values in ((occupied, ~occupied, np.sqrt(relief)), (expected > 0.0, expected < 0.0, lightness)):
        if one.sum() >= 2 and other.sum() >= 2:
            a, b = values[one], values[other]
            spread = np.sqrt(a.var(ddof=1) / len(a) + b.var(ddof=1) / len(b))
            result += float((a.mean() - b.mean()) / max(spread, 1e-6))
    return result


def _agreement(relief: Array, expected: Array) -> float:
    """Share of squares on the right side of the threshold that parts occupied from empty ones best."""
    occupied = expected != 0.0
    if occupied.all() or not occupied.any():
        return 0.0
    thresholds = np.unique(relief)
    return float(max(((relief > one) == occupied).mean() for one in thresholds))
