"""Whether the board has moved: pieces, hands, light and shadows are no reason to say so, a nudge is."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.vision.drawing import START, Drawing, corners_of, draw, pose
from vision.board.moved import Anchor
from vision.board.view import BoardNotFound

LATER = "r1bqkbnr/pppp1ppp/2n5/4p3/2B1P3/5Q2/PPPP1PPP/RNB1K1NR"
SIZE = (640, 480)
SEEN = pose(0.5, 0.15, 0.62, SIZE)
SIDE = math.sqrt(cv2.contourArea(corners_of(SEEN).astype(np.float32))) / 8.0


def moved(along: float, across: float, turn: float = 0.0) -> NDArray[np.float64]:
    """The board pushed along files and ranks [squares] and turned about its middle [rad]."""
    c, s = math.cos(turn), math.sin(turn)
    about = np.array([[c, -s, 4.0 - 4.0 * c + 4.0 * s], [s, c, 4.0 - 4.0 * s - 4.0 * c], [0.0, 0.0, 1.0]])
    return SEEN @ np.array([[1.0, 0.0, along], [0.0, 1.0, across], [0.0, 0.0, 1.0]]) @ about


@pytest.fixture(scope="module")
def anchor() -> Anchor:
    return Anchor(draw(SEEN, START, Drawing()), corners_of(SEEN))


def same_place(kind: str) -> NDArray[np.uint8]:
    colour = draw(SEEN, LATER, Drawing(), seed=7).astype(float)
    if kind == "dark":
        colour *= 0.45
    elif kind == "bright":
        colour *= 1.7
    elif kind == "shadow":
        colour[:, 250:430] *= 0.5
    elif kind == "hand":
        cv2.ellipse(colour, (330, 330), (70, 150), 20.0, 0.0, 360.0, (205.0, 160.0, 130.0), -1)
    return np.clip(colour, 0, 255).astype(np.uint8)


@pytest.mark.parametrize("kind", ["pieces", "dark", "bright", "shadow", "hand"])
def test_what_does_not_move_the_board(anchor: Anchor, kind: str) -> None:
    check = anchor.check(same_place(kind))
    assert check.moved is False
    assert check.shift.max() < 0.05
    np.testing.assert_array_equal(check.corners, anchor.corners)


@pytest.mark.parametrize("along", [0.12, -0.5, 1.0])
@pytest.mark.parametrize("across", [0.0, 1.0])
def test_a_board_that_moved_is_found_again(anchor: Anchor, along: float, across: float) -> None:
    seen = moved(along, across)
    colour = draw(seen, LATER, Drawing(), seed=3)
    assert anchor.check(colour).moved is not False
    check = anchor.follow(colour)
    assert check.moved is True
    assert np.linalg.norm(check.corners - corners_of(seen), axis=1).max() < 0.08 * SIDE
    assert check.shift.max() == pytest.approx(math.hypot(along, across), rel=0.35)


def test_a_turn_is_seen_too(anchor: Anchor) -> None:
    seen = moved(0.0, 0.0, math.radians(1.5))
    check = anchor.follow(draw(seen, START, Drawing(), seed=3))
    assert check.moved is True
    assert np.linalg.norm(check.corners - corners_of(seen), axis=1).max() < 0.08 * SIDE


def test_a_covered_board_tells_nothing(anchor: Anchor) -> None:
    check = anchor.follow(np.full((480, 640, 3), 128, np.uint8))
    assert check.moved is None
    assert np.isnan(check.shift).all()
    assert check.seen == 0.0


def test_what_an_anchor_refuses(anchor: Anchor) -> None:
    with pytest.raises(BoardNotFound, match="find the board again"):
        Anchor(np.full((480, 640, 3), 128, np.uint8), corners_of(SEEN))
    with pytest.raises(ValueError, match=r"a picture of shape \(100, 100, 3\) cannot be compared"):
        anchor.check(np.zeros((100, 100, 3), np.uint8))
