"""The board from markers, and the sheet to print them."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from hardware.table import TableSettings
from tests.vision.drawing import CORNERS, corners_of, pose
from vision.board.markers import MarkerSettings, find_markers, write_sheet
from vision.board.view import BoardNotFound

TABLE = TableSettings()
SETTINGS = MarkerSettings.beside(TABLE)
SIZE = (960, 720)


def picture(seen: NDArray[np.float64], shown: tuple[int, ...] = (0, 1, 2, 3), push: float = 0.0) -> NDArray[np.uint8]:
    """Markers on an even table; the last one lies off by ``push`` [m]."""
    colour = np.full((SIZE[1], SIZE[0], 3), 200, np.uint8)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    for one in shown:
        image = cv2.cvtColor(cv2.aruco.generateImageMarker(dictionary, one, 120), cv2.COLOR_GRAY2RGB)
        shift = np.array([push if one == shown[-1] else 0.0, 0.0])
        places = (SETTINGS.corners(one) + shift) / TABLE.square + 4.0
        raised = np.hstack([places, np.ones((4, 1))]) @ seen.T
        target = (raised[:, :2] / raised[:, 2:]).astype(np.float32)
        source = np.array([[-0.5, -0.5], [119.5, -0.5], [119.5, 119.5], [-0.5, 119.5]], np.float32)
        cv2.warpPerspective(
            image, cv2.getPerspectiveTransform(source, target), SIZE, dst=colour, flags=cv2.INTER_AREA,
            borderMode=cv2.BORDER_TRANSPARENT,
        )  # fmt: skip
    return np.asarray(cv2.GaussianBlur(colour, (0, 0), 0.7), dtype=np.uint8)


@pytest.mark.parametrize("shown", [(0, 1, 2, 3), (0, 2, 3), (1, 2, 3)])
@pytest.mark.parametrize("turn", [0.0, 2.2])
def test_markers_tell_place_and_orientation(shown: tuple[int, ...], turn: float) -> None:
    seen = pose(0.4, turn, 0.42, SIZE)
    found = find_markers(picture(seen, shown), SETTINGS, TABLE)
    corners = corners_of(seen)
    side = np.linalg.norm(corners[1] - corners[0]) / 8.0
    assert found.oriented
    assert np.linalg.norm(found.corners - corners, axis=1).max() < 0.1 * side


def test_too_few_markers_are_named() -> None:
    seen = pose(0.4, 0.0, 0.42, SIZE)
    with pytest.raises(BoardNotFound, match=r"2 of the four markers are seen, .* uncover 2 \(h8\), 3 \(a8\)"):
        find_markers(picture(seen, (0, 1)), SETTINGS, TABLE)


def test_a_marker_in_another_place_is_noticed() -> None:
    with pytest.raises(BoardNotFound, match=r"the markers are up to .* squares from where the settings have them"):
        find_markers(picture(pose(0.4, 0.0, 0.42, SIZE), push=0.06), SETTINGS, TABLE)


@pytest.mark.parametrize(
    ("side", "centres", "message"),
    [
        (0.0, SETTINGS.centres, "a marker of 0.0 m is impossible"),
        (0.03, (SETTINGS.centres[0],) * 4, "two markers lie on one another"),
        (0.03, SETTINGS.centres[:3], "give the centres of four markers"),
    ],
)
def test_settings_that_make_no_sense(side: float, centres: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        MarkerSettings(side, centres)  # type: ignore[arg-type]


def test_the_sheet_has_true_size_and_readable_markers(tmp_path: Path) -> None:
    path = tmp_path / "markers.svg"
    write_sheet(path, SETTINGS)
    text = path.read_text()
    assert 'width="210mm" height="297mm" viewBox="0 0 210 297"' in text
    assert text.count('width="30.0000" height="30.0000" fill="black"') == 4
    scale = 8
    page = np.full((297 * scale, 210 * scale, 3), 255, np.uint8)
    for x, y, w, h in re.findall(
        r'<rect x="([\d.]+)" y="([\d.]+)" width="([\d.]+)" height="([\d.]+)" fill="black"', text
    ):
        _fill(page, scale, (float(x), float(y), float(w), float(h)), 0)
    for x, y, w in re.findall(r"M([\d.]+) ([\d.]+)h([\d.]+)v", text):
        _fill(page, scale, (float(x), float(y), float(w), float(w)), 255)
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50))
    _, numbers, _ = detector.detectMarkers(page)
    assert sorted(np.ravel(numbers).tolist()) == [0, 1, 2, 3]
    assert np.isfinite(CORNERS).all()


def _fill(page: NDArray[np.uint8], scale: int, box: tuple[float, float, float, float], value: int) -> None:
    x, y, w, h = (round(scale * one) for one in box)
    page[y : y + h, x : x + w] = value


def test_sheets_that_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"give a name that ends in \.svg"):
        write_sheet(tmp_path / "markers.pdf", SETTINGS)
    with pytest.raises(ValueError, match="do not fit on a page of A4"):
        write_sheet(tmp_path / "markers.svg", MarkerSettings.beside(TABLE, side=0.09))
