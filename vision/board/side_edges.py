"""Where the sides of a board's squares are in a picture, to a fraction of a pixel, across them.

Each side is looked at near both of its ends, since pieces stand in the middle. Within the board light meets dark, and
which of the two is where is known. On the border a square meets whatever is beside the board: all light squares of a
border together tell what their edge looks like, and so do all dark ones. A line drawn around the board touches squares
of its own shade, whose edge then seems to lie outside of it, so of two edges the inner one counts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from vision.arrays import Array, Indices, Mask
from vision.board.alternation import Look
from vision.board.grid import Grid

REACH: Final = 0.26  # how far across a side the picture is looked at, either way [sides of a square]
STEP: Final = 0.02  # and how closely [sides of a square]
ACROSS: Final = np.arange(-REACH, REACH + 0.5 * STEP, STEP)  # where across a side, shape (m,) [sides of a square]
ENDS: Final = np.array([[0.12, 0.18, 0.24, 0.30, 0.36], [0.64, 0.70, 0.76, 0.82, 0.88]])
"""Where along a side, at either end [sides of a square]."""
NEAR: Final = 0.10  # width of the window in which an edge is centred, one sigma [sides of a square]
NEAR_BORDER: Final = 0.05  # the same on the border, where lines around the board have edges of their own
MOST_FAR: Final = 0.12  # an edge further from the line is not the border's [sides of a square]
LEAST_SLOPE: Final = 1.0  # rise or fall of a clear edge [1/side of a square]: of noise and grain it is less
ROUNDS: Final = 6  # how often the window is moved onto the edge
LEAST_STEP: Final = 0.35
LEAST_BORDER_STEP: Final = 0.175
"""Height of an edge within the board and on its border, light less dark squares being 1."""
MOST_ASIDE: Final = 0.12  # an edge further from where it is looked for is another one [sides of a square]
LEAST_PURE: Final = 0.7
LEAST_BORDER_PURE: Final = 0.5
"""Share of all rise and fall near an edge that goes the way it should, within the board and on its border."""
SAME_EDGE: Final = 0.03  # edges of a border's light and dark squares that are further apart are two [sides of a square]


@dataclass(frozen=True, slots=True, eq=False)
class SideEdges:
    """Edges that were seen, each across the line that it belongs to."""

    places: Array  # where on the line, shape (n, 2)
    axis: Indices  # 0 across columns, 1 across rows, shape (n,)
    off: Array  # how far beyond the line it was seen, shape (n,) [sides of a square]
    rising: Array  # 1 where it is lighter beyond the line, otherwise -1, shape (n,)
    border: Mask  # whether the line is the board's border, shape (n,)


def measure_edges(look: Look, grid: Grid, dark: int) -> SideEdges:
    """All sides of squares that can be seen; arguments as of ``joint_fit.fit_jointly``."""
    axis, line, along, end = (one.ravel() for one in np.indices((2, 9, 8, 2)))
    slope = _slopes(look, grid, axis, line, along[:, None] + ENDS[end])
    usable = np.isfinite(slope).all(axis=1)
    slope = np.nan_to_num(slope)
    border = (line == 0) | (line == 8)
    rising = dark * (2.0 * ((line + along) % 2) - 1.0)  # where squares go on beyond the line
    start = np.zeros(len(axis))
    for which in range(4):
        on = (axis == which // 2) & (line == 8 * (which % 2)) & usable
        usable &= ~on
        outward = 2.0 * (which % 2) - 1.0
        light = -outward * rising > 0.0  # the square within
        for group, first, way in _border_edges(slope, outward, [np.nonzero(on & light)[0], np.nonzero(on & ~light)[0]]):
            usable[group], start[group], rising[group] = True, first, way
    off, height, pure = _centre(slope * rising[:, None], start, np.where(border, NEAR_BORDER, NEAR)[:, None])
    least = np.where(border, LEAST_BORDER_STEP, LEAST_STEP)
    purest = np.where(border, LEAST_BORDER_PURE, LEAST_PURE)
    seen = usable & (height > least) & (pure > purest) & (np.abs(off - start) < MOST_ASIDE)
    places = np.empty((len(axis), 2))
    rows = np.arange(len(axis))
    places[rows, axis], places[rows, 1 - axis] = line, along + ENDS.mean(axis=1)[end]
    return SideEdges(places[seen], axis[seen], off[seen], rising[seen], border[seen])


def _slopes(look: Look, grid: Grid, axis: Indices, line: Indices, along: Array) -> Array:
    """How lightness rises across lines at n spots, the mean of places ``along`` (n, k): shape (n, m), as ``ACROSS``."""
    spots = np.empty((*along.shape, len(ACROSS), 2))
    rows = np.arange(len(axis))
    spots[rows, ..., axis] = line[:, None, None] + ACROSS
    spots[rows, ..., 1 - axis] = along[:, :, None]
    return np.asarray(np.gradient(look(grid.project(spots)).mean(axis=1), STEP, axis=1))


def _border_edges(slope: Array, outward: float, groups: list[Indices]) -> list[tuple[Indices, float, float]]:
    """Edges of the light and of the dark squares on one border, without the one that lies outside of the other.

    Returns:
        Members of the group, how far beyond the line their edge is [sides of a square], and 1 where it rises, else -1.
    """
    found = []
    for group in groups:
        if len(group) < 3:
            continue
        pooled = np.median(slope[group], axis=0)
        best = _first_edge(pooled if outward > 0.0 else pooled[::-1])
        if best is None:
            continue
        best = best if outward > 0.0 else len(ACROSS) - 1 - best
        way = 1.0 if pooled[best] > 0.0 else -1.0
        off, height, pure = _centre(way * pooled[None], ACROSS[[best]], NEAR_BORDER)
        if height[0] > LEAST_BORDER_STEP and pure[0] > LEAST_BORDER_PURE:
            found.append((group, float(off[0]), way))
    inner = min((outward * off for _, off, _ in found), default=0.0)
    return [one for one in found if outward * one[1] - inner < SAME_EDGE]


def _first_edge(slope: Array) -> int | None:
    """Which sample is on the first clear edge from the inside on; None if there is none."""
    strength = np.abs(slope) * (np.abs(ACROSS) < MOST_FAR)
    peaks = (strength[1:-1] >= strength[:-2]) & (strength[1:-1] >= strength[2:])
    clear = np.nonzero(peaks & (strength[1:-1] > max(0.5 * float(strength.max()), LEAST_SLOPE)))[0]
    return int(clear[0]) + 1 if len(clear) else None


def _centre(slope: Array, start: Array, width: Array | float = NEAR) -> tuple[Array, Array, Array]:
    """Centre, height and purity of edges that rise in slopes (n, m), looked for from a start (n,) on: each (n,)."""
    rise = np.maximum(slope, 0.0)
    centre = start
    for _ in range(ROUNDS):
        near = rise * np.exp(-0.5 * ((ACROSS - centre[:, None]) / width) ** 2)
        shift = (near * (ACROSS - centre[:, None])).sum(axis=1) / np.maximum(near.sum(axis=1), 1e-9)
        centre = np.clip(centre + shift, -REACH, REACH)
    near = np.exp(-0.5 * ((ACROSS - centre[:, None]) / width) ** 2)
    total = (np.abs(slope) * near).sum(axis=1)
    return centre, (slope * near).sum(axis=1) * STEP, (rise * near).sum(axis=1) / np.maximum(total, 1e-9)
