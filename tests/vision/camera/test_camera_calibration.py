"""The camera's pose from a point of the tool, the marker in a picture, where the board lies: against closed forms."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from app.commissioning.marker_survey import Setup, showing_points
from app.motion import MotionSettings
from hardware.interfaces import Frame, Intrinsics
from hardware.parameters import load_parameters
from hardware.piece_set import PIECE_SHAPES
from hardware.sim.bodies.marker import marker_picture
from hardware.table import TableSettings, square_place
from vision.board.view import playing_area
from vision.camera.calibration import CalibrationFailed, CameraPose, depth_factor, solve_pose
from vision.camera.marker import find_marker
from vision.camera.table_plane import board_place, find_plane, nominal_view

Array = NDArray[np.float64]
TABLE = TableSettings()
PINHOLE = Intrinsics(640, 480, 617.0, 617.0, 319.5, 239.5)
MARKER = np.array([0.0, -0.062, -0.072])
POINTS = np.array(showing_points(Setup(TABLE, load_parameters(), MotionSettings()))) + MARKER
SQUARES = TABLE.base_from_board(np.array([[*TABLE.xy(square_place(square)), 0.0] for square in range(64)]))


def camera(shift: tuple[float, float, float] = (0.0, 0.0, 0.0), turn: tuple[float, ...] = (0.0, 0.0, 0.0)) -> Array:
    """camera_from_base of the usual camera, moved [m] and turned about its own axes [rad]."""
    position = np.add((0.0, -0.46, 0.03), shift)
    forward = np.subtract((0.0, -0.02, 0.47), (0.0, -0.46, 0.03))
    forward /= np.linalg.norm(forward)
    right = np.array([-1.0, 0.0, 0.0])  # z3 points down
    axes = np.stack([right, np.cross(forward, right), forward])
    rotation = np.asarray(cv2.Rodrigues(np.array(turn))[0]) @ axes
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, -rotation @ position
    return pose


def pictures(pose: Array, points: Array) -> Array:
    seen = points @ pose[:3, :3].T + pose[:3, 3]
    return seen[:, :2] / seen[:, 2:] * 617.0 + (319.5, 239.5)


def errors(found: CameraPose, pose: Array) -> Array:
    """Of all squares [m]."""
    seen = SQUARES @ pose[:3, :3].T + pose[:3, 3]
    back = found.base_from_camera
    return np.asarray(np.linalg.norm(seen @ back[:3, :3].T + back[:3, 3] - SQUARES, axis=1))


small = st.floats(-1.0, 1.0)


@settings(max_examples=25)
@given(shift=st.tuples(small, small, small), turn=st.tuples(small, small, small), seed=st.integers(0, 1000))
def test_any_camera_near_the_usual_one_is_found(
    shift: tuple[float, float, float], turn: tuple[float, float, float], seed: int
) -> None:
    pose = camera(tuple(0.03 * one for one in shift), tuple(0.07 * one for one in turn))  # type: ignore[arg-type]
    exact = solve_pose(PINHOLE, POINTS, pictures(pose, POINTS))
    assert errors(exact, pose).max() < 1e-6
    noisy = pictures(pose, POINTS) + np.random.default_rng(seed).normal(0.0, 0.15, (len(POINTS), 2))
    found = solve_pose(PINHOLE, POINTS, noisy)
    assert errors(found, pose).max() < 1e-3


def test_the_expected_error_is_what_comes_out() -> None:
    rng, pose = np.random.default_rng(5), camera()
    ratios = []
    for _ in range(60):
        found = solve_pose(PINHOLE, POINTS, pictures(pose, POINTS) + rng.normal(0.0, 0.15, (len(POINTS), 2)))
        ratios.append((errors(found, pose) ** 2).mean() / (found.expected_error(SQUARES) ** 2).mean())
    assert 0.6 < float(np.mean(ratios)) < 1.6


def test_markers_seen_elsewhere_do_not_count() -> None:
    pose = camera()
    pixels = pictures(pose, POINTS)
    pixels[[2, 11]] += [[40.0, -25.0], [0.0, 9.0]]
    found = solve_pose(PINHOLE, POINTS, pixels)
    assert np.flatnonzero(~found.used).tolist() == [2, 11]
    assert errors(found, pose).max() < 1e-5
    assert found.residual[2] == pytest.approx(math.hypot(40.0, 25.0), rel=1e-3)


def test_too_few_and_too_narrow_is_refused() -> None:
    pixels = pictures(camera(), POINTS)
    with pytest.raises(CalibrationFailed, match="was seen at 7 points, at least 8 are needed"):
        solve_pose(PINHOLE, POINTS[:7], pixels[:7])
    level = POINTS[:9]
    with pytest.raises(CalibrationFailed, match=r"spread by only \d+ and 0 mm, 40 and 13 mm are needed"):
        solve_pose(PINHOLE, level, pixels[:9])


def test_depth_is_put_right_by_the_marker() -> None:
    pose = camera()
    found = solve_pose(PINHOLE, POINTS, pictures(pose, POINTS))
    true = POINTS @ pose[2, :3] + pose[2, 3]
    factor, scatter = depth_factor(found, POINTS, true / 1.012)
    assert factor == pytest.approx(1.012, abs=1e-5)
    assert scatter < 1e-5
    assert depth_factor(found, POINTS, np.zeros(len(POINTS))) == (1.0, 0.0)


def test_points_clear_all_pieces_and_stay_over_the_board() -> None:
    tallest = max(shape.height for shape in PIECE_SHAPES.values())
    on_board = TABLE.board_from_base(POINTS - MARKER)
    assert (on_board[:, 2] - load_parameters().pads.half_height > tallest + 0.01).all()
    assert (np.abs(on_board[:, :2]) <= 4.0 * TABLE.square).all()
    assert 15 <= len(POINTS) <= 25


# ------------------------------------------------------------------------------------------------------- marker


def painted(corners: Array, number: int = 7) -> NDArray[np.uint8]:
    """A picture in which the outer corners of the black square are at these pixels, drawn with smooth edges."""
    image = marker_picture(number)
    side = image.shape[0]
    inner = np.array([[32, 32], [side - 32, 32], [side - 32, side - 32], [32, side - 32]], dtype=np.float32) - 0.5
    fine = (8.0 * (corners + 0.5) - 0.5).astype(np.float32)
    matrix = cv2.getPerspectiveTransform(inner, fine)
    large = cv2.warpPerspective(image, matrix, (8 * 640, 8 * 480), borderValue=(120.0,), flags=cv2.INTER_AREA)
    small = cv2.resize(large, (640, 480), interpolation=cv2.INTER_AREA)
    return np.repeat(np.asarray(small, dtype=np.uint8)[..., None], 3, axis=2)


def test_the_marker_is_found_to_a_fraction_of_a_pixel() -> None:
    corners = np.array([[300.3, 200.7], [341.1, 203.2], [338.4, 232.9], [298.8, 229.4]])
    first, second = corners[2] - corners[0], corners[3] - corners[1]
    share = np.linalg.solve(np.column_stack([first, -second]), corners[1] - corners[0])
    seen = find_marker(painted(corners), 7)
    assert seen is not None
    np.testing.assert_allclose(seen.centre, corners[0] + share[0] * first, atol=0.15)
    assert find_marker(painted(corners), 8) is None
    assert find_marker(np.full((480, 640, 3), 90, np.uint8), 7) is None


# -------------------------------------------------------------------------------------------------------- board


def test_the_board_is_found_from_depth_and_corners() -> None:
    """A board 6 mm lower than believed, shifted, turned by 2°, with a tenth of it covered by pieces."""
    pose = camera()
    found = solve_pose(PINHOLE, POINTS, pictures(pose, POINTS))
    yaw, centre = math.radians(2.0), np.array([0.004, -0.003, 0.476])
    cos, sin = math.cos(yaw), math.sin(yaw)
    corners = playing_area(TABLE) @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    pixels = pictures(pose, corners * (1.0, -1.0, -1.0) + centre)
    v, u = np.mgrid[:480, :640]
    ray = np.stack([(u - 319.5) / 617.0, (v - 239.5) / 617.0, np.ones_like(u)], axis=-1)
    normal, eye = pose[:3, :3] @ (0.0, 0.0, 1.0), pose[:3, 3]
    depth = (normal @ (pose[:3, :3] @ centre + eye)) / (ray @ normal)
    rng = np.random.default_rng(2)
    depth += rng.normal(0.0, 1.3e-3, depth.shape)
    depth[rng.random(depth.shape) < 0.1] -= 0.03
    frame = Frame(np.zeros((480, 640, 3), np.uint8), depth.astype(np.float32), PINHOLE, 0.0)
    plane = find_plane(frame, found, TABLE)
    assert plane is not None
    assert plane.height == pytest.approx(0.476, abs=3e-4)
    for by_depth in (plane, None):
        place = board_place(found, TABLE, pixels, by_depth)
        assert place is not None
        np.testing.assert_allclose(place.centre, centre, atol=4e-4)
        assert place.yaw == pytest.approx(yaw, abs=2e-3)
        assert place.tilt < 3e-3
    alone = board_place(found, TABLE, None, plane)
    assert alone is not None
    assert alone.centre[:2] == TABLE.centre_in_base[:2]
    assert board_place(found, TABLE, None, None) is None
    assert nominal_view(found, TABLE).depth([0.0, 0.0, 0.0]) == pytest.approx(float((pose @ (0, 0, 0.47, 1))[2]))
