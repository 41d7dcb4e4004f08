"""A grid over board and trays."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from app.motion.timing.reference import Vector
from hardware.table import TableSettings

SPACING = 0.010
"""Between neighbours [m]."""


class TableGrid(NamedTuple):
    """Coordinates of columns and rows in the board frame [m], and the table they lie on."""

    x: list[float]
    y: list[float]
    table: TableSettings

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return len(self.y), len(self.x)

    def points(self, height: float) -> Iterator[tuple[tuple[int, int], Vector]]:
        """Row and column of each point, and the point itself at a height [m], shape (3,), base frame."""
        for row, y in enumerate(self.y):
            for column, x in enumerate(self.x):
                yield (row, column), self.table.base_from_board(np.array([x, y, height]))


def table_grid(table: TableSettings, margin: float = 0.0) -> TableGrid:
    """All squares and tray places lie at least a margin [m] within its border."""
    x, y = np.array([table.xy(place) for place in table.tray_places()]).max(axis=0).tolist()
    half_x, half_y = max(x, 4.0 * table.square), max(y, 4.0 * table.square)
    return TableGrid(_line(half_x + margin), _line(half_y + margin), table)


def _line(half: float) -> list[float]:
    steps = int(np.ceil(2.0 * half / SPACING))
    return [float(v) for v in np.linspace(-half, half, steps + 1)]
