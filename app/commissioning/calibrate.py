"""``touchmove calibrate``: the arm shows its marker to the camera all over the board; where the camera hangs follows.

How the arm shows it: ``app.commissioning.marker_survey``.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from app import UserError
from app.commissioning.marker_survey import MarkerObservation, Setup, fresh_frame, show
from app.motion import MotionSettings
from app.records.files import GAMES
from app.rig.devices import Rig
from app.rig.factory import choose_rig, open_rig
from app.rig.rig_file import WorldSection
from app.rig.simulation.settings import NO_PIECES, own_rig
from app.settings.calibration import (
    CalibratedBoard,
    Calibration,
    Pinhole,
    as_rows,
    check_calibration_file,
    residuals,
    write_calibration,
)
from app.terminal.report_table import judged, rows_table
from controller.wire.errors import ControllerError
from hardware.frozen import Frozen
from hardware.interfaces import Frame, HardwareError, Pace
from hardware.table import TableSettings, square_place
from vision.arrays import Array
from vision.board.find import find_board
from vision.board.view import BoardNotFound, BoardView, playing_area
from vision.camera.calibration import CalibrationFailed, CameraPose, depth_factor, solve_pose
from vision.camera.table_plane import board_place, find_plane, nominal_view

Progress = Callable[[str], None]
FindCorners = Callable[[Frame, BoardView], Array | None]
"""Corners a1, h1, h8, a8 in a frame, (4, 2) [px], near to where a view has them; None where no board is seen."""

FILE: Final = "calibration.json"
MOST_EXPECTED: Final = 0.0015
"""A calibration whose worst square is expected to be off by more, as a standard deviation, is refused [m]."""
MOST_RESIDUAL: Final = 0.0015  # and one whose points disagree by more than this on average [m]
MOST_FACTOR: Final = 0.05  # depth that is wrong by a larger share is no depth of this scene


class ShownPoint(Frozen):
    """One point at which the arm showed its marker."""

    point: tuple[float, float, float]  # the marker's centre, base frame [m]
    seen: bool  # whether the camera saw it
    counted: bool  # whether it counts
    residual: float | None  # how far across the view it is seen from where it should be [m]; None if it was not seen

    def said(self) -> str | Text:
        """Its residual, for people."""
        if self.residual is None:
            return judged("not in sight", None)
        residual = f"{1e3 * self.residual:.2f}"
        return residual if self.counted else judged(f"{residual} left out", False)


class CalibrateReport(Frozen):
    """A calibration, or why there is none."""

    rig: str  # whose
    holds: bool  # whether there is one
    failure: str | None  # one sentence where there is none
    file: str | None  # it was written to
    calibration: Calibration | None  # itself
    shown: tuple[ShownPoint, ...]  # all points

    def table(self) -> RenderableType:
        """One screen for people."""
        if self.calibration is None:
            return f"rig {self.rig}: not calibrated: {self.failure}"
        found = self.calibration
        columns = ("point", "z1 [mm]", "z2 [mm]", "z3 [mm]", "residual [mm]")
        rows = [
            (str(number), *(f"{1e3 * value:z.1f}" for value in one.point), one.said())
            for number, one in enumerate(self.shown, start=1)
        ]
        table = rows_table([f">{name}" for name in columns], rows, f"rig {self.rig}: calibrated")
        return Group(table, *self._lines(found))

    def _lines(self, found: Calibration) -> list[str]:
        lines = [
            f"residuals: mean {1e3 * found.mean_residual:.2f} mm, worst {1e3 * found.worst_residual:.2f} mm; "
            f"expected error on the board: mean {1e3 * found.mean_error:.2f} mm, "
            f"worst {1e3 * found.worst_error:.2f} mm",
        ]
        if found.depth_factor != 1.0:
            lines.append(f"depth is multiplied by {found.depth_factor:.4f}, as measured at the marker")
        if found.board is not None:
            x, y, z = (1e3 * value for value in found.board.centre)
            tilt, yaw = math.degrees(found.board.tilt), math.degrees(found.board.yaw)
            lines.append(
                f"board: centre at ({x:z.1f}, {y:z.1f}, {z:z.1f}) mm in the base frame, turned by {yaw:z.2f}°, "
                f"tilted by {tilt:z.2f}°"
                + ("" if found.board.by_corners else "; position and rotation come from the settings")
            )
        return [*lines, f"written to {self.file}"]


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """What a calibration found, with what it was found from."""

    calibration: Calibration
    pose: CameraPose
    sightings: tuple[MarkerObservation, ...]


def calibrate_rig(
    rig: Rig, setup: Setup, progress: Progress, made: datetime, find_corners: FindCorners | None = None
) -> Found:
    """Calibrate the camera of a rig whose arm holds; ``made``: the time, for the file.

    ``find_corners`` finds the outer corners of the playing area in a frame; None: only the board's height is found.

    Raises:
        CalibrationFailed: it cannot be told well enough.
        UserError, HardwareError: a device failed.
    """
    sightings = show(rig, setup, progress)
    seen = [one for one in sightings if one.seen is not None]
    assert rig.camera is not None
    frame = fresh_frame(rig, rig.camera)
    points = np.array([one.point for one in seen]).reshape(-1, 3)
    pixels = np.array([one.seen.centre for one in seen if one.seen is not None]).reshape(-1, 2)
    pose = solve_pose(frame.intrinsics, points, pixels)
    factor, _scatter = depth_factor(pose, points, np.array([one.depth for one in seen]))
    if abs(factor - 1.0) > MOST_FACTOR:
        raise CalibrationFailed(
            f"the camera's depth is wrong by {100.0 * abs(factor - 1.0):.0f} %, at most {100.0 * MOST_FACTOR:.0f} % "
            "are accepted: calibrate the depth camera with its maker's tool, then calibrate again"
        )
    plane = find_plane(frame, pose, setup.table, factor)
    corners = None if find_corners is None else find_corners(frame, nominal_view(pose, setup.table))
    try:
        place = board_place(pose, setup.table, corners, plane)
    except BoardNotFound as error:
        why, _, _ = str(error).partition(":")
        raise CalibrationFailed(
            f"what the camera shows of the board is not a square's picture ({why}): correct a webcam's focal or "
            "field_of_view_deg in the rig file, or use a camera whose lens distorts less"
        ) from error
    board = None if place is None else CalibratedBoard.of(place, by_corners=corners is not None)
    calibration = _summary(pose, setup.table, factor, board, made)
    _require_good(calibration)
    return Found(calibration, pose, tuple(sightings))


def corners_near(frame: Frame, view: BoardView) -> Array | None:
    """Corners of the board in a frame, found near to where it is believed to lie; None where they are not sure."""
    try:
        found = find_board(frame.colour, near=view.project(playing_area(view.table)))
    except BoardNotFound:
        return None  # pieces may hide too much of it: the report says that place and turn are the settings'
    return found.corners if found.doubt is None else None


def _summary(
    pose: CameraPose, table: TableSettings, factor: float, board: CalibratedBoard | None, made: datetime
) -> Calibration:
    squares = np.array([[*table.xy(square_place(square)), 0.0] for square in range(64)])
    expected = pose.expected_error(table.base_from_board(squares))
    mean, worst = residuals(pose)
    return Calibration(
        made=made.isoformat(timespec="seconds"), pinhole=Pinhole.of(pose.intrinsics),
        camera_from_base=as_rows(pose.camera_from_base), depth_factor=factor, points=len(pose.used),
        left_out=int(np.count_nonzero(~pose.used)), mean_residual=mean, worst_residual=worst,
        mean_error=float(expected.mean()), worst_error=float(expected.max()), board=board,
    )  # fmt: skip


def _require_good(found: Calibration) -> None:
    if found.mean_residual > MOST_RESIDUAL:
        raise CalibrationFailed(
            f"the points disagree by {1e3 * found.mean_residual:.1f} mm on average, at most "
            f"{1e3 * MOST_RESIDUAL:.1f} mm are accepted: "
            "tighten camera and marker, and check that the parameters belong to this robot"
        )
    if found.worst_error > MOST_EXPECTED:
        raise CalibrationFailed(
            f"the camera would see the board with an error of {1e3 * found.worst_error:.1f} mm, at most "
            f"{1e3 * MOST_EXPECTED:.1f} mm are accepted: check that the marker is sharp, well lit and visible "
            "everywhere"
        )


def run_calibrate(name: str, out: Path | None, progress: Progress) -> CalibrateReport:
    """Calibrate the camera of a rig, ``sim``, which is started for it, or a rig file, whose controller runs; write the
    file.

    ``out`` None: the rig file's ``calibration``, or ``games/calibration.json`` of a simulation.

    Raises:
        UserError: there is no such rig, the file cannot be written, or a device failed.
    """
    rig = choose_rig(name)
    path = out or (rig.calibration if rig is not None else GAMES / FILE)
    check_calibration_file(path)
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="touchmove-")))
        used = rig or own_rig(folder / "run", WorldSection(pace=Pace.FAST, fen=NO_PIECES))
        setup = Setup(used.table, used.robot(), MotionSettings().at(used.table))
        try:
            setup.marker  # noqa: B018  # asked for before anything starts
            devices = stack.enter_context(open_rig(used, progress, own=rig is None))
            found = calibrate_rig(devices, setup, progress, datetime.now(UTC), corners_near)
        except CalibrationFailed as error:
            return CalibrateReport(rig=name, holds=False, failure=str(error), file=None, calibration=None, shown=())
        except (HardwareError, ControllerError) as error:
            raise UserError(str(error)) from error
    write_calibration(path, found.calibration)
    return CalibrateReport(
        rig=name, holds=True, failure=None, file=str(path), calibration=found.calibration, shown=shown_points(found)
    )


def shown_points(found: Found) -> tuple[ShownPoint, ...]:
    """For the report: each point and how well it fits."""
    shown, index = [], 0
    for one in found.sightings:
        x, y, z = one.point.tolist()
        if one.seen is None:
            shown.append(ShownPoint(point=(x, y, z), seen=False, counted=False, residual=None))
            continue
        counted, residual = bool(found.pose.used[index]), float(found.pose.aside[index])
        shown.append(ShownPoint(point=(x, y, z), seen=True, counted=counted, residual=residual))
        index += 1
    return tuple(shown)
