"""Rows of ``touchmove bench vision``: how exactly pieces are found, and how exactly the camera is calibrated.

Truth is the simulator's own: where pieces were put, and how the camera was hung.
"""

from __future__ import annotations

import math
import tempfile
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

import chess
import cv2
import numpy as np

from app.commissioning.calibrate import calibrate_rig, corners_near
from app.commissioning.marker_survey import Setup
from app.measure.bench.report import Progress, Row, row
from app.motion import MotionSettings
from app.pieces.layout import start_layout
from app.rig.rig_file import WorldSection
from app.rig.simulation.settings import NO_PIECES, own_rig
from app.rig.simulation.sim import SimRig
from hardware.interfaces import Pace
from hardware.parameters import load_parameters
from hardware.sim.bodies.scene import build_model
from hardware.sim.process.scene_control import SceneControl
from hardware.sim.process.table_studio import PlacedPiece, TableStudio, true_camera
from hardware.sim.render.settings import ExposureSettings, LightSettings, MountSettings, SceneState
from hardware.table import PieceSpec, TableSettings, square_place
from vision.arrays import Array
from vision.board.view import BoardView
from vision.pieces.centres import piece_centres

OFF: Final = 0.2  # pieces stand up to so far off, in squares
SHIFT: Final = 0.030  # the camera hangs up to so far off [m] …
TURN: Final = math.radians(4.0)  # … and turned by up to so much [rad]
POSE_SHIFT, POSE_TURN = 1.5e-4, 2e-4
"""The board's pose is known to within this, standard deviations along each axis [m, rad]: about twice what calibrations
leave that ``calibration_rows`` measures."""
MEAN_LIMIT_MM: Final = 1.0
CENTRE_LIMIT_MM: Final = 2.5
CALIBRATION_LIMIT_MM: Final = 2.0
_FRAMES: Final = {True: 4, False: 24}
"""By ``quick``."""
_MOUNTS: Final = {True: 1, False: 6}


def random_mount(rng: np.random.Generator) -> MountSettings:
    """A camera that hangs off in all six ways, by up to ``SHIFT`` and ``TURN`` each way."""
    x, y, z = rng.uniform(-SHIFT, SHIFT, 3).tolist()
    axis = rng.normal(size=3)
    a, b, c = (axis / np.linalg.norm(axis) * rng.uniform(-TURN, TURN)).tolist()
    return MountSettings(shift=(x, y, z), turn=(a, b, c))


def random_looks(rng: np.random.Generator, mount: MountSettings) -> SceneState:
    """A room's light from anywhere, brighter and darker, with hard or soft shadows."""
    around, up = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(0.6, 2.0)
    light = LightSettings(
        direction=(math.cos(around), math.sin(around), up), brightness=rng.uniform(0.35, 0.8),
        ambient=rng.uniform(0.15, 0.4), fill=rng.uniform(0.15, 0.4), radius=float(rng.choice([0.0, 0.1])),
    )  # fmt: skip
    red, green, blue = rng.uniform(0.9, 1.1, 3).tolist()
    exposure = ExposureSettings(time=rng.uniform(0.6, 1.1), white_balance=(red, green, blue))
    return SceneState(light=light, exposure=exposure, mount=mount)


def random_position(
    pieces: list[PieceSpec], table: TableSettings, rng: np.random.Generator
) -> tuple[list[PlacedPiece], dict[int, PieceSpec]]:
    """Some of the pieces on any squares, each off its centre and turned; and what stands where."""
    squares = rng.permutation(64)[: len(pieces)].tolist()
    poses, expected = [], {}
    for piece, square in zip(pieces, squares, strict=True):
        if rng.random() < 0.1:
            continue
        x, y = table.xy(square_place(square))
        reach, angle = OFF * table.square * math.sqrt(rng.random()), rng.uniform(0.0, 2.0 * math.pi)
        turn = rng.uniform(-math.pi, math.pi)
        poses.append(PlacedPiece(piece.name, x + reach * math.cos(angle), y + reach * math.sin(angle), yaw=turn))
        expected[square] = piece
    return poses, expected


