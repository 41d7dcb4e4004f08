"""Where on each square a piece could stand and not be seen, and what hides the square in the picture, by depth.

That no point of a square stands up says little where a queen in front hides most of it, or where one of the two
imagers of a depth camera is blinded by it. What tells an empty square is that lines of sight have passed where a piece
would have stopped them. So pieces are tried all over each square: the lowest there are, since what is higher is seen
the more. A place is free if enough points within a piece there have been seen through.

Without depth there is perspective: a piece, taken as an upright cylinder as high and as wide as an average one, covers
a part of the plan behind its square.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np

from hardware.piece_set import PIECE_SHAPES, Kind, piece_profile
from vision.arrays import Array, Field, Indices, Mask, Picture
from vision.board.view import BoardView

PLACES: Final = 7  # along each axis of a square, at which a piece is tried
REACH: Final = 0.42  # they lie up to so far from the middle [sides of a square]; closer together than a piece's radius
USUAL: Final = 0.15  # standard deviation of how far off the middle people put pieces [sides of a square]
LEVELS: Final = (0.10, 0.15, 0.47, 0.80, 0.91)
"""Heights at which a piece is tried: foot, stem and head, where it is wide [heights of the lowest piece]."""
ASIDE: Final = (-0.6, 0.0, 0.6)
"""So far from its axis it is tried at each height, across the view [radii there]. Beside a piece a stereo camera is
blind in a strip that is narrower than a piece: axes alone would lie in it too often."""
BEHIND: Final = 0.002
"""What is seen further behind a point than this has been seen through it [m]; a piece is seen before these points, by
most of its radius and more."""
ENOUGH: Final = 3  # with so many of a place's points seen through, nothing stands there: a ray or two may err
CELLS: Final = 6  # along each axis of a square's middle, in which it is told what hides the square
MIDDLE: Final = 0.8  # share of a square's side that counts as its middle
RADIUS: Final = 0.30
HEIGHTS: Final = (1.0, 1.2, 1.65)
"""Of a pawn, of knight, bishop and rook, and of queen and king [squares]: tournament sets are 1 (pawn) to 1.7 (king)
squares high, with feet of 0.6 to 0.8."""
COUNTED: Final = 12  # along a square, when shares are counted


def room_of(depth: Field, view: BoardView) -> Array:
    """How likely a piece on each square would have gone unseen, by where pieces are put: shape (64,), 0 to 1.

    In depth, (height, width) [m], 0 is where nothing was measured.
    """
    pixels, away, usual = _trials(view)
    seen = depth.ravel().take(pixels) > away
    free = np.count_nonzero(seen, axis=0) >= ENOUGH
    return np.asarray(np.where(free, 0.0, usual).sum(axis=1))


@lru_cache(maxsize=4)
def _trials(view: BoardView) -> tuple[Indices, Field, Array]:
    """Pixels where pieces are looked for and the depth behind, (points, 64, places); the places' weights, (places,)."""
    steps = np.linspace(-REACH, REACH, PLACES)
    places = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    usual = np.exp(-0.5 * (places**2).sum(axis=1) / USUAL**2)
    middles = (_middles()[:, None] + places) * view.table.square
    within = _points_within(min(PIECE_SHAPES, key=lambda kind: PIECE_SHAPES[kind].height), view)
    points = np.empty((len(within), 64, len(places), 3))
    points[..., :2] = middles + within[:, None, None, :2]
    points[..., 2] = within[:, None, None, 2]
    size = view.intrinsics.width, view.intrinsics.height
    column, row = np.moveaxis(np.rint(view.project(points)), -1, 0).astype(np.intp)
    away = (view.depth(points) + BEHIND).astype(np.float32)
    # what lies outside of the picture is never seen through
    away[(column < 0) | (column >= size[0]) | (row < 0) | (row >= size[1])] = np.inf
    return column.clip(0, size[0] - 1) + size[0] * row.clip(0, size[1] - 1), away, usual / usual.sum()


