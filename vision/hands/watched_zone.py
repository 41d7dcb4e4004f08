"""The part of a picture that is watched, at half the picture's size: over the board, its rim, and all squares.

Small pictures have every second pixel of a full one along both axes; what is said of areas is in squares of the board.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import ArrayLike

from hardware.interfaces import Intrinsics
from hardware.piece_set import PIECE_SHAPES
from vision.arrays import Array, Field, Indices, Mask, Picture
from vision.board.view import BoardView, playing_area

SMALL: Final = 320  # pictures are made smaller by a whole number, to about this width [px]
NO_SQUARE: Final = 64
_RIM: Final = 0.3
"""The rim is so wide [squares] …"""
_EDGE: Final = 4  # … or this at the edge of the small picture [px]


def step_of(width: int) -> int:
    """Of how many pixels along each axis one pixel of the small picture is made."""
    return max(1, round(width / SMALL))


def shrink(colour: Picture, step: int) -> Picture:
    """The small picture of a full one: means of ``step`` × ``step`` pixels."""
    if step == 1:
        return colour
    height, width = colour.shape[:2]
    small = cv2.resize(colour, (width // step, height // step), interpolation=cv2.INTER_AREA)
    return np.asarray(small, dtype=np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class Zone:
    """What is watched of a picture."""

    step: int  # see ``step_of``
    board: Mask  # small mask of the playing area
    around: Mask  # of the playing area and a margin about it
    rim: Mask  # the outermost pixels of ``around``: what reaches in from outside crosses them
    square: Indices  # number of the square seen in each pixel of the small picture, ``NO_SQUARE`` where there is none
    square_area: float  # mean area of a square in the small picture [px]

    @classmethod
    def of_corners(cls, corners: ArrayLike, size: tuple[int, int], margin: float) -> Zone:
        """From the picture of the board's outer corners a1, h1, h8, a8 alone, shape (4, 2) [px of the full picture].

        ``size``: width and height of the full picture [px]; ``margin``: about the playing area [squares].

        Raises:
            ValueError: the corners are not four finite points, or enclose nothing.
        """
        pixels = np.asarray(corners, dtype=np.float64)
        if pixels.shape != (4, 2) or not np.isfinite(pixels).all():
            raise ValueError(f"corners of shape {pixels.shape} were given: give four finite points a1, h1, h8, a8")
        step = step_of(size[0])
        small = ((pixels + 0.5) / step - 0.5).astype(np.float32)
        width, height = size[0] // step, size[1] // step
        area = abs(float(cv2.contourArea(small))) / 64.0
        if area < 4.0:
            raise ValueError(f"a square of {area * step * step:.0f} px² is too small to watch: bring the camera closer")
        grid = np.array([[0, 0], [8, 0], [8, 8], [0, 8]], dtype=np.float32)
        to_grid = cv2.getPerspectiveTransform(small, grid)
        u, v = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
        x, y, w = np.tensordot(to_grid, np.stack([u, v, np.ones_like(u)]), axes=1)
        ahead = w * np.sign((to_grid @ np.append(small.mean(axis=0), 1.0))[2]) > 1e-9
        x, y = (np.where(ahead, one / np.where(ahead, w, 1.0), np.inf) for one in (x, y))
        board = (x >= 0.0) & (x < 8.0) & (y >= 0.0) & (y < 8.0)
        around = (x >= -margin) & (x < 8.0 + margin) & (y >= -margin) & (y < 8.0 + margin)
        inner = margin - _RIM
        within = (x >= -inner) & (x < 8.0 + inner) & (y >= -inner) & (y < 8.0 + inner)
        within[:_EDGE], within[-_EDGE:], within[:, :_EDGE], within[:, -_EDGE:] = False, False, False, False
        files, ranks = np.where(board, x, 0.0).astype(np.intp), np.where(board, y, 0.0).astype(np.intp)
        square = np.where(board, files + 8 * ranks, NO_SQUARE)
        return cls(step, board, around, around & ~within, square, area)

    @classmethod
    def of_view(cls, view: BoardView, margin: float) -> Zone:
        """From a calibrated camera; see ``of_corners``."""
        size = view.intrinsics.width, view.intrinsics.height
        return cls.of_corners(view.project(playing_area(view.table)), size, margin)

    def squares_in(self, mask: Mask, least: float) -> frozenset[int]:
        """Squares of which a mask covers at least such a share."""
        covered = np.bincount(self.square[mask], minlength=65)[:64]
        whole = np.bincount(self.square.ravel(), minlength=65)[:64]
        return frozenset(np.flatnonzero((covered >= least * whole) & (covered > 0)).tolist())


@dataclass(frozen=True, slots=True, eq=False)
class Space:
    """What a depth camera's small pixels are of, as points of the board frame.

    A pixel's point is linear in its depth: (x, y, height) = depth · ray + position of the camera.
    """

    ray: Field  # for each pixel of the small picture, (3, h, w), board frame
    position: Field  # of the camera, (3,) [m]
    pixel: float  # area that a pixel covers at depth 1 [1/1]
    half: tuple[float, float]  # half sizes of what is watched along x and y [m]
    board: Mask  # small mask of where the board and the pieces on it are seen

    @classmethod
    def of_view(cls, view: BoardView, margin: float) -> Space:
        """Over the board and both trays, with a margin beyond the board's edge and the trays' outermost feet [m]."""
        step = step_of(view.intrinsics.width)
        rays = _rays(view.intrinsics, step) @ view.camera_from_board[:3, :3]
        wide, long = view.table.half_play
        half = (wide + margin, long + margin)
        pixel = step * step / (view.intrinsics.fx * view.intrinsics.fy)
        return cls(
            np.ascontiguousarray(np.moveaxis(rays, 2, 0), dtype=np.float32),
            view.camera_position.astype(np.float32), pixel, half, _board_and_pieces(view, step),
        )  # fmt: skip


def _board_and_pieces(view: BoardView, step: int) -> Mask:
    """Where a piece of any height on any square is seen, in the small picture."""
    ground = playing_area(view.table)
    tallest = max(shape.height for shape in PIECE_SHAPES.values())
    pixels = view.project(np.concatenate([ground, ground + np.array([0.0, 0.0, tallest])]))
    outline = cv2.convexHull(np.rint((pixels + 0.5) / step - 0.5).astype(np.int32))
    seen = np.zeros((view.intrinsics.height // step, view.intrinsics.width // step), dtype=np.uint8)
    return np.asarray(cv2.fillConvexPoly(seen, outline, 1) > 0)


def _rays(pinhole: Intrinsics, step: int) -> Array:
    """Through the pixels that ``depth[::step, ::step]`` takes, camera frame, depth 1: (h, w, 3)."""
    width, height = pinhole.width // step, pinhole.height // step
    u, v = np.meshgrid(np.arange(width) * step, np.arange(height) * step)
    across, down = (u - pinhole.cx) / pinhole.fx, (v - pinhole.cy) / pinhole.fy
    return np.stack([across, down, np.ones_like(across)], axis=2)
