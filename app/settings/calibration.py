"""The calibration file: where the camera hangs and the board lies, as ``touchmove calibrate`` found them.

JSON, since a program writes it and no person should. A file of another version is refused, not guessed at.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError, model_validator

from app import UserError
from app.records.files import check_output, write_atomically
from hardware.frozen import FrozenFinite
from hardware.interfaces import Intrinsics
from hardware.table import MOST_YAW, TableSettings
from vision.board.view import BoardView
from vision.camera.calibration import CameraPose
from vision.camera.table_plane import BoardPlace

Array = NDArray[np.float64]
Row = tuple[float, float, float, float]

VERSION: Final = 1
AGAIN: Final = "run 'touchmove calibrate' again"


class CalibrationUnusable(UserError):
    """A calibration file is missing, malformed, of another version or of another camera."""


class Pinhole(FrozenFinite):
    """Intrinsics of the camera that was calibrated [px]."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    @classmethod
    def of(cls, intrinsics: Intrinsics) -> Self:
        """Of a camera."""
        return cls(
            width=intrinsics.width, height=intrinsics.height, fx=intrinsics.fx, fy=intrinsics.fy, cx=intrinsics.cx,
            cy=intrinsics.cy,
        )  # fmt: skip

    @property
    def intrinsics(self) -> Intrinsics:
        """As frames have them."""
        return Intrinsics(self.width, self.height, self.fx, self.fy, self.cx, self.cy)


class CalibratedBoard(FrozenFinite):
    """Where the board lies in the base frame."""

    centre: tuple[float, float, float]
    """Of the playing surface [m]."""
    yaw: float
    """Of the board about its own z axis [rad]."""
    tilt: float
    """Of its normal from the vertical [rad]; not made up for."""
    by_depth: bool
    by_corners: bool
    """False: the place along the board and the turn are the settings', only the height was measured."""

    @classmethod
    def of(cls, place: BoardPlace, *, by_corners: bool) -> Self:
        """As it was found."""
        return cls(centre=place.centre, yaw=place.yaw, tilt=place.tilt, by_depth=place.by_depth, by_corners=by_corners)

    def base_from_board(self) -> Array:
        """Takes points of the board frame into the base frame, shape (4, 4)."""
        return TableSettings(centre_in_base=self.centre).model_copy(update={"yaw_in_base": self.yaw}).pose_in_base()


class Calibration(FrozenFinite):
    """All that a calibration found.

    Attributes:
        version: of this file.
        made: when, UTC, ISO 8601.
        pinhole: of the camera.
        camera_from_base: takes points of the base frame into the camera's; rows, translation in [m].
        depth_factor: by which the camera's depth is to be multiplied.
        points: at which the marker was seen.
        left_out: of these, that fit so badly that they do not count.
        mean_residual: of the others, across the view at the marker [m].
        worst_residual: likewise.
        mean_error: expected of a point on the board, from noise alone (standard deviation) [m].
        worst_error: of the worst square.
        board: None where nothing was found of it.
    """

    version: Literal[1] = VERSION
    made: str
    pinhole: Pinhole
    camera_from_base: tuple[Row, Row, Row, Row]
    depth_factor: float
    points: int
    left_out: int
    mean_residual: float
    worst_residual: float
    mean_error: float
    worst_error: float
    board: CalibratedBoard | None

    @model_validator(mode="after")
    def _rigid(self) -> Self:
        rotation = self.pose()[:3, :3]
        if not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-6) or np.linalg.det(rotation) < 0.0:
            raise ValueError("camera_from_base is not a rigid transform")
        return self

    def pose(self) -> Array:
        """``camera_from_base`` as an array, shape (4, 4)."""
        return np.array(self.camera_from_base)

    def base_from_camera(self) -> Array:
        """Takes points of the camera frame into the base frame, shape (4, 4)."""
        inverse: Array = np.asarray(np.linalg.inv(self.pose()), dtype=float)
        return inverse

    def base_from_board(self, table: TableSettings) -> Array:
        """Takes points of the board frame into the base frame, shape (4, 4): as found, else as the settings say."""
        return table.pose_in_base() if self.board is None else self.board.base_from_board()

    def table(self, believed: TableSettings) -> TableSettings:
        """Where the board was found; where nothing was found of it, as it is believed to lie.

        Raises:
            CalibrationUnusable: it is turned too far to play on.
        """
        if self.board is None:
            return believed
        if abs(self.board.yaw) > MOST_YAW:
            raise CalibrationUnusable(
                f"the board is turned by {math.degrees(self.board.yaw):.1f}° against the robot, at most "
                f"{math.degrees(MOST_YAW):.1f}° can be played on: turn it, then {AGAIN}"
            )
        return believed.model_copy(update={"centre_in_base": self.board.centre, "yaw_in_base": self.board.yaw})

    def board_view(self, table: TableSettings) -> BoardView:
        """The board as this camera sees it."""
        return BoardView(self.pinhole.intrinsics, self.pose() @ self.base_from_board(table), table)

    def require_camera(self, intrinsics: Intrinsics) -> None:
        """Make sure that frames are by the camera that was calibrated.

        Args:
            intrinsics: of the frames.

        Raises:
            CalibrationUnusable: its pinhole is another.
        """
        if intrinsics != self.pinhole.intrinsics:
            raise CalibrationUnusable(
                f"the calibration is of a camera with {self.pinhole.intrinsics}, the frames have {intrinsics}: "
                f"use that camera at that size, or {AGAIN}"
            )


def as_rows(pose: Array) -> tuple[Row, Row, Row, Row]:
    """A (4, 4) transform as the file has it."""
    a, b, c, d = ((float(w), float(x), float(y), float(z)) for w, x, y, z in pose.tolist())
    return a, b, c, d


def check_calibration_file(path: Path) -> None:
    """See before the arm moves whether the file can be written.

    Raises:
        RecordError: it cannot, or would replace a file that is no calibration.
    """
    check_output(path, "a calibration", b'"camera_from_base"')


def write_calibration(path: Path, calibration: Calibration) -> None:
    """Write the file; the one before it stays until the new one is whole.

    Raises:
        RecordError: it cannot be written, or would replace a file that is no calibration.
    """
    check_calibration_file(path)
    write_atomically(path, calibration.model_dump_json(indent=2) + "\n")


def load_calibration(path: Path) -> Calibration:
    """Read a calibration file.

    Raises:
        CalibrationUnusable: it is missing, malformed or of another version.
    """
    try:
        return Calibration.model_validate_json(path.read_bytes())
    except OSError as error:
        raise CalibrationUnusable(f"no calibration at {path} ({error.strerror}): run 'touchmove calibrate'") from error
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"])) or "the file"
        raise CalibrationUnusable(f"calibration {path}: {where}: {first['msg']}: {AGAIN}") from error


def residuals(pose: CameraPose) -> tuple[float, float]:
    """Mean and worst of the points that count, across the view at the marker [m]."""
    counted = pose.aside[pose.used]
    return float(counted.mean()), float(counted.max())
