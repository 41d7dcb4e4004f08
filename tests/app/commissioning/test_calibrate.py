"""``touchmove calibrate``: its file, its command, and the whole way on a simulated rig whose camera hangs off."""

from __future__ import annotations

import json
import tempfile
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from typer.testing import CliRunner

from app.cli.commands import app
from app.commissioning.calibrate import calibrate_rig, corners_near
from app.commissioning.marker_survey import MarkerObservation, Setup, showing_points
from app.measure.bench.vision.calibration import square_errors
from app.motion import MotionSettings
from app.rig.devices import Rig
from app.rig.rig_file import WorldSection
from app.rig.simulation.settings import NO_PIECES, own_rig
from app.rig.simulation.sim import SimRig
from app.settings.calibration import (
    CalibratedBoard,
    Calibration,
    CalibrationUnusable,
    Pinhole,
    as_rows,
    load_calibration,
    write_calibration,
)
from hardware.interfaces import Frame, Intrinsics, Pace
from hardware.parameters import load_parameters
from hardware.sim.bodies.scene import build_model
from hardware.sim.process.table_studio import true_camera
from hardware.sim.render.settings import CameraSettings, MountSettings
from hardware.table import TableSettings
from vision.board.view import playing_area
from vision.camera.calibration import CalibrationFailed
from vision.camera.marker import SeenMarker

TABLE = TableSettings()
PINHOLE = Intrinsics(640, 480, 617.0, 617.0, 319.5, 239.5)


def calibration(board: CalibratedBoard | None = None) -> Calibration:
    pose = np.array([[-1.0, 0, 0, 0], [0, 0.6, 0.8, 0.1], [0, 0.8, -0.6, 0.7], [0, 0, 0, 1]])
    return Calibration(
        made="2026-01-01T00:00:00+00:00", pinhole=Pinhole.of(PINHOLE), camera_from_base=as_rows(pose), depth_factor=1.0,
        points=20, left_out=1, mean_residual=1e-4, worst_residual=3e-4, mean_error=1e-4, worst_error=2e-4, board=board,
    )  # fmt: skip


def test_the_file_is_read_as_it_was_written(tmp_path: Path) -> None:
    board = CalibratedBoard(centre=(0.001, -0.002, 0.471), yaw=0.02, tilt=0.001, by_depth=True, by_corners=True)
    for one in (calibration(), calibration(board)):
        path = tmp_path / "new" / "calibration.json"
        write_calibration(path, one)
        assert load_calibration(path) == one
        np.testing.assert_allclose(one.base_from_camera() @ one.pose(), np.eye(4), atol=1e-12)
    assert json.loads(path.read_text())["version"] == 1


def test_views_follow_the_board_where_it_was_found() -> None:
    board = CalibratedBoard(centre=(0.0, 0.0, 0.48), yaw=0.1, tilt=0.0, by_depth=True, by_corners=True)
    plain, moved = calibration().board_view(TABLE), calibration(board).board_view(TABLE)
    point = np.array([0.1, 0.0, 0.0])
    in_base = np.array([0.1 * np.cos(0.1), -0.1 * np.sin(0.1), 0.48, 1.0])
    np.testing.assert_allclose(moved.project(point), _pixel(calibration().pose() @ in_base), atol=1e-9)
    np.testing.assert_allclose(plain.project(point), _pixel(calibration().pose() @ (0.1, 0.0, 0.47, 1.0)), atol=1e-9)


def _pixel(seen: np.ndarray) -> np.ndarray:  # type: ignore[type-arg]
    return np.array([seen[0] / seen[2] * 617.0 + 319.5, seen[1] / seen[2] * 617.0 + 239.5])


def test_games_play_on_the_board_where_it_was_found() -> None:
    found = CalibratedBoard(centre=(0.004, -0.003, 0.476), yaw=-0.02, tilt=0.0, by_depth=True, by_corners=True)
    lies = calibration(found).table(TABLE)
    np.testing.assert_allclose(lies.pose_in_base(), found.base_from_board(), atol=1e-12)
    assert lies.model_copy(update={"centre_in_base": TABLE.centre_in_base, "yaw_in_base": 0.0}) == TABLE
    assert calibration().table(TABLE) == TABLE, "of a board that was not found nothing is known"
    askew = found.model_copy(update={"yaw": 0.09})
    with pytest.raises(
        CalibrationUnusable, match=r"^the board is turned by 5.2° .*, at most 2.3° can be played on: turn"
    ):
        calibration(askew).table(TABLE)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"version": 2}, "version: Input should be 1: run 'touchmove calibrate' again"),
        ({"points": "many"}, "points: "),
        ({"camera_from_base": as_rows(2.0 * np.eye(4))}, "camera_from_base is not a rigid transform"),
    ],
)
def test_a_file_that_cannot_be_used_is_refused(tmp_path: Path, change: dict[str, object], message: str) -> None:
    path = tmp_path / "calibration.json"
    path.write_text(json.dumps({**json.loads(calibration().model_dump_json()), **change}))
    with pytest.raises(CalibrationUnusable, match=message):
        load_calibration(path)
    with pytest.raises(CalibrationUnusable, match=r"no calibration at .*: run 'touchmove calibrate'"):
        load_calibration(tmp_path / "none.json")


