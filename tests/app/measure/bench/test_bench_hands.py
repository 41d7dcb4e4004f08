"""The bench of hands: one hand, one ply without, one move by hand, in worlds of their own."""

from __future__ import annotations

import pytest

from app.measure.bench.vision import hands

pytestmark = pytest.mark.slow


def quiet(_step: str) -> None:
    """Nobody looks."""


def test_a_hand_stops_the_arm_and_a_ply_without_one_is_not_stopped(monkeypatch):
    monkeypatch.setattr(hands, "ENTRIES", {True: 1})
    rows = hands.hand_rows(True, quiet)
    assert rows["hand_missed"].max == 0.0
    stopped = rows.get("hand_to_rest") or rows["hand_to_give_way"]
    assert stopped.n == 1
    assert stopped.max <= hands.REST_LIMIT
    assert rows["false_stops"].n == 1
    assert rows["false_stops"].max == 0.0
