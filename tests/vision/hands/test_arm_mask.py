"""The arm's mask: what lies in a capsule lies in its picture, whatever the view."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from hardware.interfaces import Intrinsics
from hardware.table import TableSettings
from tests.vision.views import looking_at
from vision.board.view import BoardView
from vision.hands.arm_mask import NEAREST, Capsules, draw_mask

PINHOLE = Intrinsics(320, 240, 300.0, 310.0, 159.5, 119.5)
places = st.floats(-0.4, 0.4)
points = st.tuples(places, places, st.floats(0.0, 0.5))


def view(x: float, y: float, z: float) -> BoardView:
    return BoardView(PINHOLE, looking_at((x, y, z), (0.01, 0.02, 0.0)), TableSettings())


cameras = st.builds(view, st.floats(-0.5, 0.5), st.floats(0.2, 0.6), st.floats(0.3, 0.7))


def pixels_of(seen: BoardView, points: np.ndarray) -> np.ndarray:
    """Whole pixels (n, 2) as (row, column) of points that have a picture inside the frame."""
    u, v = seen.project(points).T
    inside = (u > -0.5) & (u < PINHOLE.width - 0.5) & (v > -0.5) & (v < PINHOLE.height - 0.5)
    return np.rint(np.column_stack([v, u])[inside]).astype(int)


@given(cameras, points, points, st.floats(0.002, 0.05))
@example(
    view(0.5, 0.5625, 0.30078125), (0.0, 0.0, 0.28125), (0.0, 0.25, 0.3125), 0.00390625
)  # along the picture's edge
def test_all_of_a_capsule_lies_in_its_mask(
    seen: BoardView, start: tuple[float, float, float], end: tuple[float, float, float], radius: float
) -> None:
    axis = np.linspace(start, end, 60)
    directions = np.random.default_rng(1).normal(size=(60, 12, 3))
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    skin = (axis[:, None, :] + radius * directions).reshape(-1, 3)
    capsule = Capsules([[start, end]], [radius])
    far_axis = axis[seen.depth(axis) > NEAREST + radius]
    kept = np.repeat(seen.depth(axis) > NEAREST + radius, 12)
    for points, grow in ((far_axis, 0), (skin[kept], 1)):  # the middle of a pixel may lie just outside of its skin
        mask, rows = draw_mask(seen, capsule, grow=grow), pixels_of(seen, points)
        assert mask[rows[:, 0], rows[:, 1]].all()


@given(cameras, points, points, st.floats(0.005, 0.04), st.floats(0.0, 0.02), st.integers(0, 4))
@example(view(0.17068011683863438, 0.28125, 0.46484375), (0.0, 0.0, 0.0), (0.0, 0.25, 0.0), 0.03125, 1e-05, 0)
def test_margins_only_add(
    seen: BoardView,
    start: tuple[float, float, float],
    end: tuple[float, float, float],
    radius: float,
    margin: float,
    grow: int,
) -> None:
    capsules = Capsules([[start, end]], [radius])
    assert not (draw_mask(seen, capsules) & ~draw_mask(seen, capsules, grow=grow)).any()
    nearest, farthest = sorted(seen.depth([start, end]))
    if nearest > NEAREST + radius + margin:
        # corners lie on parts of a pixel: a margin that is no pixel wide may move an edge by one
        edge = 0 if margin * PINHOLE.fx > farthest else 1
        assert not (draw_mask(seen, capsules) & ~draw_mask(seen, capsules, margin, edge)).any()


def test_a_ball_below_the_camera_is_a_disc_of_the_size_that_optics_say() -> None:
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[2, 3] = 1.0
    seen = BoardView(Intrinsics(640, 480, 1000.0, 1000.0, 319.5, 239.5), pose, TableSettings())
    mask = draw_mask(seen, Capsules([[[0, 0, 0.5], [0, 0, 0.5]]], [0.1]))
    radius = 1000.0 * math.tan(math.asin(0.1 / 0.5))
    assert np.count_nonzero(mask) == pytest.approx(math.pi * radius**2, rel=0.03)


def test_what_lies_behind_the_camera_is_not_drawn() -> None:
    seen = view(0.0, 0.4, 0.4)
    behind = Capsules([[[0.0, 0.9, 0.6], [0.1, 1.2, 0.6]]], [0.02])
    assert len(behind) == 1
    assert not draw_mask(seen, behind).any()
    assert not draw_mask(seen, Capsules(np.zeros((0, 2, 3)), np.zeros(0))).any()


def test_nonsense_is_refused() -> None:
    with pytest.raises(ValueError, match=re.escape("ends of shape (2, 3) and radii of shape (1,): give (n, 2, 3)")):
        Capsules(np.zeros((2, 3)), [0.1])
    with pytest.raises(ValueError, match="not finite, or a negative radius: give metres"):
        Capsules(np.zeros((1, 2, 3)), [-0.1])
