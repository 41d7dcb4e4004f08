"""Which 8 × 8 squares of a lattice are the board.

Squares of a row of the board alternate along the row, and beyond the board nothing does. So each row and column of
squares around a lattice is given a mark between -1 and 1, how well it alternates, and the board is the eight rows
and eight columns that do while those beyond do not. A board wrong by one row is the error that nobody would notice,
so the decision needs a margin.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from vision.arrays import Array
from vision.board.alternation import Sides

LEAST_LINE: Final = 0.1  # mark below which a row of the board cannot be told from what is beside the board
LEAST_MEAN: Final = 0.4  # mean mark of the board's rows and columns
LEAST_MARGIN: Final = 0.1  # how much better the outermost row must be than the one it would be exchanged for by a shift
MOST_OUTSIDE: Final = 0.4  # mark of a row beyond the board: above it, the pattern goes on and is no chessboard
LEAST_SEEN: Final = 0.75  # share of the board's sides of squares that lie within the picture


@dataclass(frozen=True, slots=True, eq=False)
class Window:
    """Eight rows and columns of a lattice."""

    origin: tuple[int, int]  # column and row of the first square
    mean: float  # mean mark of the rows and columns
    weakest: float  # least mark of a row or column
    margin: float  # how much better the outermost rows and columns are than what a shift by one would bring
    outside: float  # largest mark of a row or column just beyond, as far as it is in the picture
    seen: float  # share of the sides between squares that lies within the picture

    @property
    def doubt(self) -> str | None:
        """Why this is no board for certain, a clause; None if it is one."""
        if self.seen < LEAST_SEEN:
            return f"only {100.0 * self.seen:.0f} % of its squares would be in the picture"
        if self.mean < LEAST_MEAN:
            return f"its squares alternate too little ({self.mean:.2f}, at least {LEAST_MEAN:.2f} is needed)"
        if self.outside > MOST_OUTSIDE:
            return "the pattern goes on beyond eight squares"
        if self.margin < LEAST_MARGIN:
            return f"it could be shifted by one row (margin {self.margin:.2f}, at least {LEAST_MARGIN:.2f} is needed)"
        if self.weakest < LEAST_LINE:
            return f"one of its rows cannot be seen ({self.weakest:.2f}, at least {LEAST_LINE:.2f} is needed)"
        return None


def best_window(sides: Sides) -> Window | None:
    """The window whose squares alternate best; None if the range has fewer than ten rows or columns."""
    columns, rows = sides.upright.shape
    if columns < 10 or rows < 10:
        return None
    upright, level = (np.nan_to_num(one) for one in (sides.upright, sides.level))
    across = sliding_window_view(upright[1:], (7, 8)).sum(axis=(2, 3))[: columns - 7, : rows - 7]
    along = sliding_window_view(level[:, 1:], (8, 7)).sum(axis=(2, 3))[: columns - 7, : rows - 7]
    best = (across + along)[1:-1, 1:-1]  # one row beyond is needed to tell the board from what is beside it
    i, j = np.unravel_index(int(best.argmax()), best.shape)
    return judge(sides, int(i) + 1, int(j) + 1)


def judge(sides: Sides, i: int, j: int) -> Window:
    """Marks of the window that begins with square (i, j) of the range, counted from its first, both at least 1."""
    along = _marks(sides.upright[i + 1 : i + 8, j - 1 : j + 9], axis=0)
    across = _marks(sides.level[i - 1 : i + 9, j + 1 : j + 8], axis=1)
    inner = np.concatenate(
        [sides.upright[i + 1 : i + 8, j : j + 8].ravel(), sides.level[i : i + 8, j + 1 : j + 8].ravel()]
    )
    marks = np.concatenate([along[1:-1], across[1:-1]])
    margins = [low - high for line in (along, across) for low, high in ((line[1], line[-1]), (line[-2], line[0]))]
    return Window(
        origin=(sides.origin[0] + i, sides.origin[1] + j),
        mean=float(marks.mean()),
        weakest=float(marks.min()),
        margin=float(min(margins)),
        outside=float(max(along[0], along[-1], across[0], across[-1])),
        seen=float(np.isfinite(inner).mean()),
    )


def _marks(values: Array, axis: int) -> Array:
    """Mean along an axis of what lies in the picture; 0 where less than half of it does."""
    seen = np.isfinite(values)
    count = seen.sum(axis=axis)
    total = np.where(seen, values, 0.0).sum(axis=axis)
    return np.asarray(np.where(count >= values.shape[axis] / 2, total / np.maximum(count, 1), 0.0))
