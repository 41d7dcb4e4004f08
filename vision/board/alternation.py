"""Which squares alternate: what tells where a lattice's board begins and ends.

Two squares with a common side differ in colour, and any step from one to the next changes the sign. Measured close to
the sides of squares, since pieces stand in the middle; beyond the board there is nothing that alternates.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.arrays import Array, Field, Picture
from vision.board.grid import Grid

Look = Callable[[Array], Array]
"""Gives lightness at points (..., 2) [px], shape (...), light less dark squares about 1; not a number outside."""
ALONG: Final = np.array([0.12, 0.24, 0.37, 0.5, 0.63, 0.76, 0.88])  # where along a side [sides of a square]
ACROSS: Final = 0.13  # how far from it to either side [sides of a square]


@dataclass(frozen=True, slots=True, eq=False)
class Sides:
    """How well the two squares at each side differ as they should: 1 as on the board, 0 by chance, -1 the other way."""

    origin: tuple[int, int]  # column and row of the first square
    upright: Array  # between squares (i - 1, j) and (i, j), shape (columns, rows); not a number outside of the picture
    level: Array  # between squares (i, j - 1) and (i, j), shape (columns, rows)


def compare_sides(look: Look, grid: Grid, bright: int, low: tuple[int, int], high: tuple[int, int]) -> Sides:
    """Compare the squares on either side of all sides from a first column and row to one beyond the last ones.

    ``bright`` is 1 where square (0, 0) is a light one, otherwise -1.
    """
    return rate_sides(look(grid.project(side_places(low, high))), bright, low)


def side_places(low: tuple[int, int], high: tuple[int, int]) -> Array:
    """Places to look at on either side of all sides of squares in a range, shape (2, columns, rows, n, 2, 2): [upright
    or level, column, row, along the side, before or behind it].
    """
    i, j = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]), indexing="ij")
    places = np.empty((2, *i.shape, len(ALONG), 2, 2))
    for axis, (across, along) in enumerate(((i, j), (j, i))):
        places[axis, ..., axis] = across[..., None, None] + np.array([-ACROSS, ACROSS])
        places[axis, ..., 1 - axis] = along[..., None, None] + ALONG[:, None]
    return places


def rate_sides(values: Array, bright: int, low: tuple[int, int]) -> Sides:
    """The same for lightness (2, columns, rows, n, 2) that was looked up at ``side_places``."""
    columns, rows = values.shape[1:3]
    i, j = np.meshgrid(np.arange(low[0], low[0] + columns), np.arange(low[1], low[1] + rows), indexing="ij")
    parity = bright * (1.0 - 2.0 * ((i + j) % 2))
    difference = np.clip((values[..., 1] - values[..., 0]) * parity[..., None], -1.0, 1.0)
    seen = np.isfinite(difference)
    count = seen.sum(axis=-1)
    total = np.where(seen, difference, 0.0).sum(axis=-1)
    marks = np.where(count >= len(ALONG) / 2, total / np.maximum(count, 1), np.nan)
    return Sides((int(low[0]), int(low[1])), marks[0], marks[1])


def sample(picture: Field | Picture, points: Array) -> Array:
    """Values at points (..., 2) [px] in between pixels, shape (..., channels); not a number outside."""
    height, width = picture.shape[:2]
    flat = points.reshape(-1, 2)
    inside = (flat[:, 0] >= 0) & (flat[:, 1] >= 0) & (flat[:, 0] <= width - 1) & (flat[:, 1] <= height - 1)
    safe = np.where(inside[:, None], flat, 0.0).astype(np.float32)
    # OpenCV's remap has a limit of 32767 rows or columns
    parts = np.array_split(safe, len(safe) // 30000 + 1)
    source: NDArray[Any] = picture
    values = np.concatenate([cv2.remap(source, one[None], None, cv2.INTER_LINEAR)[0] for one in parts]).astype(float)  # type: ignore[call-overload]
    values[~inside] = np.nan
    return np.asarray(values.reshape(*points.shape[:-1], -1))


def look_into(picture: Field, weights: Array) -> Look:
    """Lightness in a picture (h, w, channels) with weights of its channels."""
    grey = np.ascontiguousarray(picture @ weights.astype(np.float32))

    def look(points: Array) -> Array:
        return np.asarray(sample(grey[..., None], points)[..., 0])

    return look


def channel_weights(picture: Field, grid: Grid, bright: int, places: Array) -> Array:
    """Weights that make light less dark 1 at the median of crossings (n, 2), shape (channels,)."""
    direction = bright * light_less_dark(sample(picture, beside_crossings(grid, places)), places)
    length = float(np.linalg.norm(direction))
    return np.asarray(direction / max(length, 1e-9) ** 2)


def beside_crossings(grid: Grid, places: Array) -> Array:
    """Where to look at the four squares around crossings (n, 2): shape (n, 4, 2) [px]."""
    return np.asarray(grid.project(places[:, None, :] + [[0.2, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.2, -0.2]]))


def light_less_dark(values: Array, places: Array) -> Array:
    """Median difference between squares of both shades around crossings, as if a1 were light: shape (channels,).

    Values were looked up at ``beside_crossings``, shape (n, 4, channels); places of the crossings, shape (n, 2).
    """
    parity = 1.0 - 2.0 * (places.sum(axis=1) % 2)
    difference = 0.5 * parity[:, None] * (values[:, 0] + values[:, 2] - values[:, 1] - values[:, 3])
    return np.asarray(np.nanmedian(difference, axis=0))
