"""Where a1 is, told by pieces, or not told."""

from __future__ import annotations

import chess
import numpy as np
import pytest

from tests.vision.drawing import START, Drawing, corners_of, draw, pose
from vision.board.orientation import orient

SIZE = (640, 480)
SEEN = pose(0.4, 0.3, 0.65, SIZE)


@pytest.mark.parametrize("turn", [0, 1, 2, 3])
@pytest.mark.parametrize(
    "drawing",
    [Drawing(), Drawing(white=(250, 210, 60), black=(60, 50, 160)), Drawing(white=(196, 160, 110), black=(90, 50, 30))],
    ids=["wood", "yellow and blue", "two woods"],
)
def test_the_start_position(turn: int, drawing: Drawing) -> None:
    truth = corners_of(SEEN)
    result = orient(draw(SEEN, START, drawing), np.roll(truth, turn, axis=0))
    assert result.sure
    np.testing.assert_allclose(result.corners, truth)


def test_light_that_falls_off_turns_no_board() -> None:
    colour = draw(SEEN, START, Drawing()).astype(float)
    ramp = np.linspace(0.35, 1.0, SIZE[1])[::-1, None, None]  # the white side is in the dark
    result = orient((colour * ramp).astype(np.uint8), corners_of(SEEN))
    assert result.sure
    np.testing.assert_allclose(result.corners, corners_of(SEEN))


@pytest.mark.parametrize("placement", [None, "4k3/8/8/2p5/8/8/4P3/4K3"])
def test_other_positions_tell_nothing_of_themselves(placement: str | None) -> None:
    given = np.roll(corners_of(SEEN), 2, axis=0)
    result = orient(draw(SEEN, placement, Drawing()), given)
    assert not result.sure
    np.testing.assert_array_equal(result.corners, given)


def test_a_known_position_tells() -> None:
    position = "r3k2r/ppp2ppp/2n5/3p4/3P4/2P5/PP3PPP/R3K2R"
    result = orient(draw(SEEN, position, Drawing()), np.roll(corners_of(SEEN), 2, axis=0), chess.BaseBoard(position))
    assert result.sure
    np.testing.assert_allclose(result.corners, corners_of(SEEN))