def centre_rows(quick: bool, progress: Progress) -> dict[str, Row]:
    """Errors of piece centres over random positions, offsets, light, shadows and camera poses."""
    table, rng = TableSettings(), np.random.default_rng(11)
    pieces = [piece for piece in start_layout(chess.Board(), table) if piece.place.on_board]
    errors: dict[bool, list[float]] = {True: [], False: []}
    times = []
    with TableStudio(pieces, table, MotionSettings().home) as studio:
        for number in range(_FRAMES[quick]):
            progress(f"piece centres: picture {number + 1} of {_FRAMES[quick]}")
            looks = random_looks(rng, random_mount(rng))
            poses, expected = random_position(pieces, table, rng)
            frame = studio.frame(poses, looks, seed=number)
            view = BoardView(frame.intrinsics, _nearly(studio.camera_from_board(looks.mount), rng), table)
            for depth, those in errors.items():
                piece_centres(frame, view, expected, use_depth=depth)  # what is kept for a view is made
                since = time.perf_counter()
                found = piece_centres(frame, view, expected, use_depth=depth)
                times.append(time.perf_counter() - since)
                for square, pose in zip(expected, poses, strict=True):
                    those.append(math.hypot(found[square].x - pose.x, found[square].y - pose.y))
    return {
        "centre": row(1e3 * np.array(errors[True]), "mm", MEAN_LIMIT_MM, "mean"),
        "centre worst": row(1e3 * np.array(errors[True]), "mm", CENTRE_LIMIT_MM, "max"),
        "centre colour": row(1e3 * np.array(errors[False]), "mm"),
        "centre time": row(1e3 * np.array(times), "ms"),
    }


def _nearly(pose: Array, rng: np.random.Generator) -> Array:
    """A pose with the errors that a calibration leaves."""
    turned = pose.copy()
    turned[:3, :3] = np.asarray(cv2.Rodrigues(rng.normal(0.0, POSE_TURN, 3))[0]) @ pose[:3, :3]
    turned[:3, 3] += rng.normal(0.0, POSE_SHIFT, 3)
    return turned


def calibration_rows(quick: bool, progress: Progress) -> dict[str, Row]:
    """Errors over the 64 squares after ``touchmove calibrate``, for cameras that hang off as the bar says.

    The whole way: world, controller, arm, camera.

    Raises:
        UserError: a process or device failed.
        CalibrationFailed: a camera could not be calibrated.
    """
    table, motion, rng = TableSettings(), MotionSettings(), np.random.default_rng(12)
    setup = Setup(table, load_parameters(), motion)
    world = WorldSection(pace=Pace.FAST, seed=12, fen=NO_PIECES)
    model = build_model(setup.parameters, table, (), np.array(motion.home))
    errors, residuals, heights, places, times = [], [], [], [], []
    with tempfile.TemporaryDirectory(prefix="touchmove-") as folder:
        run_dir = Path(folder) / "run"
        with SimRig(own_rig(run_dir, world), lambda _step: None) as rig:
            stage = SceneControl(run_dir)
            for number in range(_MOUNTS[quick]):
                progress(f"calibration: camera {number + 1} of {_MOUNTS[quick]}")
                mount = random_mount(rng)
                looks = random_looks(rng, mount)
                stage.change(mount=mount, light=looks.light, exposure=looks.exposure)
                since = time.perf_counter()
                found = calibrate_rig(rig, setup, lambda _step: None, datetime.now(UTC), corners_near)
                times.append(time.perf_counter() - since)
                errors += square_errors(found.calibration.base_from_camera(), true_camera(model, mount), table)
                residuals += found.pose.aside[found.pose.used].tolist()
                assert found.calibration.board is not None
                x, y, z = np.abs(np.subtract(found.calibration.board.centre, table.centre_in_base)).tolist()
                heights.append(z)
                places.append(math.hypot(x, y))
            stage.close()
    return {
        "calibration": row(1e3 * np.array(errors), "mm", MEAN_LIMIT_MM, "mean"),
        "calibration worst": row(1e3 * np.array(errors), "mm", CALIBRATION_LIMIT_MM, "max"),
        "residual": row(1e3 * np.array(residuals), "mm"),
        "board height": row(1e3 * np.array(heights), "mm"),
        "board place": row(1e3 * np.array(places), "mm"),
        "calibration time": row(times, "s"),
    }


def square_errors(base_from_camera: Array, camera_from_board: Array, table: TableSettings) -> list[float]:
    """How far from where it is each square's centre comes out in the base frame [m].

    ``base_from_camera`` is as calibrated, ``camera_from_board`` the truth, both of shape (4, 4).
    """
    squares = np.array([[*table.xy(square_place(square)), 0.0, 1.0] for square in range(64)])
    found = squares @ (base_from_camera @ camera_from_board).T
    distance: list[float] = np.linalg.norm(found[:, :3] - table.base_from_board(squares[:, :3]), axis=1).tolist()
    return distance
