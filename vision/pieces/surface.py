"""Which part of the board each pixel looks at: made once for a view, used for every frame."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hardware.piece_set import PIECE_SHAPES
from vision.arrays import Field, Whole
from vision.board.view import BoardView, playing_area

LIGHT, DARK, BESIDE, SEAM = 0, 1, 2, 3
"""What a pixel would show if nothing stood there: a light square, a dark one, what is beside the board, or
a mixture where two of these meet."""
GROUNDS: Final = 4
MARGIN: Final = 14
"""Around the board and what stands on it [px]."""
_SEAM: Final = 1.2  # so far to either side of a line between squares a pixel shows both [px]


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """The window of a picture in which board and pieces lie, pixel by pixel; shape of all fields (h, w)."""

    rows: slice  # of the picture
    columns: slice  # of the picture
    ground: Whole  # ``LIGHT``, ``DARK`` or ``BESIDE``, int32
    square: NDArray[np.int16]  # index of the square, -1 beside the board, int16
    place: Field  # point of the board's plane that would be seen, (h, w, 2), board frame [m]
    depth: Field  # of the board's plane along the view [m]
    climb: Field  # by how much a point whose depth is less than the plane's by 1 m is above the plane


@lru_cache(maxsize=4)
def surface(view: BoardView, around: tuple[float, float] = (0.0, 0.0)) -> Surface:
    """Of a view; things are looked at so far beyond the board along x and along y [m].

    Raises:
        ValueError: the board is not in the picture.
    """
    rows, columns = _window(view, around)
    v, u = np.mgrid[rows, columns].astype(float)
    eye = view.intrinsics
    ray = np.stack([(u - eye.cx) / eye.fx, (v - eye.cy) / eye.fy, np.ones_like(u)], axis=-1)
    rotation, shift = view.camera_from_board[:3, :3], view.camera_from_board[:3, 3]
    up = rotation[:, 2]
    depth = (up @ shift) / (ray @ up)
    place = (ray * depth[..., None] - shift) @ rotation[:, :2] / view.table.square + 4.0
    whole = np.floor(place)
    on_board = ((whole >= 0.0) & (whole < 8.0)).all(axis=-1)
    column, row = whole[..., 0], whole[..., 1]
    light = (column + row) % 2.0 == 1.0  # a1 is dark
    ground = np.where(on_board, np.where(light, LIGHT, DARK), BESIDE).astype(np.int32)
    square = np.where(on_board, column + 8.0 * row, -1.0).astype(np.int16)
    to_line = np.abs(place - np.clip(np.rint(place), 0.0, 8.0))
    pixel = np.stack([np.abs(np.gradient(place[..., axis])).sum(axis=0) for axis in (0, 1)], axis=-1)
    within = ((place > -pixel) & (place < 8.0 + pixel)).all(axis=-1)
    seam = within & (to_line < _SEAM * pixel).any(axis=-1)
    ground[seam] = SEAM
    points = ((place - 4.0) * view.table.square).astype(np.float32)
    return Surface(rows, columns, ground, square, points, depth.astype(np.float32), (-(ray @ up)).astype(np.float32))


def _window(view: BoardView, around: tuple[float, float]) -> tuple[slice, slice]:
    """Where board and pieces can be seen."""
    tallest = max(shape.height for shape in PIECE_SHAPES.values())
    ground = playing_area(view.table)
    ground[:, :2] *= 1.0 + np.array(around) / (4.0 * view.table.square)
    pixels = view.project(np.concatenate([ground, ground + np.array([0.0, 0.0, tallest])]))
    low = np.floor(pixels.min(axis=0)).astype(int) - MARGIN
    high = np.ceil(pixels.max(axis=0)).astype(int) + MARGIN
    u0, v0 = np.maximum(low, 0).tolist()
    u1, v1 = np.minimum(high, (view.intrinsics.width, view.intrinsics.height)).tolist()
    if u1 - u0 < 2 or v1 - v0 < 2:
        raise ValueError("the board lies outside of the picture: turn the camera towards it")
    return slice(v0, v1), slice(u0, u1)


def raised(part: Surface, rises: Field, view: BoardView) -> Field:
    """The points that pixels show, board frame (h, w, 3) [m]: along its ray, what is above the board is as much nearer
    to the camera. NaN where the height is unknown.
    """
    share = 1.0 - rises / np.maximum(part.climb * part.depth, np.float32(1e-6))
    eye = view.camera_position[:2].astype(np.float32)
    return np.concatenate([eye + (part.place - eye) * share[..., None], rises[..., None]], axis=-1)


def heights(frame_depth: Field, part: Surface) -> Field:
    """Height above the board's plane of what each pixel shows [m]; NaN where depth is unknown."""
    seen = frame_depth[part.rows, part.columns]
    return np.where(seen > 0.0, (part.depth - seen) * part.climb, np.float32(np.nan)).astype(np.float32)
