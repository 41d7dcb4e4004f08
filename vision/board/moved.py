"""Whether camera and board are still where they were, and where the board is when they are not.

A reference keeps the board's grid and the crossings that could be seen. In a new picture the same crossings are looked
for in the same windows: pieces, hands and shadows hide some of them but move none. A board that moved by a fifth of a
square or more shows no crossings in these windows, so where few are left it is searched for. A shift by whole squares
is seen beyond the border, where squares go on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from vision.arrays import Array, Picture
from vision.board.alternation import beside_crossings, light_less_dark, rate_sides, sample, side_places
from vision.board.crossings import PLACES, Crossings, crossings_in, window_places
from vision.board.find import find_board
from vision.board.grid import CORNERS, Grid
from vision.board.lattice import fit_homography
from vision.board.view import BoardNotFound
from vision.board.window import judge

TOLERANCE: Final = 0.06  # a corner that is off by more has moved [sides of a square]
LEAST_CROSSINGS: Final = 10  # crossings that must be seen to tell anything, in at least three rows and columns
LEAST_SHARE: Final = 0.3  # share of the crossings of the reference that must be seen
GONE_ON: Final = -0.3  # margin of the window below which squares go on beyond the border: a shift by whole squares
SAMPLES: Final = 9  # along a side of a window: coarser than for finding, since what is looked for is known to be close


@dataclass(frozen=True, slots=True, eq=False)
class AnchorCheck:
    """What a picture tells about the board's place."""

    shift: Array
    """How far the corners a1, h1, h8, a8 are from where they were, shape (4,) [sides of a square]; not a number where
    it is not known."""
    moved: bool | None
    """Whether a corner is further off than ``TOLERANCE``; None if too little of the board can be seen, or if it is not
    where it was and has not been searched for."""
    seen: float  # share of the reference's crossings that were found again
    corners: Array  # where the corners are now, shape (4, 2) [px]; those of the reference unless the board has moved


