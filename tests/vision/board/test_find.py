"""Finding the board: in drawn, rendered and real pictures, and never a wrong one."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from app.measure.bench.vision.photos import find_rows, photographs
from hardware.sim.render.settings import LightSettings
from tests.vision.drawing import START, Drawing, corners_of, draw, pose
from vision.board.find import FoundBoard, find_board
from vision.board.view import BoardNotFound

MIDDLE_GAME = "r1bq1rk1/pp2bppp/2n1pn2/3p4/3P4/2NBPN2/PP3PPP/R1BQ1RK1"
SIZE = (640, 480)


def off(found: FoundBoard, corners: NDArray[np.float64], turns: tuple[int, ...] = (0,)) -> float:
    """Worst corner [sides of a square] at the best of some quarter turns."""
    side = math.sqrt(cv2.contourArea(corners.astype(np.float32))) / 8.0
    return min(
        float(np.linalg.norm(np.roll(found.corners, -turn, axis=0) - corners, axis=1).max()) / side for turn in turns
    )


@settings(max_examples=8)
@given(
    st.floats(0.0, 0.8), st.floats(-math.pi, math.pi), st.floats(0.45, 0.72), st.floats(0.25, 0.75),
    st.sampled_from([None, START, MIDDLE_GAME]), st.floats(0.0, 6.0), st.floats(0.0, 1.0), st.integers(20, 235),
)  # fmt: skip
def test_any_view_of_a_drawn_board_is_found(
    tilt: float, turn: float, fill: float, ratio: float, placement: str | None, noise: float, border: float, frame: int
) -> None:
    light = (200, 180, 150)
    dark = tuple(int(ratio * one) for one in light)
    drawing = Drawing(light=light, dark=dark, frame=(frame, frame // 2, 40), border=border, noise=noise)
    seen = pose(tilt, turn, fill, SIZE)
    found = find_board(draw(seen, placement, drawing))
    assert off(found, corners_of(seen), turns=(0, 2)) < 0.06
    assert found.error < 0.15
    if found.oriented:
        assert off(found, corners_of(seen)) < 0.06


@pytest.mark.parametrize("turn", [0.1, 1.7, 3.2, 4.8])
def test_the_start_position_tells_where_a1_is(turn: float) -> None:
    seen = pose(0.5, turn, 0.65, SIZE)
    found = find_board(draw(seen, START, Drawing()))
    assert found.oriented
    assert off(found, corners_of(seen)) < 0.04


def test_an_empty_board_is_not_oriented() -> None:
    found = find_board(draw(pose(0.3, 0.4, 0.6, SIZE), None, Drawing()))
    assert not found.oriented


@pytest.mark.parametrize("squares", [7, 9, 10])
def test_a_pattern_that_is_not_eight_by_eight_is_no_board(squares: int) -> None:
    seen = pose(0.2, 0.3, 0.6, SIZE)
    shrunk = seen @ np.diag([8.0 / squares, 8.0 / squares, 1.0])
    with pytest.raises(
        BoardNotFound, match=r"no chessboard was found with certainty in this picture: .*; show all of it"
    ):
        find_board(draw(shrunk, None, Drawing(squares=squares)))


def test_a_board_of_which_a_row_is_cut_off_is_not_given() -> None:
    seen = pose(0.0, 0.0, 0.8, SIZE)
    colour = draw(seen, None, Drawing())
    row = float(corners_of(seen)[2, 1])
    side = 0.1 * SIZE[1]
    cut = np.ascontiguousarray(colour[round(row + 1.5 * side) :])
    with pytest.raises(BoardNotFound):
        find_board(cut)


def test_a_covered_row_is_never_taken_for_the_border() -> None:
    """A cloth over the first rank looks like table: eight rows cannot be told from seven and something else."""
    seen = pose(0.0, 0.0, 0.7, SIZE)
    colour = draw(seen, None, Drawing())
    a1, _, h8, _ = corners_of(seen)
    top = round(a1[1] - (a1[1] - h8[1]) / 8.0)
    colour[top:, :] = (90, 95, 100)
    with pytest.raises(BoardNotFound):
        find_board(colour)


@pytest.mark.parametrize("kind", ["noise", "even", "stripes"])
def test_pictures_without_a_board(kind: str) -> None:
    rng = np.random.default_rng(4)
    colour = np.full((480, 640, 3), 120, np.uint8)
    if kind == "noise":
        colour = rng.integers(0, 256, (480, 640, 3), dtype=np.uint8)
    elif kind == "stripes":
        colour[:, ::2] = 30
        colour[100:140] = 220
    with pytest.raises(BoardNotFound, match="no chessboard was found with certainty"):
        find_board(colour)


def test_near_where_it_was_it_keeps_its_a1() -> None:
    before = corners_of(pose(0.4, 2.0, 0.6, SIZE))
    seen = pose(0.4, 2.05, 0.6, SIZE, shift=(0.03, -0.02))
    found = find_board(draw(seen, None, Drawing()), near=before)
    assert found.oriented
    assert off(found, corners_of(seen)) < 0.04


def test_lens_distortion_is_allowed_for() -> None:
    seen = pose(0.3, 0.3, 0.75, SIZE)
    colour = draw(seen, START, Drawing())
    bending = -0.06
    v, u = np.mgrid[0:480, 0:640].astype(np.float64)
    centre, half = np.array([319.5, 239.5]), math.hypot(319.5, 239.5)

    def ideal(points: NDArray[np.float64]) -> NDArray[np.float64]:
        offset = (points - centre) / half
        straight = offset.copy()
        for _ in range(20):
            straight = offset / (1.0 + bending * (straight**2).sum(axis=-1, keepdims=True))
        return centre + half * straight

    source = ideal(np.stack([u, v], axis=-1)).astype(np.float32)
    bent = cv2.remap(colour, source, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    offset = (corners_of(seen) - centre) / half
    truth = centre + half * offset * (1.0 + bending * (offset**2).sum(axis=1, keepdims=True))
    assert off(find_board(np.asarray(bent, dtype=np.uint8)), truth) < 0.06


CASES: list[tuple[str | None, tuple[float, float, float] | None, float, tuple[float, float, float], float]] = [
    (None, None, 0.0, (0.9, 0.5, 1.0), 1.0),
    (START + " w KQkq - 0 1", (0.08, 0.05, 0.37), 0.3, (-1.0, 0.3, 0.5), 0.6),
    (MIDDLE_GAME + " w - - 0 1", (-0.05, 0.12, 0.35), 2.0, (0.5, -0.8, 0.5), 1.6),
]


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=["empty", "start", "middle game"])
def test_the_rigs_camera(renderer: Callable[..., Any], case: Any) -> None:
    from tests.vision.rendering import rendered

    fen, tool, turn, lamp, exposure = case
    colour, corners = rendered(
        renderer, fen, None if tool is None else np.array(tool), turn, LightSettings(direction=lamp), 1, exposure
    )
    found = find_board(colour)
    assert off(found, corners, turns=(0, 2)) < 0.06
    assert found.oriented == (fen is not None and fen.startswith(START))
    if found.oriented:
        assert off(found, corners) < 0.06


def _photos() -> Path:
    folder = os.environ.get("TOUCHMOVE_PHOTOS")
    if not folder or not Path(folder).is_dir():
        pytest.skip("no labelled photographs here: set TOUCHMOVE_PHOTOS to their folder")
    return Path(folder)


@pytest.mark.slow
def test_photographs() -> None:
    pictures = list(photographs(_photos()))[::8]
    found = 0
    for picture in pictures:
        try:
            board = find_board(picture.colour)
        except BoardNotFound:
            continue
        assert off(board, picture.corners, turns=(0, 1, 2, 3)) < 0.5, picture.name
        if picture.oriented and board.oriented:
            assert off(board, picture.corners) < 0.5, picture.name
        found += off(board, picture.corners, turns=(0, 1, 2, 3)) <= 0.15
    assert found >= 0.75 * len(pictures)


def test_the_bench_counts(tmp_path: Path) -> None:
    import json

    seen = pose(0.3, 0.2, 0.65, SIZE)
    corners = corners_of(seen)
    cv2.imwrite(str(tmp_path / "good.png"), draw(seen, START, Drawing())[..., ::-1])
    cv2.imwrite(str(tmp_path / "none.png"), np.full((480, 640, 3), 90, np.uint8))
    good = {"file": "good.png", "corners_px": dict(zip(("a1", "h1", "h8", "a8"), corners.tolist(), strict=True))}
    shifted = {"file": "good.png", "corners_unordered": (corners + 30.0).tolist()[::-1]}
    none = {"file": "none.png", "corners_px": good["corners_px"]}
    labels = {"schema": "chess-stills/1", "images": [good, shifted, none]}
    (tmp_path / "labels.json").write_text(json.dumps(labels))
    rows = find_rows(tmp_path)
    assert rows["found"].mean == pytest.approx(1 / 3)
    assert not rows["found"].holds
    assert rows["wrong"].mean == pytest.approx(1 / 3)
    assert rows["turned"].mean == 0.0
    with pytest.raises(FileNotFoundError, match=r"no labels\.json lies below"):
        find_rows(tmp_path / "elsewhere")


def test_polygons_count_pixels_from_the_pictures_corner_and_are_taken_as_opencv_does(tmp_path: Path) -> None:
    import json

    corners = corners_of(pose(0.3, 0.2, 0.65, SIZE))
    cv2.imwrite(str(tmp_path / "one.png"), np.full((480, 640, 3), 90, np.uint8))
    drawn = {"file": "one.png", "corners_unordered": (corners[[2, 0, 3, 1]] + 0.5).tolist()}
    (tmp_path / "labels.json").write_text(json.dumps({"schema": "chess-stills/1", "images": [drawn]}))
    (picture,) = photographs(tmp_path)
    assert not picture.oriented
    turns = [np.roll(picture.corners, turn, axis=0) for turn in range(4)]
    assert min(np.abs(turned - corners).max() for turned in turns) < 1e-9
