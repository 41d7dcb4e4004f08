"""Openings by seed."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from typing import Any

import chess
import chess.engine
import pytest

from engine.errors import EngineFailed, EngineRefused
from engine.openings import WINDOW, opening_engine, sound_moves, varied_opening
from engine.stockfish import Candidate, Engine, EngineSettings

PLIES = 8
SEEDS = range(1, 6)


@pytest.fixture(scope="module")
def engine(stockfish: str) -> Iterator[Engine]:
    with opening_engine(EngineSettings(path=stockfish, elo=1500, threads=2, hash_mb=128)) as engine:
        yield engine


@pytest.fixture(scope="module")
def lines(engine: Engine) -> dict[int, tuple[chess.Move, ...]]:
    return {seed: varied_opening(engine, chess.Board(), PLIES, random.Random(seed)) for seed in SEEDS}


def test_seeds_one_to_five_give_five_legal_lines(lines: dict[int, tuple[chess.Move, ...]]) -> None:
    assert len(set(lines.values())) == len(SEEDS)
    for line in lines.values():
        board = chess.Board()
        for move in line:
            assert board.is_legal(move)
            board.push(move)
        assert board.ply() == PLIES


def test_lines_stay_sound(engine: Engine, lines: dict[int, tuple[chess.Move, ...]]) -> None:
    for line in lines.values():
        board = chess.Board()
        for move in line:
            board.push(move)
        (best,) = engine.candidates(board, lines=1, nodes=100_000)
        assert abs(best.score.white().score(mate_score=100_000)) < 150


def test_a_seed_gives_its_line_again_from_a_used_and_from_a_fresh_engine(
    engine: Engine, stockfish: str, lines: dict[int, tuple[chess.Move, ...]]
) -> None:
    engine.choose(chess.Board(), chess.engine.Limit(nodes=30_000))
    assert varied_opening(engine, chess.Board(), PLIES, random.Random(3)) == lines[3]
    with opening_engine(EngineSettings(path=stockfish)) as fresh:
        assert varied_opening(fresh, chess.Board(), PLIES, random.Random(2)) == lines[2]


def test_an_opening_starts_where_the_board_stands_and_leaves_it(engine: Engine) -> None:
    board = chess.Board("r3k2r/8/8/8/8/8/8/R3K2R w KQkq - 0 1")
    before = board.copy()
    line = varied_opening(engine, board, 3, random.Random(1))
    assert board == before
    assert len(line) == 3
    assert board.is_legal(line[0])


def test_an_opening_ends_with_the_game(engine: Engine) -> None:
    mate_in_one = chess.Board("7k/8/5K2/6Q1/8/8/8/8 w - - 0 1")
    line = varied_opening(engine, mate_in_one, 20, random.Random(5))
    assert 1 <= len(line) <= 20
    over = chess.Board("7k/6Q1/5K2/8/8/8/8/8 b - - 0 1")
    assert varied_opening(engine, over, PLIES, random.Random(1)) == ()


def test_a_weakened_or_threaded_engine_is_refused() -> None:
    for settings, told in (
        (EngineSettings(elo=1500), "Elo 1500 and 1 thread"),
        (EngineSettings(threads=2), "2 thread"),
    ):
        with pytest.raises(EngineRefused, match=rf"^an opening wants full strength .*{told}\(s\): take opening_engine"):
            varied_opening(Engine(settings), chess.Board(), PLIES, random.Random(1))


def test_the_opening_engine_keeps_binary_and_deadlines_only() -> None:
    player = EngineSettings(path="x", elo=1500, threads=4, hash_mb=512, nodes=9, deadline=3.0, start_deadline=4.0)
    assert opening_engine(player).settings == EngineSettings(path="x", hash_mb=16, deadline=3.0, start_deadline=4.0)


def test_an_engine_that_hangs_in_the_opening_meets_its_deadline(fake: Callable[..., Any]) -> None:
    settings = EngineSettings(path=fake(on_go="time.sleep(60)").path, deadline=0.4)
    with (
        opening_engine(settings) as engine,
        pytest.raises(
            EngineFailed, match=r"2 times in a row in analysing a position \(it gave no answer within 0.4 s\)"
        ),
    ):
        varied_opening(engine, chess.Board(), PLIES, random.Random(1))


def test_sound_moves_lie_within_the_window_of_the_best() -> None:
    moves = [chess.Move.from_uci(word) for word in ("e2e4", "d2d4", "c2c4", "g1f3")]
    scores = [chess.engine.Cp(value) for value in (40, 40 - WINDOW, 40 - WINDOW - 1, -500)]
    candidates = tuple(
        Candidate(move, chess.engine.PovScore(score, chess.BLACK)) for move, score in zip(moves, scores, strict=True)
    )
    assert sound_moves(candidates) == tuple(moves[:2])


def test_a_forced_mate_is_not_given_up_for_material() -> None:
    mate, queen = (chess.Move.from_uci(word) for word in ("e2e4", "d2d4"))
    scores = {mate: chess.engine.Mate(9), queen: chess.engine.Cp(3000)}
    candidates = tuple(Candidate(m, chess.engine.PovScore(s, chess.WHITE)) for m, s in scores.items())
    assert sound_moves(candidates) == (mate,)
