"""The coach: speaks of blunders alone, and says why."""

from __future__ import annotations

from collections.abc import Iterator

import chess
import pytest

from app.players.advice import Advice, Advisers, TakingBack
from app.practice.coach import Coach


@pytest.fixture(scope="module")
def coach() -> Iterator[Coach]:
    with Coach(None, nodes=5000) as coach:
        yield coach


def test_a_blunder_may_be_taken_back_and_the_line_says_why(coach: Coach) -> None:
    board = chess.Board()
    for san in ("e4", "e5", "Qh5", "Nc6", "Bc4"):
        board.push_san(san)
    said = coach.judge(board, board.parse_san("Nf6"))
    assert said is not None
    assert said.taking_back is TakingBack.OFFERED
    assert said.sentence.startswith("Nf6 allows mate in 1: 4. Qxf7#; ")


def test_good_moves_and_mates_are_left_alone(coach: Coach) -> None:
    board = chess.Board()
    assert coach.judge(board, board.parse_san("e4")) is None
    mate = chess.Board("6k1/5ppp/8/8/8/8/8/R5K1 w - - 0 1")
    assert coach.judge(mate, mate.parse_san("Ra8#")) is None
    only = chess.Board("7k/8/8/8/8/8/1q6/K7 w - - 0 1")
    assert coach.judge(only, only.parse_san("Kxb2")) is None


def test_of_several_the_first_one_speaks() -> None:
    class Says:
        def __init__(self, advice: Advice | None) -> None:
            self.advice = advice

        def judge(self, board: chess.Board, move: chess.Move) -> Advice | None:
            return self.advice

    board = chess.Board()
    move = board.parse_san("e4")
    one, two = Advice("one"), Advice("two")
    assert Advisers([Says(None), Says(one), Says(two)]).judge(board, move) is one
    assert Advisers([Says(None)]).judge(board, move) is None
