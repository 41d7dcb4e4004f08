"""Loops over pixels, compiled by Numba: what NumPy would do in a dozen passes over pictures, each into new memory.

Nothing is decided here but what the arguments say. Sums are of double precision, everything else is single, in the
order in which it is written: the results are those of the same formulas in NumPy, to rounding. Compiled when the module
is imported the first time, and kept on disk by Numba; no function here calls one of another file, whose edit Numba's
cache would not notice.

Arguments have these meanings: ``depth`` (h, w) is 0 where there is none [m]; ``square`` (h, w) is that of each pixel,
``where`` (h, w) tells which pixels count; ``ray`` (3, h, w) are rays by pixel (``vision.hands.watched_zone.Space``)
from the ``position`` (3,) of the camera [m]; ``hidden`` (h, w) is where something known is before the table.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

from hardware.loading import spare_blas
from vision.arrays import Array, Field, Mask, Picture, Whole

_F = TypeVar("_F", bound=Callable[..., Any])
_numba: Any = numba  # its own types are incomplete
types: Any = numba.types
spare_blas()


def _loop(signature: Any) -> Callable[[_F], _F]:
    """Compile a function of such types now, or take it from the disk."""
    return cast("Callable[[_F], _F]", _numba.njit(signature, cache=True, nogil=True))


_FIELD: Final = types.float32[:, :]
_MASK: Final = types.boolean[:, :]
_ENDS: Final = types.Array(types.float64, 3, "C", readonly=True)
_RADII: Final = types.Array(types.float64, 1, "C", readonly=True)
_SQUARES: Final = types.int32[:, ::1]


@_loop(
    types.Tuple((types.int32[:, ::1], types.float32[:, ::1], types.boolean[:, ::1]))(
        _FIELD, types.float32[:, ::1], types.float32[:, ::1], types.float32[::1], types.float32,
    )
)  # fmt: skip
def lay_out(depth: Field, rows: Field, columns: Field, start: Field, reach: float) -> tuple[Any, Field, Mask]:
    """Over which square the points of a depth picture are, and how high.

    A point's coordinate along an axis is depth · (rows + columns) + start, with shapes (3, h), (3, w) and (3,): x and y
    in sides of a square from the outer corner of a1, z in metres. A point is over the middle of a square up to
    ``reach`` from its centre, along both axes.

    Returns:
        Squares (h, w), 64 beside the board and where there is no depth; heights (h, w) [m]; and which points are over
        the middle of their square, (h, w).
    """
    height, width = depth.shape
    square = np.full((height, width), 64, dtype=np.int32)
    z = np.empty((height, width), dtype=np.float32)
    middle = np.zeros((height, width), dtype=np.bool_)
    half = np.float32(0.5)
    for i in range(height):
        for j in range(width):
            away = depth[i, j]
            z[i, j] = (rows[2, i] + columns[2, j]) * away + start[2]
            x = (rows[0, i] + columns[0, j]) * away + start[0]
            y = (rows[1, i] + columns[1, j]) * away + start[1]
            file, rank = np.floor(x), np.floor(y)
            if away > 0.0 and file >= 0.0 and file < 8.0 and rank >= 0.0 and rank < 8.0:
                square[i, j] = np.int32(8.0 * rank + file)
                middle[i, j] = abs(x - file - half) < reach and abs(y - rank - half) < reach
    return square, z, middle


@_loop(
    types.Tuple((types.float64[:, ::1], types.int64[::1]))(
        types.uint8[:, :, :], types.float32[::1], _SQUARES, types.boolean[:, ::1],
    )
)  # fmt: skip
def colour_sums(picture: Picture, level: Field, square: Any, where: Mask) -> tuple[Array, Any]:
    """Sums (65, 3) over those pixels of each square that count, and how many they are, (65,); ``level`` is what is
    added for each value of a pixel, (256,).
    """
    sums, count = np.zeros((65, 3)), np.zeros(65, dtype=np.int64)
    for i in range(square.shape[0]):
        for j in range(square.shape[1]):
            if where[i, j]:
                k = square[i, j]
                count[k] += 1
                for band in range(3):
                    sums[k, band] += level[picture[i, j, band]]
    return sums, count


@_loop(types.float64[::1](_SQUARES, types.boolean[:, ::1], types.float32[:, ::1], types.int64[::1], types.float64))
def tops(square: Any, where: Mask, value: Field, count: Any, share: float) -> Array:
    """The value below which a share of those pixels of each square are that count, (64,), 0 where none do; ``count`` of
    them in each, (64,).
    """
    begin = np.zeros(65, dtype=np.int64)
    begin[1:] = np.cumsum(count)
    ordered, filled = np.empty(begin[64], dtype=np.float32), begin[:64].copy()
    for i in range(square.shape[0]):
        for j in range(square.shape[1]):
            k = square[i, j]
            if where[i, j] and k < 64:
                ordered[filled[k]] = value[i, j]
                filled[k] += 1
    found = np.zeros(64)
    for k in range(64):
        if count[k]:
            part = np.sort(ordered[begin[k] : begin[k + 1]])
            found[k] = part[int(share * count[k])]
    return found


@_loop(types.Tuple((types.float32[:, :, ::1], types.float32[:, ::1]))(types.float32[:, :, ::1]))
def slopes_of(level: Field) -> tuple[Field, Field]:
    """Gradients of three fields (h, w, 3) by Sobel's filter, mirrored at the border: along columns, then along rows,
    (h, w, 6) [1/px]; and their length over all three, (h, w).
    """
    height, width = level.shape[:2]
    slopes, size = np.empty((height, width, 6), dtype=np.float32), np.empty((height, width), dtype=np.float32)
    eighth, two = np.float32(0.125), np.float32(2.0)
    for i in range(height):
        above, below = abs(i - 1), (i + 1 if i + 1 < height else height - 2)
        for j in range(width):
            left, right = abs(j - 1), (j + 1 if j + 1 < width else width - 2)
            square = np.float32(0.0)
            for band in range(3):
                a, b, c = level[above, left, band], level[above, j, band], level[above, right, band]
                d, f = level[i, left, band], level[i, right, band]
                g, h, k = level[below, left, band], level[below, j, band], level[below, right, band]
                across = eighth * ((c - a) + two * (f - d) + (k - g))
                down = eighth * ((g - a) + two * (h - b) + (k - c))
                slopes[i, j, band], slopes[i, j, 3 + band] = across, down
                square += across * across + down * down
            size[i, j] = np.sqrt(square)
    return slopes, size


@_loop(
    types.float64[:, ::1](
        types.float32[:, :, ::1], types.float32[:, :, ::1], types.float32[:, :, ::1], types.float32[:, :, ::1],
        types.float32[:, ::1], types.float32[:, ::1], types.int64, types.int64, types.int64,
    )
)  # fmt: skip
def changes(
    level: Field, old_level: Field, slopes: Field, old_slopes: Field, size: Field, old_size: Field,
    margin: int, side: int, edge: int,
) -> Array:  # fmt: skip
    """How much two plans differ in the middle of each square, by levels (h, w, 3), slopes (h, w, 6) and their sizes (h,
    w): means of |Δlevel| over all colours, of the length of Δslopes, and of both sizes' sum; shape (64, 3), a1 first.

    There is a margin around the board; an edge is left out at each side of a square; all [px].
    """
    means = np.zeros((64, 3))
    area = (side - 2 * edge) ** 2
    for square in range(64):
        top, first = margin + (7 - square // 8) * side, margin + (square % 8) * side
        for i in range(top + edge, top + side - edge):
            for j in range(first + edge, first + side - edge):
                colour, moved = np.float32(0.0), np.float32(0.0)
                for band in range(3):
                    colour += abs(level[i, j, band] - old_level[i, j, band])
                for band in range(6):
                    step = slopes[i, j, band] - old_slopes[i, j, band]
                    moved += step * step
                means[square, 0] += colour
                means[square, 1] += np.sqrt(moved)
                means[square, 2] += size[i, j] + old_size[i, j]
        means[square] /= area
    return means


@_loop(types.boolean(types.float64, types.float64, types.float64, _ENDS, _RADII))
def _within(x: float, y: float, z: float, ends: Array, radii: Array) -> bool:
    """Whether a point is within any of some capsules; ``ends`` (n, 2, 3), ``radii`` (n,)."""
    for k in range(len(radii)):
        ax, ay, az = ends[k, 0, 0], ends[k, 0, 1], ends[k, 0, 2]
        bx, by, bz = ends[k, 1, 0] - ax, ends[k, 1, 1] - ay, ends[k, 1, 2] - az
        px, py, pz = x - ax, y - ay, z - az
        length = bx * bx + by * by + bz * bz
        along = (px * bx + py * by + pz * bz) / length if length > 0.0 else 0.0
        along = min(max(along, 0.0), 1.0)
        px, py, pz = px - along * bx, py - along * by, pz - along * bz
        if px * px + py * py + pz * pz < radii[k] * radii[k]:
            return True
    return False


@_loop(
    types.uint8[:, ::1](
        _FIELD, types.float32[:, :, ::1], types.float32[::1], _MASK, _FIELD, types.float32[::1], types.float32[::1],
        _ENDS, _RADII,
    )
)  # fmt: skip
def stand_out(
    depth: Field, ray: Field, position: Field, hidden: Mask, usual: Field, limits: Field, half: Field, ends: Array,
    radii: Array,
) -> Picture:  # fmt: skip
    """Pixels of a depth picture that show what is higher than it should be: 2 where something tall is, 1 where
    something low is, else 0; shape (h, w).

    ``usual`` are the heights of the settled board, (h, w) [m], infinite where they are not known. A tall thing is
    higher than the first of ``limits`` and lower than the second; a low one is higher than the third and by more than
    the fourth higher than usual, (4,) [m]. ``half`` are half sizes of what is watched along x and y, (2,) [m]. What
    ``hidden`` covers is seen nevertheless if it is outside of all capsules, given by ``ends`` (n, 2, 3) and ``radii``
    (n,) [m]; with none it is not.
    """
    height, width = depth.shape
    found = np.zeros((height, width), dtype=np.uint8)
    for i in range(height):
        for j in range(width):
            away = depth[i, j]
            z = away * ray[2, i, j] + position[2]
            if not (away > 0.0 and z < limits[1]):
                continue
            tall = z > limits[0]
            if not (tall or (z > limits[2] and z - usual[i, j] > limits[3])):
                continue
            x, y = away * ray[0, i, j] + position[0], away * ray[1, i, j] + position[1]
            if not (abs(x) < half[0] and abs(y) < half[1]):
                continue
            if hidden[i, j] and (len(radii) == 0 or _within(x, y, z, ends, radii)):
                continue
            found[i, j] = 2 if tall else 1
    return found


@_loop(
    types.Tuple((types.float64[::1], types.float64[::1], types.boolean[::1]))(
        types.int32[:, ::1], types.int64, types.uint8[:, ::1], _FIELD, types.float32[:, :, ::1], types.float32[::1],
        types.float32, types.float32[::1], types.int64,
    )
)  # fmt: skip
def measure_parts(
    labels: Whole, count: int, found: Picture, depth: Field, ray: Field, position: Field,
    pixel: float, inner: Field, border: int,
) -> tuple[Array, Array, Mask]:  # fmt: skip
    """Areas of connected parts of a depth picture, and of what is tall in them [m²]; which come in from outside: each
    (count,).

    ``labels`` are those of the parts, 0 beside them, ``count`` their number, ``found`` as of `stand_out`, ``pixel`` the
    area that a pixel covers at depth 1. What is further out than ``inner`` along x and y, (2,) [m], or as near to the
    picture's edge as ``border`` [px], comes in from outside.
    """
    height, width = labels.shape
    areas, high, enters = np.zeros(count), np.zeros(count), np.zeros(count, dtype=np.bool_)
    for i in range(height):
        for j in range(width):
            part = labels[i, j]
            if part == 0:
                continue
            away = depth[i, j]
            area = away * away * pixel
            areas[part] += area
            if found[i, j] == 2:
                high[part] += area
            if not enters[part]:
                x, y = away * ray[0, i, j] + position[0], away * ray[1, i, j] + position[1]
                edge = i < border or j < border or i >= height - border or j >= width - border
                enters[part] = edge or abs(x) > inner[0] or abs(y) > inner[1]
    return areas, high, enters


@_loop(
    types.int64[:, ::1](
        types.int32[:, ::1], types.boolean[::1], _FIELD, types.float32[:, :, ::1], types.float32[::1], types.float32,
        types.float32,
    )
)  # fmt: skip
def squares_under(
    labels: Whole, chosen: Mask, depth: Field, ray: Field, position: Field, side: float, low: float
) -> NDArray[np.int64]:
    """Pixels of chosen parts of a depth picture (labels as of `measure_parts`) over each square, of a side [m], and
    those of them lower than ``low`` [m]: shape (2, 64).
    """
    counts, four = np.zeros((2, 64), dtype=np.int64), np.float32(4.0)
    for i in range(labels.shape[0]):
        for j in range(labels.shape[1]):
            if not chosen[labels[i, j]]:
                continue
            away = depth[i, j]
            file = np.floor((away * ray[0, i, j] + position[0]) / side + four)
            rank = np.floor((away * ray[1, i, j] + position[1]) / side + four)
            if file >= 0.0 and file < 8.0 and rank >= 0.0 and rank < 8.0:
                square = int(file + 8.0 * rank)
                counts[0, square] += 1
                if away * ray[2, i, j] + position[2] < low:
                    counts[1, square] += 1
    return counts


@_loop(types.void(_FIELD, types.float32[:, ::1], _MASK, types.float32[:, ::1], types.float32, types.float32))
def learn_heights(depth: Field, ray: Field, hidden: Mask, usual: Field, position: float, share: float) -> None:
    """Take a picture of the settled board into its usual heights (h, w) [m], in place; infinite ones are not known.

    ``ray`` are heights at depth 1 less that of the camera, (h, w), whose height is ``position`` [m]; pixels that are
    hidden are left alone. Where heights are known already the new picture has a ``share``.
    """
    for i in range(depth.shape[0]):
        for j in range(depth.shape[1]):
            away = depth[i, j]
            if away > 0.0 and not hidden[i, j]:
                z = away * ray[i, j] + position
                before = usual[i, j]
                usual[i, j] = before + share * (z - before) if np.isfinite(before) else z
