"""The chessboard in a picture of which nothing else is known.

Saddle points (``vision.saddles``) grow into lattices (``vision.lattice``), the squares that alternate tell which eight
rows and columns are the board (``vision.window``), and all crossings that can be seen give its corners to a fraction
of a pixel (``vision.refine``). Where any of this leaves a doubt there is no board: a wrong one is worse than none.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from vision.board import BoardNotFound
from vision.grid import CORNERS, Grid, fit_grid
from vision.lattice import Lattice, grow_lattices
from vision.refine import refine_grid, working_scale
from vision.saddles import Picture, find_saddles, levels
from vision.squares import channel_weights, compare_sides
from vision.window import Window, best_window

Array = NDArray[np.float64]

SIZES: Final = (640, 1280, 400)
"""Longer sides of the pictures that are searched one after another [px]: boards near, small, or out of focus."""
MOST_SADDLES: Final = 500
"""Of one picture; a board has 49."""
LEAST_CROSSINGS: Final = 10
"""A lattice below this is chance."""
MOST_ERROR: Final = 0.12
"""Corners that are less certain than this are not given [sides of a square]."""


@dataclass(frozen=True, slots=True, eq=False)
class FoundBoard:
    """A board in a picture.

    Attributes:
        corners: outer corners of the playing area a1, h1, h8, a8, counter-clockwise seen from above, shape (4, 2) [px].
        oriented: False where a1 may be the opposite corner: all that is known then is that a1 is dark.
        error: the worst error of a corner that is to be expected [sides of a square].
    """

    corners: Array
    oriented: bool
    error: float


@dataclass(frozen=True, slots=True, eq=False)
class _Candidate:
    """A board in a resized picture; ``dark`` is 1 where the square at place (0, 0) is dark."""

    grid: Grid
    weights: Array
    dark: int
    window: Window


def find_board(colour: NDArray[np.uint8], *, near: ArrayLike | None = None) -> FoundBoard:
    """Find the board."""
    doubts: list[str] = []
    for longest in SIZES:
        factor = longest / max(colour.shape[:2])
        picture = levels(_resize(colour, factor))
        candidate = _search(picture, doubts)
        if candidate is None:
            continue
        grid = candidate.grid.scaled(1.0 / factor, (colour.shape[1], colour.shape[0]))
        found = _measure(colour, grid, candidate, doubts)
        if found is not None:
            return found
    raise BoardNotFound(
        f"there is no chessboard for certain in this picture: {doubts[-1] if doubts else 'no lattice'}"
    )


def _resize(colour: NDArray[np.uint8], factor: float) -> NDArray[np.uint8]:
    size = (round(colour.shape[1] * factor), round(colour.shape[0] * factor))
    return cv2.resize(colour, size, interpolation=cv2.INTER_AREA if factor < 1.0 else cv2.INTER_CUBIC)


def _search(picture: Picture, doubts: list[str]) -> _Candidate | None:
    saddles = find_saddles(picture, MOST_SADDLES)
    for lattice in grow_lattices(saddles, LEAST_CROSSINGS, 30, 150)[:4]:
        candidate = _place(picture, lattice)
        doubt = candidate.window.doubt if candidate else "no window"
        if candidate is not None and doubt is None:
            return candidate
        doubts.append(doubt or "")
    return None


def _place(picture: Picture, lattice: Lattice) -> _Candidate | None:
    size = (picture.shape[1], picture.shape[0])
    places = lattice.places.astype(float)
    grid = fit_grid(places, lattice.points, size).grid
    weights = channel_weights(picture, grid, lattice.bright, places)
    low, high = lattice.places.min(axis=0) - 9, lattice.places.max(axis=0) + 9
    sides = compare_sides(picture, grid, lattice.bright, weights, (low[0], low[1]), (high[0], high[1]))
    window = best_window(sides)
    if window is None:
        return None
    i, j = window.origin
    dark = -lattice.bright * (1 - 2 * ((i + j) % 2))
    shift = np.array([[1.0, 0.0, i], [0.0, 1.0, j], [0.0, 0.0, 1.0]])
    return _Candidate(grid.moved(shift), weights, dark, window)


def _measure(colour: NDArray[np.uint8], grid: Grid, candidate: _Candidate, doubts: list[str]) -> FoundBoard | None:
    factor = working_scale(grid)
    picture = levels(_resize(colour, factor)) if factor != 1.0 else levels(colour)
    fit = refine_grid(picture, grid.scaled(factor, (picture.shape[1], picture.shape[0])), candidate.weights, candidate.dark)
    if fit is None:
        doubts.append("too few crossings")
        return None
    error = float(np.hypot(3.0 * fit.spread.max(), 0.01))
    if error > MOST_ERROR:
        doubts.append(f"its corners are uncertain by {error:.2f} squares")
        return None
    corners = fit.grid.scaled(1.0 / factor, grid.size).project(CORNERS)
    if candidate.dark < 0:
        corners = np.roll(corners, -1, axis=0)
    return FoundBoard(corners, False, error)