def test_frames_of_another_camera_are_refused() -> None:
    calibration().require_camera(PINHOLE)
    other = Intrinsics(1280, 720, 925.0, 925.0, 639.5, 359.5)
    with pytest.raises(CalibrationUnusable, match="use that camera at that size, or run 'touchmove calibrate' again"):
        calibration().require_camera(other)


def test_without_a_marker_nothing_starts() -> None:
    bare = load_parameters().model_copy(update={"marker": None})
    with pytest.raises(CalibrationFailed, match=r"parameters have no \[marker\]"):
        Setup(TABLE, bare, MotionSettings()).marker  # noqa: B018


def test_a_rig_that_is_not_there_ends_with_status_2() -> None:
    result = CliRunner().invoke(app, ["calibrate", "--rig", "nowhere.toml"])
    assert result.exit_code == 2


def calibrated(monkeypatch: pytest.MonkeyPatch, believed: float) -> Calibration:
    """By a camera of 925 px of focal length that is believed to have another one, as points and corners show it."""
    setup, half = Setup(TABLE, load_parameters(), MotionSettings()), 0.5**0.5
    axes = np.array([[-1.0, 0.0, 0.0], [0.0, -half, half], [0.0, half, half]])

    def seen(points: np.ndarray) -> np.ndarray:  # type: ignore[type-arg]
        there = (points - (0.0, -0.46, 0.03)) @ axes.T
        return np.asarray(there[:, :2] / there[:, 2:] * 925.0 + (639.5, 359.5))

    points = np.array(showing_points(setup)) + setup.marker.centre
    shown = [
        MarkerObservation(point, SeenMarker(pixel, np.zeros((4, 2))), 0.0)
        for point, pixel in zip(points, seen(points), strict=True)
    ]
    picture = np.zeros((720, 1280, 3), np.uint8)
    frame = Frame(picture, None, Intrinsics(1280, 720, believed, believed, 639.5, 359.5), 1.0)
    monkeypatch.setattr("app.commissioning.calibrate.show", lambda *_: shown)
    monkeypatch.setattr("app.commissioning.calibrate.fresh_frame", lambda *_: frame)
    corners = seen(TABLE.base_from_board(playing_area(TABLE)))
    rig = cast(Rig, SimpleNamespace(camera=object()))
    return calibrate_rig(rig, setup, lambda _step: None, datetime.now(UTC), lambda *_: corners).calibration


def test_a_webcam_is_calibrated_if_its_focal_length_is_about_right(monkeypatch: pytest.MonkeyPatch) -> None:
    board = calibrated(monkeypatch, 1.02 * 925.0).board
    assert board is not None
    assert board.by_corners


@pytest.mark.parametrize("share", [1.1, 1.3, 0.8])
def test_a_webcam_whose_focal_length_is_wrong_is_told_so(monkeypatch: pytest.MonkeyPatch, share: float) -> None:
    with pytest.raises(CalibrationFailed, match=r"px from .* correct a webcam's focal or field_of_view_deg"):
        calibrated(monkeypatch, share * 925.0)


@pytest.mark.slow
def test_a_camera_that_hangs_off_is_calibrated() -> None:
    mount = MountSettings(shift=(0.02, -0.03, 0.025), turn=(0.04, 0.03, -0.05))
    setup = Setup(TABLE, load_parameters(), MotionSettings())
    home = np.array(setup.motion.home)
    world = WorldSection(pace=Pace.FAST, camera=CameraSettings(mount=mount), seed=3, fen=NO_PIECES)
    with (
        tempfile.TemporaryDirectory(prefix="touchmove-") as folder,  # sockets want short paths
        SimRig(own_rig(Path(folder) / "run", world), lambda _step: None) as rig,
    ):
        found = calibrate_rig(rig, setup, lambda _step: None, datetime.now(UTC), corners_near)
        np.testing.assert_allclose(rig.arm.state().reference, home, atol=1e-6)
    model = build_model(setup.parameters, TABLE, (), home)
    errors = square_errors(found.calibration.base_from_camera(), true_camera(model, mount), TABLE)
    assert np.mean(errors) < 1e-3
    assert max(errors) < 2e-3
    assert found.calibration.worst_error < 1e-3
    assert found.calibration.board is not None
    assert found.calibration.board.by_corners
    np.testing.assert_allclose(found.calibration.board.centre[:2], (0.0, 0.0), atol=1.5e-3)
    assert abs(found.calibration.board.yaw) < 5e-3
    assert found.calibration.board.centre[2] == pytest.approx(TABLE.centre_in_base[2], abs=2e-3)
