"""Where the board is in a picture: its pose from four corners, projection, and a view from straight above.

Frames: ``board`` as in ``hardware.table`` (origin at the centre of the playing surface, x along a→h, y along 1→8, z up)
and ``camera`` as in OpenCV (origin at the pinhole, x right, y down, z along the view). Pixels are (u, v) = (column,
row), with whole numbers at the centres of pixels: (0, 0) is the centre of the first one.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike

from hardware.interfaces import DepthFrame, Frame, Intrinsics
from hardware.table import TableSettings
from vision.arrays import Array

CORNER_NAMES = ("a1", "h1", "h8", "a8")
"""Outer corners of the playing area in the order used throughout: counter-clockwise seen from above."""
CORNER_TOLERANCE = 3.0  # a corner further than this from where the fitted pose puts it was not a corner [px]
LEAST_AREA = 1000.0  # a board that covers less than this is too small to work with [px²]


class BoardNotFound(Exception):
    """Four points cannot be the corners of the board; the message is one sentence with the next step."""


@dataclass(frozen=True, slots=True, eq=False)
class BoardView:
    """A board as one camera sees it."""

    intrinsics: Intrinsics  # of the camera
    camera_from_board: Array
    """Rigid transform that takes points of the board frame into the camera frame, shape (4, 4), translation in [m];
    read-only."""
    table: TableSettings  # size of the squares

    def __post_init__(self) -> None:
        """Keep a read-only copy of the pose.

        Raises:
            ValueError: the pose is no rigid transform.
        """
        pose = np.array(self.camera_from_board, dtype=float)
        if pose.shape != (4, 4) or not _is_rigid(pose):
            raise ValueError(
                "camera_from_board is not a rigid transform: give a (4, 4) matrix of a rotation and a translation"
            )
        pose.flags.writeable = False
        object.__setattr__(self, "camera_from_board", pose)

    @classmethod
    def from_corners(cls, intrinsics: Intrinsics, corners: ArrayLike, table: TableSettings) -> BoardView:
        """Pose of the board from the picture of its outer corners a1, h1, h8, a8, shape (4, 2) [px].

        An empty board looks alike from all sides: corners that begin with another one turn the board, and nothing here
        can tell.

        Raises:
            BoardNotFound: the points are in another order, enclose too little, or fit no pose of a square board.
        """
        pixels = np.asarray(corners, dtype=float)
        _check_corners(pixels)
        points = playing_area(table)
        # not SOLVEPNP_IPPE: OpenCV 5.0 gets views wrong in which the board looks symmetric, such as the usual one
        found, turn, shift = cv2.solvePnP(points, pixels, intrinsics.matrix(), None, flags=cv2.SOLVEPNP_ITERATIVE)
        if not found:
            raise BoardNotFound("no pose of a board fits these corners: point at a1, h1, h8 and a8 again")
        turn, shift = cv2.solvePnPRefineLM(points, pixels, intrinsics.matrix(), None, turn, shift)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = cv2.Rodrigues(turn)[0], np.ravel(shift)
        view = cls(intrinsics, pose, table)
        view._check_fit(pixels)
        return view

    def _check_fit(self, corners: Array) -> None:
        errors = np.linalg.norm(self.project(playing_area(self.table)) - corners, axis=1)
        worst = int(errors.argmax())
        if errors[worst] > CORNER_TOLERANCE:
            raise BoardNotFound(
                f"corner {CORNER_NAMES[worst]} is {errors[worst]:.1f} px from where a square board would have it, "
                f"at most {CORNER_TOLERANCE:.0f} px are accepted: point at the corners again, or check the intrinsics"
            )

    def require_camera(self, frame: Frame | DepthFrame) -> None:
        """Make sure that a frame is by the camera of this view.

        Raises:
            ValueError: it is not.
        """
        if frame.intrinsics != self.intrinsics:
            raise ValueError(f"the frame is by a camera with {frame.intrinsics}, this view is of {self.intrinsics}")

    def beside(self, intrinsics: Intrinsics, offset: float) -> BoardView:
        """The same board as another camera sees it, so far to the right and looking the same way [m]."""
        pose = self.camera_from_board.copy()
        pose[0, 3] -= offset
        return BoardView(intrinsics, pose, self.table)

    @property
    def camera_position(self) -> Array:
        """The pinhole in the board frame, shape (3,) [m]."""
        return -self.camera_from_board[:3, :3].T @ self.camera_from_board[:3, 3]

    def depth(self, points: ArrayLike) -> Array:
        """Distance of points (..., 3) [m] of the board frame from the camera's plane, along its view: (...) [m]."""
        return self._in_camera(points)[..., 2]

    def _in_camera(self, points: ArrayLike) -> Array:
        return np.asarray(points, dtype=float) @ self.camera_from_board[:3, :3].T + self.camera_from_board[:3, 3]

    def project(self, points: ArrayLike) -> Array:
        """Where points (..., 3) [m] of the board frame are in the picture, (..., 2) [px], also where they lie outside
        of it.

        Raises:
            ValueError: a point lies behind the camera and has no picture.
        """
        seen = self._in_camera(points)
        behind = int(np.count_nonzero(seen[..., 2] <= 0.0))
        if behind:
            raise ValueError(
                f"{behind} of {seen[..., 2].size} points lie behind the camera: project only what it faces"
            )
        focal, centre = (self.intrinsics.fx, self.intrinsics.fy), (self.intrinsics.cx, self.intrinsics.cy)
        return seen[..., :2] / seen[..., 2:] * focal + centre


def playing_area(table: TableSettings) -> Array:
    """Outer corners of the playing area in the order of ``CORNER_NAMES``, board frame, shape (4, 3) [m]."""
    half = 4.0 * table.square
    return np.array([[-half, -half, 0.0], [half, -half, 0.0], [half, half, 0.0], [-half, half, 0.0]])


def square_corners(table: TableSettings) -> Array:
    """Corners of all squares, from a1's outer one along the files and then rank by rank, board frame, (81, 3) [m]."""
    lines = (np.arange(9) - 4.0) * table.square
    y, x = np.meshgrid(lines, lines, indexing="ij")
    return np.stack([x.ravel(), y.ravel(), np.zeros(81)], axis=1)


def _is_rigid(pose: Array) -> bool:
    rotation = pose[:3, :3]
    return bool(
        np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-6)
        and np.linalg.det(rotation) > 0.0
        and np.array_equal(pose[3], [0.0, 0.0, 0.0, 1.0])
        and np.isfinite(pose).all()
    )


def _check_corners(pixels: Array) -> None:
    """Four finite points, convex, counter-clockwise to the eye, and not too close together."""
    if pixels.shape != (4, 2) or not np.isfinite(pixels).all():
        raise BoardNotFound(f"corners of shape {pixels.shape} were given: give four finite points, {_ORDER}")
    edges = np.roll(pixels, -1, axis=0) - pixels
    following = np.roll(edges, -1, axis=0)
    turns = edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0]
    if not (turns < 0.0).all():  # v points down: counter-clockwise to the eye turns negatively
        raise BoardNotFound(f"the corners do not go round counter-clockwise in the picture: give them as {_ORDER}")
    area = -float(turns[0] + turns[2]) / 2.0
    if area < LEAST_AREA:
        raise BoardNotFound(
            f"the corners enclose {area:.0f} px², at least {LEAST_AREA:.0f} px² are needed: bring the camera closer"
        )


_ORDER = "a1, h1, h8, a8"
