"""Strength below the engine's own lowest Elo."""

from __future__ import annotations

import itertools
import random
from collections import Counter
from collections.abc import Callable
from typing import Any

import chess
import pytest
from chess.engine import Cp, Mate, PovScore
from hypothesis import given
from hypothesis import strategies as st

from engine.answers import Candidate
from engine.levels import STRONGEST, TEMPERATURES, WEAKEST, draw_of, drawn_move, temperature_of
from engine.stockfish import Engine, EngineSettings

E4, D4, A3 = (chess.Move.from_uci(uci) for uci in ("e2e4", "d2d4", "a2a3"))


def candidates(*scores: int) -> tuple[Candidate, ...]:
    return tuple(
        Candidate(move, PovScore(Cp(score), chess.WHITE)) for move, score in zip((E4, D4, A3), scores, strict=False)
    )


def drawn(found: tuple[Candidate, ...], temperature: float, times: int = 3000) -> Counter[chess.Move]:
    draw = random.Random(1)
    return Counter(drawn_move(found, temperature, draw).move for _ in range(times))


@given(st.integers(WEAKEST, STRONGEST - 1))
def test_a_higher_level_is_colder(elo: int) -> None:
    assert temperature_of(elo) > temperature_of(elo + 1) > 0.0


def test_measured_temperatures_are_met() -> None:
    for elo, temperature in TEMPERATURES:
        assert temperature_of(elo) == pytest.approx(temperature)
    for elo in (WEAKEST - 1, STRONGEST + 1):
        with pytest.raises(ValueError, match=f"Elo {elo} is outside {WEAKEST} to {STRONGEST}"):
            temperature_of(elo)


def test_a_move_that_is_worth_a_temperature_less_is_drawn_e_times_more_rarely() -> None:
    counted = drawn(candidates(50, -50), 100.0)
    assert counted[E4] / counted[D4] == pytest.approx(2.718, rel=0.15)


def test_cold_takes_the_best_and_hot_takes_any() -> None:
    assert drawn(candidates(30, 0, -200), 0.5) == {E4: 3000}
    assert all(900 < count < 1100 for count in drawn(candidates(30, 0, -200), 1e9).values())


def test_a_mate_is_worth_no_more_than_what_wins_anyhow() -> None:
    found = (Candidate(E4, PovScore(Mate(1), chess.WHITE)), Candidate(D4, PovScore(Cp(1500), chess.WHITE)))
    counted = drawn(found, 50.0)
    assert counted[E4] == pytest.approx(1500, abs=120)


def test_the_draw_depends_on_seed_and_position_alone() -> None:
    board = chess.Board()
    assert draw_of(1, board).random() == draw_of(1, board.copy()).random() != draw_of(2, board).random()
    board.push(E4)
    assert draw_of(1, board).random() != draw_of(1, chess.Board()).random()


RANKS = """
for number, move in enumerate(("e2e4", "d2d4", "a2a3"), start=1):
    say("info depth 1 multipv", number, "score cp", 40 - 40 * number, "nodes 9 pv", move)
say("bestmove e2e4")
"""


def test_below_its_own_levels_the_engine_is_asked_for_all_moves(fake: Callable[..., Any]) -> None:
    made = fake(on_go=RANKS)
    moves = set()
    for seed in range(12):
        with Engine(EngineSettings(path=made.path, nodes=5, elo=400, seed=seed, ponder=True)) as engine:
            answer = engine.choose(chess.Board())
            assert answer == engine.choose(chess.Board()) or answer.move == engine.choose(chess.Board()).move
            assert answer.score is not None
            assert not engine.ponder(chess.Board())
            moves.add(answer.move)
    assert moves == {E4, D4, A3}
    assert not [line for line in made.heard if "UCI_Elo" in line]
    assert "go nodes 1000" in made.heard


def test_an_engine_that_names_few_moves_is_asked_for_each_of_them(fake: Callable[..., Any]) -> None:
    made = fake(
        on_uci='say("option name MultiPV type spin default 1 min 1 max 2"); say("uciok")',
        on_go='say("info depth 1 score cp 0 nodes 9"); say("bestmove a8a7")',
    )  # fmt: skip
    board, moves = chess.Board("k7/8/8/8/8/8/8/K7 w - - 0 1"), set[str]()
    for seed in range(8):
        with Engine(EngineSettings(path=made.path, nodes=5, elo=400, seed=seed)) as engine:
            moves.add(engine.choose(board).move.uci())
    assert moves == {"a1a2", "a1b1", "a1b2"}  # not two of them alone
    assert [line for line in made.heard if line.startswith("go")] == 24 * ["go nodes 333"]


def test_a_level_of_its_own_is_left_to_the_engine(fake: Callable[..., Any]) -> None:
    made = fake()
    with Engine(EngineSettings(path=made.path, nodes=5, elo=1400)) as engine:
        engine.choose(chess.Board())
    assert "setoption name UCI_Elo value 1400" in made.heard


def test_stockfish_plays_legally_at_its_weakest_and_a_game_repeats(stockfish: str) -> None:
    lines = []
    for _ in range(2):
        board = chess.Board()
        with Engine(EngineSettings(path=stockfish, nodes=1, elo=WEAKEST, seed=5)) as engine:
            for _ in range(12):
                board.push(engine.choose(board).move)
        lines.append(board.move_stack)
    assert lines[0] == lines[1]


def test_levels_follow_each_other() -> None:
    for (low, warm), (high, cool) in itertools.pairwise(TEMPERATURES):
        assert low < high
        assert warm > cool
