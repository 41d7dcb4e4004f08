"""A board watched in depth: what stands higher than any piece, and what reaches in low over the board.

A piece of any kind ends below ``TALLEST``. What is higher is no piece. A hand that lies on the table is lower: it is
known by how much of the settled board's height changed in one connected part that comes in from outside.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from hardware.table import PIECE_SHAPES, TableSettings
from vision.zone import NO_SQUARE, Floats, Mask, Space

TALLEST: Final = max(shape.height for shape in PIECE_SHAPES.values())
"""Height of the tallest piece [m]."""
_LEARNING: Final = 0.2
_STANDS: Final = 0.012
"""What is lower is the board, or noise of the depth camera [m]."""
_RISES: Final = 0.020
"""A height that changed by less may be noise of the depth camera [m]."""
_RIM: Final = 0.012
"""What comes so near to the border of the space that is watched comes in from outside [m]."""
_TOUCHING: Final = 0.11
"""A hand whose skin is seen lower than this may touch what stands below [m]."""
_SMALL: Final = np.ones((3, 3), dtype=np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class Relief:
    """What one depth picture shows that is no piece.

    Attributes:
        area: of it, as the camera sees it [m²].
        over: squares that it is over.
        low: squares over which it is low enough to touch a piece.
    """

    area: float
    over: frozenset[int]
    low: frozenset[int]


NOTHING: Final = Relief(0.0, frozenset(), frozenset())


class Heights:
    """Watches in depth. Not thread-safe.

    Args:
        space: what is watched.
        table: its squares.
        margin: what is higher than the tallest piece by this is no piece [m].
        ceiling: what is higher than this is not over the board but between it and the camera [m].
        least: area of what is no piece [m²].
        reach: area of what comes in from outside, however low [m²].
        large: area of what is no piece wherever it is: castling moves two of them at once [m²].
    """

    def __init__(
        self,
        space: Space,
        table: TableSettings,
        margin: float = 0.018,
        ceiling: float = 0.34,
        least: float = 0.00045,
        reach: float = 0.0018,
        large: float = 0.006,
    ) -> None:
        self._space, self._table = space, table
        self._lowest, self._ceiling = TALLEST + margin, ceiling
        self._least, self._reach, self._large = least, reach, large
        self._background: Floats | None = None

    def look(self, depth: Floats, hidden: Mask | None) -> Relief:
        """Take a picture in.

        Args:
            depth: small picture of distances along the view, 0 where there is none [m].
            hidden: small mask of where something known, such as the arm, is before the table.
        """
        height = self._space.coordinate(depth, 2)
        there = (depth > 0.0) & (height < self._ceiling)
        if hidden is not None:
            there &= ~hidden
        tall = there & (height > self._lowest)
        low = np.zeros_like(tall)
        if self._background is not None:
            low = there & (height > _STANDS) & (height - self._background > _RISES)
        if not (tall.any() or low.any()):
            return NOTHING
        x, y = self._space.coordinate(depth, 0), self._space.coordinate(depth, 1)
        inside = (np.abs(x) < self._space.half[0]) & (np.abs(y) < self._space.half[1])
        area, mask = self._hand(tall & inside, low & inside, depth, self._near_rim(x, y))
        if mask is None:
            return NOTHING
        where = self._squares(x, y)
        return Relief(area, _covered(where[mask]), _covered(where[mask & (height < _TOUCHING)]))

    def learn(self, depth: Floats, hidden: Mask | None, *, moved: bool) -> None:
        """A picture of the settled board; arguments as of ``Differences.learn``."""
        height = self._space.coordinate(depth, 2)
        seen = depth > 0.0 if hidden is None else (depth > 0.0) & ~hidden
        if self._background is None:
            self._background = np.full(depth.shape, np.inf, dtype=np.float32)
        known = np.isfinite(self._background)
        share = np.where(known & (not moved), np.float32(_LEARNING), np.float32(1.0))
        before = np.where(known, self._background, np.float32(0.0))
        self._background = np.where(seen, before + share * (height - before), self._background).astype(np.float32)

    def forget(self) -> None:
        """The table is no longer where it was."""
        self._background = None

    def _near_rim(self, x: Floats, y: Floats) -> Mask:
        half_x, half_y = self._space.half
        near = (np.abs(x) > half_x - _RIM) | (np.abs(y) > half_y - _RIM)
        near[:3], near[-3:], near[:, :3], near[:, -3:] = True, True, True, True
        return near

    def _hand(self, tall: Mask, low: Mask, depth: Floats, rim: Mask) -> tuple[float, Mask | None]:
        """Area of all parts that must be a hand [m²], and where they are."""
        mask = cv2.morphologyEx((tall | low).astype(np.uint8), cv2.MORPH_OPEN, _SMALL)
        count, labels = cv2.connectedComponents(mask, connectivity=8)
        if count == 1:
            return 0.0, None
        flat = labels.ravel()
        pixels = (depth * depth).ravel() * np.float32(self._space.pixel)
        areas = np.bincount(flat, weights=pixels, minlength=count)
        high = np.bincount(flat, weights=pixels * tall.ravel(), minlength=count)
        enters = np.bincount(labels[rim], minlength=count) > 0
        hands = (high >= self._least) | (enters & (areas >= self._reach)) | (areas >= self._large)
        hands[0] = False
        if not hands.any():
            return 0.0, None
        return float(areas[hands].sum()), hands[labels]

    def _squares(self, x: Floats, y: Floats) -> NDArray[np.intp]:
        side = self._table.square
        file, rank = np.floor(x / side + 4.0), np.floor(y / side + 4.0)
        on_board = (file >= 0) & (file < 8) & (rank >= 0) & (rank < 8)
        return np.where(on_board, file + 8 * rank, NO_SQUARE).astype(np.intp)


def _covered(squares: NDArray[np.intp]) -> frozenset[int]:
    """Squares of which at least a few pixels are among these."""
    counts = np.bincount(squares, minlength=NO_SQUARE + 1)[:NO_SQUARE]
    return frozenset(np.flatnonzero(counts >= 6).tolist())