class Anchor:
    """The board's place in a reference picture."""

    def __init__(self, colour: Picture, corners: ArrayLike) -> None:
        """Remember what the board looks like in a picture, RGB (h, w, 3), with its corners a1, h1, h8, a8, (4, 2) [px],
        sub-pixel as ``find_board`` gives them.

        Raises:
            BoardNotFound: there is no board at these corners.
        """
        self._corners = np.array(corners, dtype=float)
        self._corners.flags.writeable = False
        self._shape = colour.shape
        self._grid = Grid(fit_homography(CORNERS, self._corners), 0.0, (colour.shape[1], colour.shape[0]))
        inner = np.stack(np.meshgrid(np.arange(1.0, 8.0), np.arange(1.0, 8.0), indexing="ij"), axis=-1).reshape(-1, 2)
        self._weights, self._dark = _weights(colour, self._grid, inner)
        windows = PLACES[:, None, None] + window_places(SAMPLES)
        sides = side_places((-1, -1), (9, 9))
        self._shapes = windows.shape[:-1], sides.shape[:-1]
        self._points = self._grid.project(np.concatenate([windows.reshape(-1, 2), sides.reshape(-1, 2)]))
        self._reference, _ = self._look(colour)
        inside = ~self._reference.border
        if not _enough(self._reference.places[inside], 1):
            raise BoardNotFound(
                f"only {np.count_nonzero(inside)} crossings of lines are seen at these corners, at least "
                f"{LEAST_CROSSINGS} are needed: find the board again"
            )

    @property
    def corners(self) -> Array:
        """Of the reference, shape (4, 2) [px]; read-only."""
        return self._corners

    def check(self, colour: Picture) -> AnchorCheck:
        """Whether the board is where it was, by the crossings alone: quick, and never searches.

        Raises:
            ValueError: the picture has another shape.
        """
        if colour.shape != self._shape:
            raise ValueError(f"a picture of shape {colour.shape} cannot be compared with one of {self._shape}")
        now, goes_on = self._look(colour)
        known = {tuple(place): k for k, place in enumerate(self._reference.places.tolist())}
        pairs = [(k, known[tuple(place)]) for k, place in enumerate(now.places.tolist()) if tuple(place) in known]
        here = np.array([k for k, _ in pairs], dtype=np.intp)
        there = np.array([k for _, k in pairs], dtype=np.intp)
        seen = len(pairs) / len(self._reference.places)
        places = self._reference.places[there]
        unknown = np.full(4, np.nan)
        if seen < LEAST_SHARE or not _enough(places, 3) or goes_on:
            return AnchorCheck(unknown, None, seen, self._corners)
        offset = _corner_offsets(places, now.found[here] - self._reference.found[there])
        shift = np.linalg.norm(offset, axis=1)
        moved = bool(shift.max() > TOLERANCE)
        corners = self._grid.project(CORNERS + offset) if moved else self._corners
        return AnchorCheck(shift, moved, seen, corners)

    def follow(self, colour: Picture) -> AnchorCheck:
        """The same, but searches for a board that is not where it was; ``moved`` is None only if none is sure.

        Raises:
            ValueError: the picture has another shape.
        """
        first = self.check(colour)
        if first.moved is False:
            return first
        try:
            found = find_board(colour, near=self._corners)
        except BoardNotFound:
            return AnchorCheck(first.shift, None, first.seen, self._corners)
        if found.doubt is not None:
            return AnchorCheck(first.shift, None, first.seen, self._corners)
        side = np.linalg.norm(np.roll(self._corners, -1, axis=0) - self._corners, axis=1).min() / 8.0
        shift = np.linalg.norm(found.corners - self._corners, axis=1) / side
        if shift.max() <= max(TOLERANCE, found.error):
            return AnchorCheck(shift, False, first.seen, self._corners)
        return AnchorCheck(shift, True, first.seen, found.corners)

    def _look(self, colour: Picture) -> tuple[Crossings, bool]:
        """Crossings, and whether squares go on beyond a border but not at the one across: a shift by whole squares."""
        values = np.log1p(sample(colour, self._points) / 20.0) @ self._weights
        windows, sides = self._shapes
        count = math.prod(windows)
        marks = rate_sides(values[count:].reshape(sides), -self._dark, (-1, -1))
        return crossings_in(values[:count].reshape(windows), self._dark), judge(marks, 1, 1).margin < GONE_ON


def _weights(colour: Picture, grid: Grid, inner: Array) -> tuple[Array, int]:
    """Weights of the logarithms of red, green and blue, and 1 where the square of a1 is dark."""
    direction = -light_less_dark(np.log1p(sample(colour, beside_crossings(grid, inner)) / 20.0), inner)
    dark = 1 if direction.sum() > 0.0 else -1
    return direction * dark / max(float(direction @ direction), 1e-9), dark


def _enough(places: Array, lines: int) -> bool:
    return len(places) >= LEAST_CROSSINGS and all(len(np.unique(places[:, axis])) >= lines for axis in (0, 1))


def _corner_offsets(places: Array, offsets: Array) -> Array:
    """How far the corners moved, by a linear field through most offsets (n, 2), shape (4, 2) [sides of a square]."""
    weight = np.ones(len(places))
    design = np.column_stack([np.ones(len(places)), (places - 4.0) / 4.0])
    ridge = np.diag([0.0, 1.0, 1.0])  # a turn needs more evidence than a shift
    for _ in range(4):
        normal = design.T @ (weight[:, None] * design) + ridge
        field = np.linalg.solve(normal, design.T @ (weight[:, None] * offsets))
        off = np.linalg.norm(offsets - design @ field, axis=1)
        weight = 1.0 / (1.0 + (off / 0.03) ** 2)
    corners = np.column_stack([np.ones(4), (CORNERS - 4.0) / 4.0])
    return np.asarray(corners @ field)
