"""``touchmove calibrate``: the arm shows its marker to the camera all over the board; where the camera hangs follows.

The arm stays higher than any piece, so that the board may be set up or empty. At each point it rests, one frame is
taken that was exposed after it came to rest, and the encoders say where the tool really is.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app import UserError
from app.calibrate_report import CalibrateReport, ShownPoint
from app.calibration import CalibratedBoard, Calibration, Pinhole, as_rows, residuals, write_calibration
from app.config import RigFile
from app.devices import Rig
from app.motion import MotionSettings, Plan, PlanRefused, plan_return
from app.processes import GAMES
from app.rig import choose_rig, open_rig
from app.sim_rig import SimRigSettings
from controller.errors import ControllerError
from hardware.interfaces import Camera, Frame, HardwareError
from hardware.parameters import Marker, RobotParameters, load_parameters
from hardware.sim.settings import Pace, WorldSettings
from hardware.table import PIECE_SHAPES, TableSettings, square_place
from vision.calibration import CalibrationFailed, CameraPose, depth_factor, solve_pose
from vision.marker import SeenMarker, find_marker
from vision.table_plane import board_place, find_plane

Array = NDArray[np.float64]
Progress = Callable[[str], None]

FILE: Final = "calibration.json"
MOST_EXPECTED: Final = 0.0015
"""A calibration whose worst square is expected to be off by more, as a standard deviation, is refused [m]."""
MOST_RESIDUAL: Final = 0.0015
"""And one whose points disagree by more than this on average [m]."""
MOST_FACTOR: Final = 0.05
"""Depth that is wrong by a larger share is no depth of this scene."""
PAUSE: Final = 0.15
"""From rest to a picture: what swings comes to rest [s]."""
PATIENCE: Final = 3.0
"""For a frame that was exposed after the arm came to rest [s]."""
MOST_AGE: Final = 0.5
_SIDES: Final = (-1.0, 0.0, 1.0)
_SPREAD: Final = 0.75
"""Points lie so far out, in half boards."""
_CLEAR: Final = 0.012
"""Between pads and the tallest piece [m]."""
_LAYERS: Final = (0.0, 0.045, 0.090)
"""Heights above the lowest one [m]."""
_INNER: Final = 8
"""Depth is taken from the middle of the marker, an eighth of its side to each side."""


@dataclass(frozen=True, slots=True)
class Setup:
    """What a calibration needs to know beforehand."""

    table: TableSettings
    parameters: RobotParameters
    motion: MotionSettings

    @property
    def marker(self) -> Marker:
        """On the tool.

        Raises:
            CalibrationFailed: the parameters have none.
        """
        if self.parameters.marker is None:
            raise CalibrationFailed(
                "the robot's parameters have no [marker]: put one on the tool and write down its place "
                "(docs/calibration.md)"
            )
        return self.parameters.marker


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """The marker at one point: where it was by the encoders, base frame (3,) [m], and in the picture, if at all."""

    point: Array
    seen: SeenMarker | None
    depth: float
    """Measured at its centre [m]; 0 where there is none."""


def showing_points(setup: Setup) -> tuple[Array, ...]:
    """Tool points at which the arm shows itself, base frame (3,) each [m], in an order with short ways.

    Over the whole board in three layers, fewer points higher up: there the marker leaves the picture of a camera that
    hangs low.
    """
    table, pads = setup.table, setup.parameters.pads
    low = max(shape.height for shape in PIECE_SHAPES.values()) + pads.half_height + _CLEAR
    half = 4.0 * _SPREAD * table.square
    grids: tuple[Sequence[tuple[float, float]], ...] = (
        [(i, j) for j in _SIDES for i in _SIDES],
        [(i, j) for j in (1.0, 0.25, -0.5) for i in (-0.8, 0.8)] + [(0.0, 0.6), (0.0, -0.2)],
        [(i, j) for j in (0.5, 1.0) for i in (-0.9, 0.0, 0.9)],
    )
    points = []
    for layer, grid in zip(_LAYERS, grids, strict=True):
        ordered = _snake([(i, j) for i, j in grid])
        points += [table.base_from_board(np.array([i * half, j * half, low + layer])) for i, j in ordered]
    return tuple(points)


def _snake(grid: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Row by row, every other one backwards."""
    rows = sorted({j for _i, j in grid})
    return [
        place
        for number, row in enumerate(rows)
        for place in sorted((one for one in grid if one[1] == row), reverse=number % 2 == 1)
    ]


def show(rig: Rig, setup: Setup, progress: Progress) -> list[Sighting]:
    """Let the arm show its marker at all points that it reaches, and bring it home.

    Raises:
        CalibrationFailed: the rig has no camera, or the parameters no marker.
        UserError, HardwareError: a device failed.
    """
    marker, camera = setup.marker, rig.camera
    if camera is None:
        raise CalibrationFailed("this rig has no camera: name one in [camera] of its file")
    points = showing_points(setup)
    sightings = []
    for number, point in enumerate(points, start=1):
        try:
            _go(rig, setup, point, f"point {number} of {len(points)}")
        except PlanRefused as refused:
            progress(f"point {number} of {len(points)} is left out: {refused}")
            continue
        position = rig.arm.state().position
        rig.clock.sleep(PAUSE)
        frame = _fresh(rig, camera)
        seen = find_marker(frame.colour, marker.number)
        sightings.append(Sighting(position + np.array(marker.centre), seen, _depth(frame, seen)))
        if seen is None:
            progress(f"point {number} of {len(points)}: the marker is not in sight")
    go_home(rig, setup)
    return sightings


