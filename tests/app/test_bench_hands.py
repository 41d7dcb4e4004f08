"""The bench of hands: one hand, one ply without, one move by hand, in worlds of their own."""

from __future__ import annotations

import pytest

from app.bench import vision_hand, vision_turn

pytestmark = pytest.mark.slow


def quiet(_step: str) -> None:
    """Nobody looks."""


def test_a_hand_stops_the_arm_and_a_ply_without_one_is_not_stopped():
    rows = vision_hand.measure(1, 1, quiet)
    assert rows["hand_missed"].max == 0.0
    stopped = rows.get("hand_to_rest") or rows["hand_to_give_way"]
    assert stopped.n == 1
    assert stopped.max <= vision_hand.REST_LIMIT
    assert rows["false_stops"].n == 1
    assert rows["false_stops"].max == 0.0


def test_a_move_by_hand_is_known_soon():
    rows = vision_turn.measure(1, quiet)
    assert rows["move wrong"].max == 0.0
    assert rows["move asked"].max == 0.0
    assert 0.2 < rows["hand gone to move known"].max <= vision_turn.KNOWN_LIMIT
