"""Corners from crossings and sides together, and whether the error that is given can be relied on."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.vision.drawing import CORNERS, START, Drawing, corners_of, draw, pose
from vision.board.alternation import Look, channel_weights, look_into
from vision.board.find import SURE_ERROR, FoundBoard, find_board
from vision.board.grid import Grid
from vision.board.joint_fit import fit_jointly
from vision.board.lattice import fit_homography
from vision.board.saddles import levels
from vision.board.side_edges import SideEdges, measure_edges

SIZE = (640, 480)
MIDDLE_GAME = "r1bq1rk1/pp2bppp/2n1pn2/3p4/3P4/2NBPN2/PP3PPP/R1BQ1RK1"


def worst(found: FoundBoard, corners: NDArray[np.float64]) -> float:
    """Worst corner [sides of a square] at the best quarter turn."""
    side = math.sqrt(cv2.contourArea(corners.astype(np.float32))) / 8.0
    return min(
        float(np.linalg.norm(np.roll(found.corners, -turn, axis=0) - corners, axis=1).max()) / side for turn in range(4)
    )


def looked_at(colour: NDArray[np.uint8], corners: NDArray[np.float64]) -> tuple[Look, Grid]:
    """A picture of a board with a dark a1, and its grid."""
    picture = levels(colour)
    grid = Grid(fit_homography(CORNERS, corners), 0.0, (colour.shape[1], colour.shape[0]))
    inner = np.stack(np.meshgrid(np.arange(1.0, 8.0), np.arange(1.0, 8.0), indexing="ij"), axis=-1).reshape(-1, 2)
    return look_into(picture, channel_weights(picture, grid, -1, inner)), grid


def edges_of(drawing: Drawing, shift: tuple[float, float] = (0.0, 0.0), placement: str | None = None) -> SideEdges:
    """Edges of a board that is looked for a little beside its place, the shift in squares."""
    seen = pose(0.2, 0.3, 0.7, SIZE)
    look, grid = looked_at(draw(seen, placement, drawing), corners_of(seen))
    beside = np.array([[1.0, 0.0, shift[0]], [0.0, 1.0, shift[1]], [0.0, 0.0, 1.0]])
    return measure_edges(look, grid.moved(beside), 1)


@pytest.mark.parametrize("frame", [(222, 200, 165), (120, 75, 45), (170, 130, 95)], ids=["light", "dark", "between"])
def test_sides_are_seen_where_they_are(frame: tuple[int, int, int]) -> None:
    """Also on the border, whatever is beside it, and through pieces in the middle of squares."""
    edges = edges_of(Drawing(frame=frame), (0.05, -0.03), START)
    for axis, shift in ((0, -0.05), (1, 0.03)):
        for on in (edges.border, ~edges.border):
            off = edges.off[(edges.axis == axis) & on]
            assert len(off) >= 12
            assert float(np.median(off)) == pytest.approx(shift, abs=0.02)


@pytest.mark.parametrize("gap", [0.0, 0.075])
def test_a_line_around_the_board_is_not_its_border(gap: float) -> None:
    """Squares of its shade seem to end where it does; those of the other shade tell better."""
    edges = edges_of(Drawing(frame=(222, 200, 165), line=(gap, 0.075)))
    upper = edges.border & (edges.places[np.arange(len(edges.axis)), edges.axis] > 4.0)
    assert np.count_nonzero(upper) >= 12
    assert float(np.median(edges.off[upper])) == pytest.approx(0.0, abs=0.025)


def test_corners_with_a_line_around() -> None:
    seen = pose(0.3, 0.2, 0.7, SIZE)
    found = find_board(draw(seen, MIDDLE_GAME, Drawing(frame=(222, 200, 165), line=(0.075, 0.05))))
    assert worst(found, corners_of(seen)) < 0.03


def test_a_board_that_is_not_flat() -> None:
    seen = pose(0.4, 0.2, 0.7, SIZE)
    found = find_board(draw(seen, START, Drawing(bow=(0.05, 0.04))))
    error = worst(found, corners_of(seen))
    assert error < 0.06
    assert error < found.error


def test_what_is_hidden_makes_it_less_sure() -> None:
    """With a corner of the board under a cloth, that corner is known less well than the one across."""
    seen = pose(0.2, 0.0, 0.7, SIZE)
    colour = draw(seen, None, Drawing())
    look, grid = looked_at(colour, corners_of(seen))
    whole = fit_jointly(look, grid, 1)
    covered = colour.copy()
    patch = grid.project(np.array([[4.6, 4.6], [9.0, 4.6], [9.0, 9.0], [4.6, 9.0]]))
    cv2.fillConvexPoly(covered, np.round(patch).astype(np.int32), (128, 128, 128))
    hidden = fit_jointly(looked_at(covered, corners_of(seen))[0], grid, 1)
    assert whole is not None
    assert hidden is not None
    assert whole.error() < 0.1
    assert hidden.sigma[2] > 2.0 * hidden.sigma[0]
    assert hidden.sigma[2] > 1.5 * whole.sigma[2]
    assert np.linalg.norm(hidden.corners[2] - corners_of(seen)[2]) / hidden.sides[2] < hidden.error()


def test_too_few_crossings_are_no_fit() -> None:
    seen = pose(0.2, 0.0, 0.7, SIZE)
    look, grid = looked_at(np.full((480, 640, 3), 90, np.uint8), corners_of(seen))
    assert fit_jointly(look, grid, 1) is None


def test_the_error_that_is_given_is_rarely_exceeded() -> None:
    """Boards of all sorts stay below it, and it is not so large that it says nothing."""
    rng = np.random.default_rng(5)
    errors, claims = [], []
    for k in range(12):
        light = rng.uniform(140.0, 240.0) * rng.uniform(0.8, 1.0, 3)
        dark = rng.uniform(0.25, 0.7) * light
        frame = (light, dark, 0.5 * (light + dark), rng.uniform(20.0, 230.0, 3))[k % 4]
        light_, dark_, frame_ = (tuple(int(band) for band in one) for one in (light, dark, frame))
        line = (float(rng.uniform(0.0, 0.1)), 0.05) if k % 3 == 0 else None
        bow = tuple(rng.normal(0.0, 0.02, 2)) if k % 2 else (0.0, 0.0)
        drawing = Drawing(
            light=light_, dark=dark_, frame=frame_, line=line, bow=bow, noise=float(rng.uniform(0.0, 8.0)), border=0.5
        )
        seen = pose(rng.uniform(0.0, 0.8), rng.uniform(-3.0, 3.0), rng.uniform(0.4, 0.75), SIZE)
        found = find_board(draw(seen, (None, START, MIDDLE_GAME)[k % 3], drawing, seed=k))
        errors.append(worst(found, corners_of(seen)))
        claims.append(found.error)
    assert np.mean(np.array(errors) > np.array(claims)) <= 0.1
    assert max(errors) < SURE_ERROR
    assert np.median(claims) < 0.12


def test_a_board_of_few_pixels_is_doubtful() -> None:
    small = pose(0.3, 0.2, 0.14, SIZE)
    found = find_board(draw(small, None, Drawing(noise=1.0)))
    assert found.error > SURE_ERROR
    assert found.doubt is not None
    assert "move the camera nearer" in found.doubt
    assert found.doubt.endswith("move the camera nearer or higher above the board")
    large = find_board(draw(pose(0.3, 0.2, 0.7, SIZE), None, Drawing()))
    assert large.doubt is None