def go_home(rig: Rig, setup: Setup) -> None:
    """Bring the arm home, which leaves it at rest there."""
    _go(rig, setup, np.array(setup.motion.home), "home")


def _go(rig: Rig, setup: Setup, point: Array, label: str) -> None:
    """To a point that is higher than all pieces: up or level first, then over."""
    x, y, z = point.tolist()
    state = rig.arm.state()
    motion = setup.motion.model_copy(update={"home": (x, y, z)})
    plan = plan_return(state.reference, state.finger, motion, setup.parameters, setup.table)
    if np.linalg.norm(state.reference - point) > 1e-6:
        rig.arm.execute(Plan(label, tuple(replace(one, label=label) for one in plan.motions), style=plan.style))


def _fresh(rig: Rig, camera: Camera) -> Frame:
    """A frame that was exposed from now on."""
    since, deadline = rig.clock.now(), rig.clock.now() + PATIENCE
    while True:
        frame = camera.read(MOST_AGE)
        if frame.stamp >= since:
            return frame
        if rig.clock.now() > deadline:
            raise HardwareError(f"the camera gave no new picture within {PATIENCE:.0f} s: see to its cable")
        rig.clock.sleep(0.01)


def _depth(frame: Frame, seen: SeenMarker | None) -> float:
    """At the marker's centre [m], 0 where there is none."""
    if seen is None or frame.depth is None:
        return 0.0
    side = float(np.linalg.norm(seen.corners[1] - seen.corners[0]))
    u, v = np.rint(seen.centre).astype(int).tolist()
    half = max(2, round(side / _INNER))
    patch = frame.depth[max(0, v - half) : v + half + 1, max(0, u - half) : u + half + 1]
    known = patch[patch > 0.0]
    return float(np.median(known)) if known.size else 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """What a calibration found, with what it was found from."""

    calibration: Calibration
    pose: CameraPose
    sightings: tuple[Sighting, ...]


def calibrate_rig(rig: Rig, setup: Setup, progress: Progress, made: datetime) -> Found:
    """Calibrate the camera of a rig whose arm holds.

    Raises:
        CalibrationFailed: it cannot be told well enough.
        UserError, HardwareError: a device failed.
    """
    sightings = show(rig, setup, progress)
    seen = [one for one in sightings if one.seen is not None]
    assert rig.camera is not None
    frame = _fresh(rig, rig.camera)
    points = np.array([one.point for one in seen]).reshape(-1, 3)
    pixels = np.array([one.seen.centre for one in seen if one.seen is not None]).reshape(-1, 2)
    pose = solve_pose(frame.intrinsics, points, pixels)
    factor, _scatter = depth_factor(pose, points, np.array([one.depth for one in seen]))
    if abs(factor - 1.0) > MOST_FACTOR:
        raise CalibrationFailed(
            f"the camera's depth is wrong by {100.0 * abs(factor - 1.0):.0f} %, at most {100.0 * MOST_FACTOR:.0f} % are "
            "accepted: calibrate the depth camera with its maker's tool, then calibrate again"
        )
    plane = find_plane(frame, pose, setup.table, factor)
    place = board_place(pose, setup.table, None, plane)
    board = None if place is None else CalibratedBoard.of(place, by_corners=False)
    calibration = _summary(pose, setup.table, factor, board, made)
    _require_good(calibration)
    return Found(calibration, pose, tuple(sightings))


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
            f"the points disagree by {1e3 * found.mean_residual:.1f} mm on average, at most {1e3 * MOST_RESIDUAL:.1f} mm "
            "are accepted: screw camera and marker down, and see that the robot's parameters are its own"
        )
    if found.worst_error > MOST_EXPECTED:
        raise CalibrationFailed(
            f"the camera would see the board with an error of {1e3 * found.worst_error:.1f} mm, at most "
            f"{1e3 * MOST_EXPECTED:.1f} mm are accepted: see that the marker is sharp, well lit and in sight everywhere"
        )


def run_calibrate(name: str, out: Path | None, progress: Progress) -> CalibrateReport:
    """Calibrate the camera of a rig, and write the file.

    Args:
        name: ``sim``, which is started for it, or a rig file, whose controller runs.
        out: file to write; None: the rig file's ``calibration``, or ``games/calibration.json`` of a simulation.
        progress: told what is being done.

    Raises:
        UserError: there is no such rig, or a device failed.
    """
    rig = choose_rig(name)
    path = out or (rig.calibration if rig is not None else GAMES / FILE)
    with ExitStack() as stack:
        setup, settings = _setup(rig)
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="touchmove-")))
        try:
            setup.marker  # noqa: B018  # asked for before anything starts
            devices = stack.enter_context(open_rig(rig, folder / "run", settings, progress))
            found = calibrate_rig(devices, setup, progress, datetime.now(UTC))
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


def _setup(rig: RigFile | None) -> tuple[Setup, SimRigSettings | None]:
    """What is known of a rig; and the world of a simulation of our own, with an empty board."""
    if rig is not None:
        return Setup(rig.table, load_parameters(rig.parameters), MotionSettings().at(rig.table)), None
    table = TableSettings()
    motion = MotionSettings().at(table)
    world = WorldSettings(pieces=(), home=motion.home, table=table, pace=Pace.FAST)
    return Setup(table, load_parameters(), motion), SimRigSettings(world=world)


