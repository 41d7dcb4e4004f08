"""Winning chances, accuracy and judgements: laws, and the values that Lichess publishes."""

from __future__ import annotations

import math

import chess
import pytest
from chess.engine import Cp, Mate, MateGiven, Score
from hypothesis import given
from hypothesis import strategies as st

from app.analysis.judgement import Judgement, game_accuracy, judgement_of, move_accuracy, win_percent

PERCENT = st.floats(0.0, 100.0)


@given(st.integers(-20_000, 20_000))
def test_winning_chances_of_both_sides_are_everything(centipawns: int) -> None:
    assert win_percent(Cp(centipawns)) + win_percent(Cp(-centipawns)) == pytest.approx(100.0)


@given(st.integers(-5000, 5000), st.integers(-5000, 5000))
def test_a_better_score_never_has_worse_chances(one: int, two: int) -> None:
    assert (win_percent(Cp(one)) - win_percent(Cp(two))) * (one - two) >= 0.0


@pytest.mark.parametrize(
    ("score", "percent"),
    [(Cp(0), 50.0), (Cp(100), 59.1), (Cp(300), 75.1), (Cp(1000), 97.5), (Mate(1), 97.5), (Mate(-9), 2.5),
     (MateGiven, 97.5), (Mate(0), 2.5)],
)  # fmt: skip
def test_winning_chances_are_those_of_lichess(score: Score, percent: float) -> None:
    assert win_percent(score) == pytest.approx(percent, abs=0.05)


@given(PERCENT, PERCENT)
def test_accuracy_is_full_where_nothing_is_lost(before: float, after: float) -> None:
    accuracy = move_accuracy(before, after)
    assert 0.0 <= accuracy <= 100.0
    assert (accuracy == 100.0) or after < before


def test_accuracy_falls_as_lichess_says() -> None:
    for lost, accuracy in ((0.0, 100.0), (5.0, 80.8), (10.0, 64.6), (20.0, 41.0), (40.0, 15.9), (100.0, 0.0)):
        assert move_accuracy(100.0, 100.0 - lost) == pytest.approx(accuracy, abs=0.1)


def test_accuracy_of_a_game_without_a_mistake_is_full() -> None:
    assert game_accuracy([52.0] * 40, chess.WHITE) == (pytest.approx(100.0), pytest.approx(100.0))


def test_accuracy_belongs_to_the_side_that_lost_its_chances() -> None:
    wins = [50.0, 50.0, 50.0, 20.0, 20.0, 20.0]  # the third ply gives it away
    white, black = game_accuracy(wins, chess.WHITE)
    assert white is not None and black is not None  # noqa: PT018
    assert white < 60.0 < black == pytest.approx(100.0)
    assert game_accuracy(wins, chess.BLACK).white == pytest.approx(100.0)  # and gains for the other side


def test_a_side_that_has_not_moved_has_no_accuracy() -> None:
    assert game_accuracy([50.0], chess.WHITE) == (None, None)
    assert game_accuracy([50.0, 40.0], chess.WHITE).black is None


@pytest.mark.parametrize(
    ("before", "after", "judgement"),
    [
        (Cp(30), Cp(20), None),
        (Cp(0), Cp(-55), Judgement.INACCURACY),
        (Cp(0), Cp(-112), Judgement.MISTAKE),
        (Cp(0), Cp(-170), Judgement.BLUNDER),
        (Cp(2000), Cp(1500), None),
        (Cp(0), Mate(-5), Judgement.BLUNDER),
        (Cp(-750), Mate(-5), Judgement.MISTAKE),
        (Cp(-1200), Mate(-5), Judgement.INACCURACY),
        (Mate(3), Cp(50), Judgement.BLUNDER),
        (Mate(3), Cp(800), Judgement.MISTAKE),
        (Mate(3), Cp(1500), Judgement.INACCURACY),
        (Mate(3), Mate(-2), Judgement.BLUNDER),
        (Mate(3), Mate(7), None),
        (Mate(1), MateGiven, None),
        (Mate(-7), Mate(-2), None),
        (Cp(-300), Cp(500), None),
    ],
)
def test_judgements_are_those_of_lichess(before: Score, after: Score, judgement: Judgement | None) -> None:
    assert judgement_of(before, after) is judgement


def test_every_number_is_finite_for_every_score() -> None:
    for score in (Cp(10**6), Cp(-(10**6)), Mate(0), MateGiven, Mate(-1)):
        assert math.isfinite(win_percent(score))
        for other in (Cp(10**6), Cp(-(10**6)), Mate(0), MateGiven):
            judgement_of(score, other)
