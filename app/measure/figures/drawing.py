"""One look for all figures: sizes, colours, quiet axes. Pictures are drawn without any window or global state."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from app.measure.figures.result import Picture
from app.motion.timing.reference import Vector
from hardware.table import TableSettings, square_place

WITHOUT, WITH = "#2b5fa8", "#c23b2e"
"""Without and with tactile feedback: blue and red, as in the paper."""
GREY, DARK = "#8a8f96", "#22262b"
PIXELS_PER_INCH = 110
SPACING = 0.010
"""Between neighbours of a grid over the table [m]."""


def picture(width: float, height: float) -> Picture:
    """An empty picture of a size in inches."""
    return Picture(figsize=(width, height), dpi=PIXELS_PER_INCH, layout="constrained")


def axes(within: Picture, rows: int = 1, columns: int = 1, sharex: bool = False) -> list[Axes]:
    """A grid of axes, row by row: lines in the back, no frame at the top and right."""
    grid = within.subplots(rows, columns, squeeze=False, sharex=sharex)
    found = [axis for line in grid for axis in line]
    for axis in found:
        axis.grid(True, color="#dfe2e6", linewidth=0.6)
        axis.set_axisbelow(True)
        axis.spines[["top", "right"]].set_visible(False)
        axis.tick_params(labelsize=8)
    return found


def label(axis: Axes, **properties: Any) -> None:
    """Set labels, limits, ticks and title as ``Axes.set`` does, in small letters."""
    axis.set(**properties)
    for text in (axis.xaxis.label, axis.yaxis.label, axis.title):
        text.set_fontsize(9)


def board_map(axis: Axes, grid: TableGrid, values: Vector, quantity: str, limits: tuple[float, float] | None = None,
              colours: str = "viridis") -> None:  # fmt: skip
    """A quantity over the table, seen from above, with squares, trays and a scale.

    ``values`` have the grid's shape and are not finite where there is none; ``limits`` are those of the scale.
    """
    low, high = limits or (None, None)
    axis.grid(False)
    mesh = axis.pcolormesh(
        [1e3 * v for v in grid.x], [1e3 * v for v in grid.y], values, shading="nearest", vmin=low, vmax=high,
        cmap=colours, rasterized=True,
    )  # fmt: skip
    assert axis.figure is not None
    scale = axis.figure.colorbar(mesh, ax=axis, orientation="horizontal", shrink=0.85, aspect=35)
    scale.set_label(quantity, fontsize=9)
    scale.ax.tick_params(labelsize=8)
    _draw_table(axis, grid.table)


def _draw_table(axis: Axes, table: TableSettings) -> None:
    """Outlines of squares and boxes and dots for the trays' places, in millimetres of the board frame."""
    side = 1e3 * table.square
    for index in range(64):
        cx, cy = (1e3 * v for v in table.xy(square_place(index)))
        axis.add_patch(Rectangle((cx - side / 2, cy - side / 2), side, side, fill=False, lw=0.5, ec="white", alpha=0.7))
    for place in table.tray_places():
        cx, cy = (1e3 * v for v in table.xy(place))
        axis.plot(cx, cy, "o", ms=2.5, mfc="none", mec="white", mew=0.6)
    for box in table.boxes():
        corner = 1e3 * (box.x - box.half_x), 1e3 * (box.y - box.half_y)
        axis.add_patch(Rectangle(corner, 2e3 * box.half_x, 2e3 * box.half_y, fill=False, lw=1.0, ec="white"))
    label(axis, aspect="equal", xlabel="board x = z₁ [mm]", ylabel="board y = −z₂ [mm]")


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
    furthest = np.array([table.xy(place) for place in table.tray_places()]).max(axis=0)
    halves = (np.maximum(furthest, 4.0 * table.square) + margin).tolist()
    x, y = (np.linspace(-half, half, int(np.ceil(2.0 * half / SPACING)) + 1).tolist() for half in halves)
    return TableGrid(x, y, table)
