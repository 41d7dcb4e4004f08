"""What stands up from the board, square by square, by depth.

Each pixel with a depth is a point of a surface. Points over a square that are higher than the board belong to what
stands there, whatever they hide in the picture behind them: depth does not lean.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from hardware.interfaces import Frame
from vision.arrays import Array, Field, Indices, Mask, Picture, Whole
from vision.board.view import BoardView
from vision.loops import colour_sums, lay_out, tops
from vision.reading.visibility import hidden_by, room_of

DARKEST: Final = 0.08  # added to brightness (0 to 1) before its logarithm: below it there is more noise than picture
LOGARITHM: Final[Field] = np.log(np.arange(256) / 255.0 + DARKEST).astype(np.float32)  # by a pixel's level, 0 to 255
TALL: Final = 0.012
"""What is higher than this is no board [m]: a pawn is 34 mm high, the depth of a D435 errs by 1 to 2 mm at 0.6 m."""
CEILING: Final = 0.08  # what is higher than this is no piece, but a hand or the arm [m]
HOVERING: Final = 0.12
"""What is higher than this touches nothing on the board, nor does what it belongs to [m]: fingers that hold a piece
have parts between this and the ceiling, and an arm that rests over the board has none."""
REACH: Final = 0.45  # points count for a square up to so far from its centre, along both axes [sides of a square]
HIGHEST: Final = 0.9  # of the points of a piece, this share is below what counts as its top: single points fly
OFF_BOARD: Final = 65  # label of what stands beside the board or hangs over it; squares are 1 to 64
FAT: Final = 5  # depth is fat at edges, by 2 px on each side: there the colour is that of what lies behind [px]
CORE: Final = 12  # points without such edges by which a colour is told; where there are fewer, all count


@dataclass(frozen=True, slots=True, eq=False)
class Solids:
    """What stands on each square, a1 first.

    Attributes:
        seen: number of points over the square, but not hovering; shape (64,).
        standing: number of those that are no board and no hand; shape (64,).
        above: number of those above any piece, but not hovering; shape (64,).
        room: how likely a piece would stand there and not be seen, 0 to 1; shape (64,). See
        ``vision.reading.visibility``.
        other: where, in the picture, things that stand elsewhere hide the middle of each square, shape (64, cells).
        top: height of what stands there, shape (64,) [m]; 0 where nothing does.
        colour: mean of the natural logarithm of red, green and blue (0 to 1, plus ``DARKEST``) of the standing
            points, without the edges of what stands there, shape (64, 3); 0 where there are none.
    """

    seen: Indices
    standing: Indices
    above: Indices
    top: Array
    colour: Array
    room: Array
    other: Mask


def solids_of(frame: Frame, view: BoardView) -> Solids:
    """What stands on the board in a frame with depth.

    Raises:
        ValueError: the frame has no depth.
    """
    if frame.depth is None:
        raise ValueError("this frame has no depth: solids need a camera that has it")
    window, square, z, over = _points(frame.depth, view)
    stands = over & (z > TALL) & (z < CEILING)
    count = np.bincount(square[stands], minlength=64)
    core = cv2.erode(stands.astype(np.uint8), np.ones((FAT, FAT), np.uint8)).astype(np.bool_)
    colour, cored = _colour(frame.colour[window], square, core)
    if (cored < CORE).any():
        whole, _ = _colour(frame.colour[window], square, stands)
        colour = np.where((cored < CORE)[:, None], whole, colour)
    above = np.bincount(square[over & (z >= CEILING) & (z < HOVERING)], minlength=64)
    seen = np.bincount(square[over & (z < HOVERING)], minlength=64)
    label = np.zeros(frame.depth.shape, dtype=np.uint8)
    up, on_board = (z > TALL) & (frame.depth[window] > 0.0), (square < 64) & (z < CEILING)
    label[window] = np.where(up, np.where(on_board, square + 1, OFF_BOARD), 0)
    top = tops(square, stands, z, count, HIGHEST)
    return Solids(seen, count, above, top, colour, room_of(frame.depth, view), hidden_by(label, view))


def _colour(picture: Picture, square: Whole, where: Mask) -> tuple[Array, Indices]:
    """Mean logarithmic colour of each square's points, shape (64, 3), and how many they are."""
    sums, count = colour_sums(picture, LOGARITHM, square, where)
    return sums[:64] / np.maximum(count[:64], 1)[:, None], count[:64]


def _points(depth: Field, view: BoardView) -> tuple[tuple[slice, slice], Whole, Field, Mask]:
    """The part of a picture that may show the board or what stands on it, and the points of its pixels.

    Returns:
        Rows and columns of the part; then for each of its pixels the square, the height [m], and whether it is over the
        middle of the square; see ``vision.loops.lay_out``.
    """
    half = 4.0 * view.table.square
    box = np.array([[x, y, z] for x in (-half, half) for y in (-half, half) for z in (0.0, CEILING)])
    pixels = view.project(box)
    h, w = depth.shape
    left, top = np.clip(np.floor(pixels.min(axis=0)), 0, (w, h)).astype(int)
    right, bottom = np.clip(np.ceil(pixels.max(axis=0)), 0, (w, h)).astype(int)
    window = slice(top, bottom), slice(left, right)
    pinhole, turn, shift = view.intrinsics, view.camera_from_board[:3, :3], view.camera_from_board[:3, 3]
    u = (np.arange(left, right) - pinhole.cx) / pinhole.fx
    v = (np.arange(top, bottom) - pinhole.cy) / pinhole.fy
    rows, columns, start = [], [], []
    for axis in range(3):  # a point is its ray times its depth, turned into the board frame: linear in columns and rows
        a, b, c = turn[:, axis]
        offset = -float(turn[:, axis] @ shift)
        scale = 1.0 if axis == 2 else 1.0 / view.table.square
        start.append(offset * scale + (0.0 if axis == 2 else 4.0))
        rows.append((b * v + c) * scale)
        columns.append(a * u * scale)
    across, along, origin = (np.array(one, dtype=np.float32) for one in (rows, columns, start))
    square, z, over = lay_out(depth[window], across, along, origin, REACH)
    return window, square, z, over
