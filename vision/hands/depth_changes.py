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

from hardware.piece_set import PIECE_SHAPES
from hardware.table import TableSettings
from vision.arrays import Array, Field, Mask, Picture
from vision.hands.arm_mask import Capsules
from vision.hands.watched_zone import Space
from vision.loops import learn_heights, measure_parts, squares_under, stand_out

TALLEST: Final = max(shape.height for shape in PIECE_SHAPES.values())  # height of the tallest piece [m]
_MARGIN: Final = 0.018  # what is higher than the tallest piece by this is no piece [m]
_CEILING: Final = 0.34  # what is higher than this is not over the board but between it and the camera [m]
_LEAST: Final = 0.00045  # area of what is no piece [m²]
_REACH: Final = 0.0018  # area of what comes in from outside, however low [m²]
_LARGE: Final = 0.006  # area of what is no piece wherever it is: castling moves two of them at once [m²]
_MOVES: Final = 0.00024  # area that changes on a board at rest, by noise, at most [m²]
_LEARNING: Final = 0.2
_STANDS: Final = 0.012
"""What is lower is the board, or noise of the depth camera [m]."""
_RISES: Final = 0.020  # a height that changed by less may be noise of the depth camera [m]
_RIM: Final = 0.012  # what comes so near to the border of the space that is watched comes in from outside [m]
_TOUCHING: Final = 0.11  # a hand whose skin is seen lower than this may touch what stands below [m]
_BORDER: Final = 3  # so does what comes so near to the picture's edge, in the small picture [px]
_NONE: Final = Capsules(np.zeros((0, 2, 3)), np.zeros(0))
_EVERYWHERE: Final = np.array([np.inf, np.inf], dtype=np.float32)
_NO_SQUARES: Final = frozenset[int]()
_SMALL: Final = np.ones((3, 3), dtype=np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class Relief:
    """What one depth picture shows that is no piece."""

    area: float  # of it, as the camera sees it [m²]
    over: frozenset[int]  # squares that it is over
    low: frozenset[int]  # squares over which it is low enough to touch a piece
    before: bool  # it hides a part of the board, or of a piece on it, or may touch one
    moving: float  # area over the board that is higher or lower than in the picture since which it has lain still [m²]
    away: Array  # points of what stands out beyond what is watched, board frame, (n, 3) [m]


NOWHERE: Final = np.zeros((0, 3))


class Heights:
    """Watches a space, with squares as of a table, in depth. Not thread-safe."""

    def __init__(self, space: Space, table: TableSettings) -> None:
        self._space, self._table = space, table
        self._limits = np.array([TALLEST + _MARGIN, _CEILING, _STANDS, _RISES], dtype=np.float32)
        self._half = np.array(space.half, dtype=np.float32)
        shape = space.ray.shape[1:]
        self._usual = np.full(shape, np.inf, dtype=np.float32)
        self._nothing = np.zeros(shape, dtype=np.bool_)
        self._still: tuple[Field, Mask] | None = None

    def look(self, depth: Field, hidden: Mask | None, known: Capsules | None = None) -> Relief:
        """Take in a small picture of distances along the view, 0 where there is none [m].

        ``hidden``: small mask of where something known, such as the arm, is before the table; ``known``: where that is
        in space. What ``hidden`` covers is seen nevertheless if it is outside of all of these; None: nothing is seen
        there.
        """
        space = self._space
        found = stand_out(
            depth, space.ray, space.position, self._mask(hidden), self._usual, self._limits, _EVERYWHERE,
            (known or _NONE).ends, (known or _NONE).radii,
        )  # fmt: skip
        mask: Picture = np.asarray(cv2.morphologyEx(np.minimum(found, 1), cv2.MORPH_OPEN, _SMALL), dtype=np.uint8)
        away = self._leave_out_beyond(depth, found, mask)
        count, labels = cv2.connectedComponents(mask, connectivity=8)
        if count == 1:
            return self._nobody(depth, hidden, away)
        parts = np.asarray(labels, dtype=np.int32)
        areas, high, enters = measure_parts(
            parts, count, found, depth, space.ray, space.position, space.pixel, self._half - np.float32(_RIM), _BORDER
        )
        chosen = (high >= _LEAST) | (enters & (areas >= _REACH)) | (areas >= _LARGE)
        if not chosen.any():
            return self._nobody(depth, hidden, away)
        self._still = None
        counts = squares_under(parts, chosen, depth, space.ray, space.position, self._table.square, _TOUCHING)
        over, low = _covered(counts[0]), _covered(counts[1])
        before = bool(over or chosen[parts[space.board]].any())
        return Relief(float(areas[chosen].sum()), over, low, before, 0.0, away)

    def shown(self, depth: Field, hidden: Mask | None) -> float:
        """Of the pixels in which board and pieces are to be seen, but for what is hidden, the share that has depth; 1
        where all is hidden.
        """
        where = self._space.board & ~self._mask(hidden)
        count = np.count_nonzero(where)
        return np.count_nonzero(where & (depth > 0.0)) / count if count else 1.0

    def _leave_out_beyond(self, depth: Field, found: Picture, mask: Picture) -> Array:
        """Points of what was found beyond what is watched; pixels of it are taken out of ``found`` and ``mask``."""
        space, rows, columns = self._space, *np.nonzero(found)
        points = depth[rows, columns] * space.ray[:, rows, columns] + space.position[:, None]
        beyond = (np.abs(points[0]) >= self._half[0]) | (np.abs(points[1]) >= self._half[1])
        rows, columns, points = rows[beyond], columns[beyond], points[:, beyond]
        sure = mask[rows, columns] > 0
        found[rows, columns], mask[rows, columns] = 0, 0
        return np.asarray(points[:, sure].T, dtype=float)

    def _nobody(self, depth: Field, hidden: Mask | None, away: Array) -> Relief:
        """No hand is there: what has become higher or lower moves by itself."""
        covered = self._mask(hidden)
        if self._still is None:
            self._still = depth, covered
            return Relief(0.0, _NO_SQUARES, _NO_SQUARES, before=False, moving=0.0, away=away)
        then, covered_then = self._still
        rises = np.abs(depth - then) * np.abs(self._space.ray[2])
        seen = self._space.board & (depth > 0.0) & (then > 0.0) & ~covered & ~covered_then
        changed = cv2.morphologyEx(((rises > _STANDS) & seen).astype(np.uint8), cv2.MORPH_OPEN, _SMALL) > 0
        area = float(self._space.pixel * (depth[changed] ** 2).sum())
        if area > _MOVES:
            self._still = depth, covered
        return Relief(0.0, _NO_SQUARES, _NO_SQUARES, before=False, moving=area, away=away)

    def learn(self, depth: Field, hidden: Mask | None, *, moved: bool) -> None:
        """A picture of the settled board; arguments as of ``Differences.learn``."""
        space = self._space
        share = 1.0 if moved else _LEARNING
        learn_heights(depth, space.ray[2], self._mask(hidden), self._usual, float(space.position[2]), share)

    def _mask(self, hidden: Mask | None) -> Mask:
        return self._nothing if hidden is None else hidden


def _covered(counts: NDArray[np.int64]) -> frozenset[int]:
    """Squares of which at least a few pixels are counted."""
    return frozenset(np.flatnonzero(counts >= 6).tolist())
