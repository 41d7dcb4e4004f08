"""Crossings of a board's lines to a fraction of a pixel.

Around each crossing the picture is sampled in the board's own coordinates, so that a window covers the same part of a
square near and far. The crossing is where the lines through all samples along their edges meet best (Förstner and
Gülch, 1987), which holds for crossings within the board as for the T where a line meets the border.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from vision.arrays import Array, Mask
from vision.board.alternation import Look
from vision.board.grid import CORNERS, Grid, fit_grid

HALF_WINDOW: Final = 0.24
"""Half of the window around a crossing [sides of a square]; pieces that stand in the middle begin at about 0.3."""
WINDOW: Final = 17  # samples along a side of the window; odd
ROUNDS: Final = 4  # how often the window is moved onto the crossing
LEAST_LIKENESS: Final = 0.75  # correlation of the window with four squares that meet
FURTHEST: Final = 0.2  # a crossing that moves further than this is another feature [sides of a square]
BORDER_WEIGHT: Final = 0.1
"""Weight across the border of crossings on it: frames and inlays have lines of their own, up to 0.1 squares outside."""
PLACES: Final = np.stack(np.meshgrid(np.arange(9.0), np.arange(9.0), indexing="ij"), axis=-1).reshape(-1, 2)
"""All crossings of a board's lines and its border, shape (81, 2)."""
FINEST, COARSEST = 18.0, 44.0
"""Squares of this side are measured best [px]: below, pixels are too few; above, grain and blur are seen."""


@dataclass(frozen=True, slots=True, eq=False)
class Crossings:
    """Crossings that were seen."""

    places: Array  # shape (n, 2)
    found: Array  # where they are, as places by the grid they were looked for with, shape (n, 2)
    border: Mask  # whether each lies on the border, shape (n,)


def refine_grid(look: Look, grid: Grid, dark: int) -> Grid | None:
    """Fit a grid that is right to a fifth of a square to all crossings that can be seen; None if they are too few.

    ``dark`` is 1 where the square of a1 is dark, -1 where it is light.
    """
    for _ in range(2):
        seen = find_crossings(look, grid, dark)
        if np.count_nonzero(~seen.border) < 12:
            return None
        points = grid.project(seen.found)
        weight = np.where((seen.places == 0.0) | (seen.places == 8.0), BORDER_WEIGHT, 1.0)
        grid = fit_grid(seen.places, points, grid.size, scatter=0.01, weights=weight)
    return grid


def working_scale(grid: Grid) -> float:
    """Factor by which a picture is best resized before its crossings are refined."""
    side = float(np.median(grid.sides(np.concatenate([CORNERS, [[4.0, 4.0]]]))))
    if side > COARSEST:
        return COARSEST / side
    return min(2.0, FINEST / side) if side < FINEST else 1.0


def find_crossings(look: Look, grid: Grid, dark: int) -> Crossings:
    """Where the lines of a grid, which is right to a fifth of a square, cross in the picture, as far as that can be
    seen.

    ``dark`` is as of ``refine_grid``.
    """
    window, found = window_places(WINDOW), PLACES.copy()
    alive = np.ones(len(PLACES), dtype=bool)
    for _ in range(ROUNDS):
        values = look(grid.project(found[:, None, None] + window))
        alive &= np.isfinite(values).all(axis=(1, 2))
        found = found + np.clip(_crossing_of_edges(np.nan_to_num(values), window), -0.1, 0.1)
        alive &= np.abs(found - PLACES).max(axis=1) < FURTHEST
        found = np.where(alive[:, None], found, PLACES)
    values = np.nan_to_num(look(grid.project(found[:, None, None] + window)))
    likeness = _likeness(values, window, np.zeros_like(PLACES), dark)
    return _select(found, alive & (likeness > LEAST_LIKENESS))


def crossings_in(values: Array, dark: int) -> Crossings:
    """Crossings in windows of lightness (81, m, m) that were looked up at ``PLACES`` and ``window_places(m)``: at once.

    Less exact than ``find_crossings`` where a crossing is far from the middle of its window.
    """
    window = window_places(values.shape[1])
    safe = np.nan_to_num(values)
    shift = _crossing_of_edges(safe, window)
    alive = np.isfinite(values).all(axis=(1, 2)) & (np.abs(shift).max(axis=1) < FURTHEST)
    shift = np.where(alive[:, None], shift, 0.0)
    likeness = _likeness(safe, window, shift, dark)
    return _select(PLACES + shift, alive & (likeness > LEAST_LIKENESS))


def window_places(samples: int) -> Array:
    """Where a window is looked at, from its middle, shape (samples, samples, 2) [sides of a square]."""
    step = np.linspace(-HALF_WINDOW, HALF_WINDOW, samples)
    return np.stack(np.meshgrid(step, step, indexing="ij"), axis=-1)


def _select(found: Array, kept: Mask) -> Crossings:
    border = ((PLACES == 0.0) | (PLACES == 8.0)).any(axis=1)
    return Crossings(PLACES[kept], found[kept], border[kept])


def _crossing_of_edges(values: Array, window: Array) -> Array:
    """Where edges in windows (n, m, m) meet, from the middle, shape (n, 2) [sides of a square]."""
    du, dv = np.gradient(values, window[1, 0, 0] - window[0, 0, 0], axis=(1, 2))
    reach = np.exp(-0.5 * (window**2).sum(axis=-1) / (0.6 * HALF_WINDOW) ** 2)
    uu, uv, vv = ((reach * one).sum(axis=(1, 2)) for one in (du * du, du * dv, dv * dv))
    along = du * window[..., 0] + dv * window[..., 1]
    bu, bv = (reach * du * along).sum(axis=(1, 2)), (reach * dv * along).sum(axis=(1, 2))
    determinant = uu * vv - uv * uv
    safe = np.where(determinant > 0.01 * (uu + vv) ** 2, determinant, np.inf)
    return np.stack([(vv * bu - uv * bv) / safe, (uu * bv - uv * bu) / safe], axis=1)


def _likeness(values: Array, window: Array, shift: Array, dark: int) -> Array:
    """Correlation with light and dark squares that meet off the middle, over what is on the board, shape (n,)."""
    spot = window - shift[:, None, None]
    place = PLACES[:, None, None] + spot
    clear = ((place > 0.02) & (place < 7.98)).all(axis=-1) & (np.abs(spot).min(axis=-1) > 0.03)
    parity = dark * (2.0 * (PLACES.sum(axis=1) % 2) - 1.0)
    pattern = parity[:, None, None] * np.sign(spot[..., 0] * spot[..., 1])
    count = np.maximum(clear.sum(axis=(1, 2)), 1)
    a, b = (
        np.where(clear, one - (np.where(clear, one, 0.0).sum(axis=(1, 2)) / count)[:, None, None], 0.0)
        for one in (values, pattern)
    )
    power = np.sqrt((a * a).sum(axis=(1, 2)) * (b * b).sum(axis=(1, 2)))
    return np.asarray((a * b).sum(axis=(1, 2)) / np.maximum(power, 1e-9))
