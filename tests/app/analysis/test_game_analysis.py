"""The analysis of a game from scores: who lost what, and when."""

from __future__ import annotations

import chess
import pytest

from app.analysis.judgement import Judgement
from tests.app.analysis.analysed import analysed


def test_losses_belong_to_the_side_that_moved() -> None:
    game = analysed("e4 e5 Nf3 Nc6", [0, 0, 400, 400, 0])
    assert [move.judgement for move in game.moves] == [None, Judgement.BLUNDER, None, None]
    assert game.moves[1].note.startswith("Blunder. e5 lets the winning chances fall from 50 to 19 %: 2. ")
    assert (game.sides["white"].blunders, game.sides["black"].blunders) == (0, 1)
    assert game.sides["black"].centipawns_lost == pytest.approx(200.0)
    assert [move.score for move in game.moves] == ["+0.00", "+4.00", "+4.00", "+0.00"]


def test_a_move_that_the_engine_would_play_is_never_judged() -> None:
    first = next(iter(chess.Board().legal_moves))
    game = analysed(chess.Board().san(first), [0, -900])
    assert game.moves[0].judgement is None


def test_black_may_begin() -> None:
    start = "4k3/8/8/8/8/8/4P3/4K3 b - - 0 7"
    game = analysed("Kd7 e4", [100, 100, 600], start=start)
    assert [(move.number, move.side) for move in game.moves] == [(7, "black"), (8, "white")]
    assert game.sides["white"].accuracy == pytest.approx(100.0)


def test_the_end_of_a_game_has_no_score() -> None:
    game = analysed("f3 e5 g4 Qh4#", [0, -50, -50, -900, -900])
    assert [move.score is None for move in game.moves] == [False, False, False, True]
