"""Where the board lies, seen from the robot's base, once the camera is calibrated: height and tilt from depth, place
and turn from its corners.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from hardware.interfaces import Frame
from hardware.table import TableSettings
from vision.arrays import Array, Field
from vision.board.view import BoardNotFound, BoardView, playing_area
from vision.camera.calibration import CameraPose

_STEP: Final = 3  # every so many pixels one is taken
_REACH: Final = 0.06  # the board is looked for within so much of its expected height [m]
_CLOSE: Final = 0.004  # what is further from the plane than this does not belong to it [m]
_LEAST_PIXELS: Final = 300
_ROUNDS: Final = 6


@dataclass(frozen=True, slots=True)
class Plane:
    """The board's plane in the base frame."""

    height: float  # z₃ below the middle of the expected board [m]
    slope: tuple[float, float]  # dz₃/dz₁ and dz₃/dz₂
    share: float  # of the pixels on the board that lie in it; pieces do not


@dataclass(frozen=True, slots=True)
class BoardPlace:
    """Where a board lies in the base frame."""

    centre: tuple[float, float, float]  # of the playing surface [m]
    yaw: float  # turn of the board about its own z axis, against a board along the base's axes [rad]
    tilt: float  # of its normal from the vertical [rad]
    by_depth: bool  # whether height and tilt are from depth; else from the corners


def nominal_view(pose: CameraPose, table: TableSettings) -> BoardView:
    """The board as the calibrated camera would see it where the settings say that it lies."""
    return BoardView(pose.intrinsics, pose.camera_from_base @ table.pose_in_base(), table)


def find_plane(frame: Frame, pose: CameraPose, table: TableSettings, factor: float = 1.0) -> Plane | None:
    """The board's plane from depth; None where the camera has none, or hardly any of the board's pixels has.

    The frame is of the calibrated camera, the arm out of the way; pieces may stand on the board, which lies within some
    centimetres of where ``table`` has it. ``factor``: by which depth has to be multiplied, see ``depth_factor``.
    """
    if frame.depth is None:
        return None
    points = _points_on_board(frame.depth * np.float32(factor), pose, table)
    middle = np.asarray(table.centre_in_base)
    near = points[np.abs(points[:, 2] - middle[2]) < _REACH] - middle
    if len(near) < _LEAST_PIXELS:
        return None
    # the commonest height first: pieces are spread over theirs
    counts, edges = np.histogram(near[:, 2], bins=np.arange(-_REACH, _REACH + 1e-9, 0.002))
    best = int(np.convolve(counts, np.ones(3), "same").argmax())
    plane = np.array([0.0, 0.0, 0.5 * (edges[best] + edges[best + 1])])
    width = 3.0 * _CLOSE  # a board that lies askew is not level at first
    for _ in range(_ROUNDS):
        off = near[:, 2] - near[:, :2] @ plane[:2] - plane[2]
        chosen = near[np.abs(off) < width]
        if len(chosen) < _LEAST_PIXELS:
            return None
        plane = np.linalg.lstsq(np.column_stack([chosen[:, :2], np.ones(len(chosen))]), chosen[:, 2], rcond=None)[0]
        width = max(_CLOSE, 0.7 * width)
    return Plane(float(middle[2] + plane[2]), (float(plane[0]), float(plane[1])), len(chosen) / len(points))


def board_place(
    pose: CameraPose, table: TableSettings, corners: Array | None = None, plane: Plane | None = None
) -> BoardPlace | None:
    """Place of the board by its outer corners a1, h1, h8, a8 in the picture, (4, 2) [px], and its plane from depth.

    With a plane alone centre and turn are as the settings have them, at the plane's height. None with neither.

    Raises:
        BoardNotFound: the corners fit no board.
    """
    if corners is None:
        if plane is None:
            return None
        x, y, _ = table.centre_in_base
        return BoardPlace((x, y, plane.height), table.yaw_in_base, math.atan(math.hypot(*plane.slope)), True)
    seen = BoardView.from_corners(pose.intrinsics, corners, table)
    if plane is None:
        base_from_board = pose.base_from_camera @ seen.camera_from_board
        (x, y, z), x_axis = base_from_board[:3, 3].tolist(), base_from_board[:3, 0]
        tilt = math.acos(min(1.0, abs(float(base_from_board[2, 2]))))
        return BoardPlace((x, y, z), math.atan2(-x_axis[1], x_axis[0]), tilt, False)
    on_plane = _meet(pose, np.asarray(corners, dtype=float), plane, table)
    flat = playing_area(table)[:, :2]
    # the square's turn and centre that fit best: a rigid motion in the plane, seen from above
    mirrored = on_plane[:, :2] * (1.0, -1.0)
    middle = mirrored.mean(axis=0)
    cross = float(np.sum(flat[:, 0] * (mirrored - middle)[:, 1] - flat[:, 1] * (mirrored - middle)[:, 0]))
    yaw = math.atan2(cross, float(np.sum(flat * (mirrored - middle))))
    x, y = float(middle[0]), float(-middle[1])
    x0, y0, _ = table.centre_in_base
    height = plane.height + plane.slope[0] * (x - x0) + plane.slope[1] * (y - y0)
    return BoardPlace((x, y, height), yaw, math.atan(math.hypot(*plane.slope)), True)


def _points_on_board(depth: Field, pose: CameraPose, table: TableSettings) -> Array:
    """Points in the base frame of the pixels where the board should be seen, (n, 3) [m]."""
    view = nominal_view(pose, table)
    mask = np.zeros(depth.shape, dtype=np.uint8)
    cv2.fillConvexPoly(mask, np.rint(view.project(playing_area(table))).astype(np.int32), 1)
    v, u = np.nonzero(mask[::_STEP, ::_STEP])
    u, v = u * _STEP, v * _STEP
    z = depth[v, u].astype(float)
    there = z > 0.0
    eye = pose.intrinsics
    ray = np.column_stack([(u - eye.cx) / eye.fx, (v - eye.cy) / eye.fy, np.ones(len(u))])[there]
    base = pose.base_from_camera
    return np.asarray((ray * z[there, None]) @ base[:3, :3].T + base[:3, 3])


def _meet(pose: CameraPose, pixels: Array, plane: Plane, table: TableSettings) -> Array:
    """Where rays through pixels meet the plane, base frame (n, 3) [m]."""
    eye, base = pose.intrinsics, pose.base_from_camera
    ray = np.column_stack([(pixels - (eye.cx, eye.cy)) / (eye.fx, eye.fy), np.ones(len(pixels))]) @ base[:3, :3].T
    normal = np.array([-plane.slope[0], -plane.slope[1], 1.0])
    anchor = np.array([*table.centre_in_base[:2], plane.height])
    along = ray @ normal
    if (np.abs(along) < 1e-6).any():
        raise BoardNotFound("the camera looks along the board's plane: mount it higher")
    return np.asarray(base[:3, 3] + ray * (((anchor - base[:3, 3]) @ normal) / along)[:, None])