def _points_within(kind: Kind, view: BoardView) -> Array:
    """Points within a piece, from the middle of its foot, across the view: (points, 3) [m]."""
    radius, height = np.array(piece_profile(kind)).T
    levels = PIECE_SHAPES[kind].height * np.array(LEVELS)
    across = view.camera_from_board[0, :2] / np.linalg.norm(view.camera_from_board[0, :2])
    aside = np.interp(levels, height, radius)[:, None, None] * np.array(ASIDE)[:, None] * across
    points = np.empty((len(LEVELS), len(ASIDE), 3))
    points[..., :2], points[..., 2] = aside, levels[:, None]
    return points.reshape(-1, 3)


def hidden_by(label: Picture, view: BoardView) -> Mask:
    """Where the picture of a square's surface shows what stands elsewhere: shape (64, CELLS²).

    The label of a pixel is 0 where it shows the board or nothing is known, 1 to 64 where it shows what stands on the
    square a1 to h8, more where it shows anything else; shape (height, width).
    """
    seen = label.ravel().take(_cells(view))
    return np.asarray((seen > 0) & (seen != np.arange(1, 65)[:, None]))


@lru_cache(maxsize=4)
def _cells(view: BoardView) -> Indices:
    """Pixels that show the cells of squares' middles, (64, CELLS²); beyond the picture its nearest pixel."""
    steps = MIDDLE * ((np.arange(CELLS) + 0.5) / CELLS - 0.5)
    points = np.zeros((64, CELLS * CELLS, 3))
    points[..., :2] = _middles()[:, None] + np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    column, row = np.moveaxis(np.rint(view.project(points * view.table.square)), -1, 0).astype(np.intp)
    width, height = view.intrinsics.width, view.intrinsics.height
    return np.asarray(column.clip(0, width - 1) + width * row.clip(0, height - 1))


def _middles() -> Array:
    """Of the squares, shape (64, 2) [sides of a square]."""
    return np.array([(square % 8 - 3.5, square // 8 - 3.5) for square in range(64)])


def cover(camera: Array) -> Array:
    """Share of each square's middle that a piece on another one covers in the plan, seen from a pinhole (3,) [squares].

    Shape (3, 64, 64), read-only: how high the piece is, as in ``HEIGHTS``; row the square with the piece, column the
    covered square. The diagonals are 1.
    """
    x, y, z = (round(float(value), 1) for value in camera)  # nearer than that, nothing differs
    return _covers(x, y, z)


@lru_cache(maxsize=8)
def _covers(x: float, y: float, z: float) -> Array:
    shares = np.array([_cover(x, y, z, height) for height in HEIGHTS])
    shares.flags.writeable = False
    return shares


def _cover(x: float, y: float, z: float, height: float) -> Array:
    camera = np.array([x, y])
    above = max(z, height + 0.5)  # a camera among the pieces sees no board
    steps = (np.arange(COUNTED) + 0.5) / COUNTED
    steps = steps[np.abs(steps - 0.5) < 0.4]  # the middle of a square: its edge may belong to a neighbour
    shares = np.eye(64)
    points = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    origins = np.array([(square % 8, square // 8) for square in range(64)], dtype=float)
    for square, origin in enumerate(origins):
        foot = origin + 0.5
        scale = above / (above - height)
        head = camera + (foot - camera) * scale
        grid = origins[:, None, :] + points
        # nearest point of the axis' picture; the piece's picture grows from foot to head
        axis = head - foot
        along = np.clip(((grid - foot) @ axis) / max(float(axis @ axis), 1e-9), 0.0, 1.0)
        distance = np.linalg.norm(grid - foot - along[..., None] * axis, axis=-1)
        shares[square] = (distance < RADIUS * (1.0 + along * (scale - 1.0))).mean(axis=1)
    np.fill_diagonal(shares, 1.0)
    return shares
