"""What a camera sees of the board, laid out square by square: the common form that everything which looks works on.

A sight is a plan of the board with a margin of one square around it: the colour picture seen from straight above, as
if all of it lay in the board's plane, and, where the camera has depth, what stands up from it. Lengths are in
sides of a square, so that photographs of boards of unknown size serve as well. Plan frame: origin at the outer corner
of a1, x along the files a→h, y along the ranks 1→8, z up.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import ArrayLike

from hardware.interfaces import Frame
from vision.arrays import Array, Picture
from vision.board.view import BoardNotFound, BoardView, playing_area
from vision.reading.solids import Solids, solids_of

SQUARE_PX: Final = 24  # side of a square in the plan [px]: about as many as 640×480 shows; more tell no more
MARGIN: Final = 1  # squares around the board that the plan shows as well: pieces lean over its edge
PLAN_PX: Final = (8 + 2 * MARGIN) * SQUARE_PX
USUAL_FOCAL: Final = 1.0
"""Focal length of an unknown camera in widths of its picture: 53° wide, between webcams (60°–78°) and telephones'
second lenses. Only asked where a view from straight above does not tell it."""
FOCAL_RANGE: Final = (0.5, 3.0)  # what is believed of a focal length from four corners, in widths of the picture


@dataclass(frozen=True, slots=True, eq=False)
class RectifiedView:
    """One look at the board."""

    plan: Picture  # RGB, shape (PLAN_PX, PLAN_PX, 3); the row of the 8th rank is above, the a-file left
    camera: Array  # the pinhole in the plan frame, shape (3,) [squares]; approximate where the camera is unknown
    solids: Solids | None = None  # what stands up from the board, by depth. None: the camera has no depth.
    stamp: float = 0.0  # of exposure [s]


def sight_of_picture(colour: Picture, corners: ArrayLike, stamp: float = 0.0) -> RectifiedView:
    """The board in a picture, RGB (h, w, 3), of which only its outer corners a1, h1, h8, a8 are known, (4, 2) [px].

    Raises:
        BoardNotFound: the points are no corners of a board.
    """
    pixels = np.asarray(corners, dtype=float)
    if pixels.shape != (4, 2) or not np.isfinite(pixels).all():
        raise BoardNotFound(f"corners of shape {pixels.shape} were given: give four finite points, a1, h1, h8, a8")
    height, width = colour.shape[:2]
    return RectifiedView(_plan(colour, pixels), _pinhole(pixels, width, height), None, stamp)


def sight_of_frame(frame: Frame, view: BoardView) -> RectifiedView:
    """The board in a frame of a camera whose place is known; with heights where the frame has depth.

    Raises:
        ValueError: the frame is of another camera.
    """
    view.require_camera(frame)
    corners = view.project(playing_area(view.table))
    camera = view.camera_position / view.table.square + np.array([4.0, 4.0, 0.0])
    solids = None if frame.depth is None else solids_of(frame, view)
    return RectifiedView(_plan(frame.colour, corners), camera, solids, frame.stamp)


def _plan(colour: Picture, corners: Array) -> Picture:
    """The plan of a picture; smoothed first where the picture has more pixels than the plan."""
    edges = (np.array([[0, 8], [8, 8], [8, 0], [0, 0]], dtype=np.float32) + MARGIN) * SQUARE_PX - 0.5
    warp = cv2.getPerspectiveTransform(edges.astype(np.float32), corners.astype(np.float32))
    finer = float(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).mean()) / (8 * SQUARE_PX)
    if finer > 1.3:
        colour = np.asarray(cv2.GaussianBlur(colour, (0, 0), 0.45 * finer), dtype=np.uint8)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    plan = cv2.warpPerspective(colour, warp, (PLAN_PX, PLAN_PX), flags=flags, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(plan, dtype=np.uint8)


def _pinhole(corners: Array, width: int, height: int) -> Array:
    """Where the camera is, from the corners alone: square pixels, principal point in the middle of the picture."""
    plan = np.array([[0.0, 0.0], [8.0, 0.0], [8.0, 8.0], [0.0, 8.0]], dtype=np.float32)
    centred = (corners - [0.5 * (width - 1), 0.5 * (height - 1)]) / width
    homography = cv2.getPerspectiveTransform(plan, centred.astype(np.float32)).astype(float)
    first, second, third = homography.T
    focal = np.clip(_focal(first, second), *FOCAL_RANGE)
    lens = np.diag([1.0 / focal, 1.0 / focal, 1.0])
    x, y, shift = lens @ first, lens @ second, lens @ third
    scale = np.sign(shift[2]) / np.sqrt(np.linalg.norm(x) * np.linalg.norm(y))
    x, y, shift = scale * x, scale * y, scale * shift
    # the nearest rotation: the columns are orthonormal only as far as the focal length is right
    left, _, right = np.linalg.svd(np.stack([x, y, np.cross(x, y)], axis=1))
    place: Array = -(left @ right).T @ shift
    place[2] = abs(place[2])
    return place


def _focal(first: Array, second: Array) -> float:
    """Focal length from the images of two axes at right angles and of one length [widths]; the usual one if unclear."""
    # first ⟂ second and |first| = |second| once x and y are divided by f: two linear equations for 1/f²
    rows = np.array([first[:2] @ second[:2], first[:2] @ first[:2] - second[:2] @ second[:2]])
    right = -np.array([first[2] * second[2], first[2] ** 2 - second[2] ** 2])
    weight = float(rows @ rows)
    size = float(first @ first + second @ second)
    if weight < 1e-4 * size**2:
        return USUAL_FOCAL
    inverse = float(rows @ right) / weight
    return 1.0 / float(np.sqrt(inverse)) if inverse > 1e-2 else USUAL_FOCAL
