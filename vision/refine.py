"""Crossings of a board's lines to a fraction of a pixel.

Around each crossing the picture is sampled in the board's own coordinates, so that a window covers the same part of a
square near and far. The crossing is where the lines through all samples along their edges meet best (Förstner and
Gülch, 1987), which holds for crossings within the board as for the T where a line meets the border.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from vision.grid import CORNERS, Grid, GridFit, fit_grid
from vision.squares import Look

Array = NDArray[np.float64]

HALF_WINDOW: Final = 0.24
"""Half of the window around a crossing [sides of a square]; pieces that stand in the middle begin at about 0.3."""
WINDOW: Final = 17
"""Samples along a side of the window; odd."""
ROUNDS: Final = 4
"""How often the window is moved onto the crossing."""
LEAST_LIKENESS: Final = 0.75
"""Correlation of the window with four squares that meet."""
FURTHEST: Final = 0.2
"""A crossing that moves further than this is another feature [sides of a square]."""
BORDER_WEIGHT: Final = 0.1
"""Weight across the border of crossings on it: frames and inlays have lines of their own, up to 0.1 squares outside."""
FINEST, COARSEST = 18.0, 44.0
"""Squares of this side are measured best [px]: below, pixels are too few; above, grain and blur are seen."""


@dataclass(frozen=True, slots=True, eq=False)
class Crossings:
    """Crossings that were seen.

    Attributes:
        places: shape (n, 2).
        found: where they are, as places by the grid they were looked for with, shape (n, 2).
        border: whether each lies on the border, shape (n,).
    """

    places: Array
    found: Array
    border: NDArray[np.bool_]


def refine_grid(look: Look, grid: Grid, dark: int) -> GridFit | None:
    """Fit a grid to all crossings of its board that can be seen; None if they are too few.

    Args:
        look: into the picture.
        grid: about right, to a fifth of a square.
        dark: 1 where the square of a1 is dark, -1 where it is light.
    """
    fit: GridFit | None = None
    for _ in range(2):
        seen = find_crossings(look, grid, dark)
        if np.count_nonzero(~seen.border) < 12:
            return None
        points = grid.project(seen.found)
        weight = np.where((seen.places == 0.0) | (seen.places == 8.0), BORDER_WEIGHT, 1.0)
        fit = fit_grid(seen.places, points, grid.size, scatter=0.01, weights=weight)
        grid = fit.grid
    return fit


def working_scale(grid: Grid) -> float:
    """Factor by which a picture is best resized before its crossings are refined."""
    side = float(np.median(grid.sides(np.concatenate([CORNERS, [[4.0, 4.0]]]))))
    if side > COARSEST:
        return COARSEST / side
    return min(2.0, FINEST / side) if side < FINEST else 1.0


def find_crossings(look: Look, grid: Grid, dark: int, samples: int = WINDOW, rounds: int = ROUNDS) -> Crossings:
    """Where the lines of a grid cross in the picture, those that can be seen.

    Args:
        look: into the picture.
        grid: about right, to a fifth of a square.
        dark: 1 where the square of a1 is dark, -1 where it is light.
        samples: along a side of the window around each crossing.
        rounds: how often the window is moved onto the crossing.
    """
    step = np.linspace(-HALF_WINDOW, HALF_WINDOW, samples)
    window = np.stack(np.meshgrid(step, step, indexing="ij"), axis=-1)
    i, j = np.meshgrid(np.arange(9), np.arange(9), indexing="ij")
    places = np.stack([i.ravel(), j.ravel()], axis=1).astype(float)
    found = places.copy()
    alive = np.ones(len(places), dtype=bool)
    for _ in range(rounds):
        values = look(grid.project(found[:, None, None] + window))
        alive &= np.isfinite(values).all(axis=(1, 2))
        shift = _crossing_of_edges(np.nan_to_num(values), window)
        found = found + np.clip(shift, -0.1, 0.1)
        alive &= np.abs(found - places).max(axis=1) < FURTHEST
        found = np.where(alive[:, None], found, places)
    values = np.nan_to_num(look(grid.project(found[:, None, None] + window)))
    parity = dark * (2.0 * (places.sum(axis=1) % 2) - 1.0)
    likeness = _likeness(values, window, places, parity)
    border = ((places == 0.0) | (places == 8.0)).any(axis=1)
    kept = alive & (likeness > LEAST_LIKENESS)
    return Crossings(places[kept], found[kept], border[kept])


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


def _likeness(values: Array, window: Array, places: Array, parity: Array) -> Array:
    """Correlation with light and dark squares that meet, over the part of each window on the board, shape (n,)."""
    spot = places[:, None, None] + window
    on_board = ((spot > 0.02) & (spot < 7.98)).all(axis=-1)
    clear = on_board & (np.abs(window).min(axis=-1) > 0.03)
    pattern = parity[:, None, None] * np.sign(window[..., 0] * window[..., 1])
    count = np.maximum(clear.sum(axis=(1, 2)), 1)
    mean = np.where(clear, values, 0.0).sum(axis=(1, 2)) / count
    level = np.where(clear, pattern, 0.0).sum(axis=(1, 2)) / count
    a = np.where(clear, values - mean[:, None, None], 0.0)
    b = np.where(clear, pattern - level[:, None, None], 0.0)
    power = np.sqrt((a * a).sum(axis=(1, 2)) * (b * b).sum(axis=(1, 2)))
    return np.asarray((a * b).sum(axis=(1, 2)) / np.maximum(power, 1e-9))
