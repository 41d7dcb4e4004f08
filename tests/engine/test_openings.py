"""Openings by seed."""

from __future__ import annotations

import random
import sys
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
        with pytest.raises(EngineRefused, match=rf"^an opening needs full strength .*{told}\(s\): take opening_engine"):
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


UCI_OK = 'say("id name Plain"); say("uciok")'
"""An engine without any option."""

COUNTING = """
board = chess.Board(after.partition("fen ")[2].partition(" moves")[0] if "fen" in after else chess.STARTING_FEN)
for word in after.partition(" moves ")[2].split():
    board.push_uci(word)
worth = sum(len(board.pieces(kind, board.turn)) - len(board.pieces(kind, not board.turn)) for kind in range(1, 7))
say(f"info depth 1 score cp {100 * worth} nodes 1")
say("bestmove", next(iter(board.legal_moves)))
"""
"""Counts the pieces of the side to move."""


def plain(fake: Callable[..., Any], on_go: str = COUNTING, on_other: str = "") -> Any:
    """An engine that names one move at a time."""
    imports = f"sys.path[:0] = {sys.path!r}\nimport chess"
    remember = 'if line.startswith("position"): after = line'
    return fake(on_uci=UCI_OK, on_go=on_go, at_start=imports, on_other=f"{remember}\n{on_other}")


def test_an_engine_without_multipv_searches_each_move_alone(fake: Callable[..., Any]) -> None:
    made = plain(fake)
    board = chess.Board("k7/8/8/3p1r2/4P3/8/8/K7 w - - 0 1")
    with opening_engine(EngineSettings(path=made.path)) as engine:
        assert not engine.ranks
        found = engine.candidates(board, lines=3, nodes=700)
    assert [candidate.move.uci() for candidate in found[:2]] == ["e4f5", "e4d5"]
    assert [candidate.score for candidate in found] == [
        chess.engine.PovScore(chess.engine.Cp(worth), chess.WHITE) for worth in (0, 0, -100)
    ]
    assert made.starts == 1
    assert made.heard.count("ucinewgame") == 1
    assert {line for line in made.heard if line.startswith("go")} == {f"go nodes {700 // board.legal_moves.count()}"}


def test_an_analysis_by_time_without_multipv_gives_each_move_its_share(fake: Callable[..., Any]) -> None:
    made = plain(fake)
    board = chess.Board("k7/8/8/3p1r2/4P3/8/8/K7 w - - 0 1")
    with opening_engine(EngineSettings(path=made.path)) as engine:
        engine.analyse(board, 2, chess.engine.Limit(time=0.6))
    share = 600 // board.legal_moves.count()
    assert {line for line in made.heard if line.startswith("go")} == {f"go movetime {share}"}


def test_a_mate_and_a_stalemate_are_known_without_the_engine(fake: Callable[..., Any]) -> None:
    board = chess.Board("7k/8/5K2/6Q1/8/8/8/8 w - - 0 1")
    with opening_engine(EngineSettings(path=plain(fake).path)) as engine:
        found = {c.move.uci(): c.score.white() for c in engine.candidates(board, lines=99, nodes=100)}
    assert found["g5g7"] == chess.engine.MateGiven
    assert found["g5g6"] == chess.engine.Cp(0)
    assert max(found.values()) == found["g5g7"]
    assert len(found) == board.legal_moves.count()


def test_openings_of_an_engine_without_multipv_vary_and_come_again(fake: Callable[..., Any]) -> None:
    made = plain(fake)
    with opening_engine(EngineSettings(path=made.path)) as engine:
        lines = [varied_opening(engine, chess.Board(), 4, random.Random(seed)) for seed in (1, 2, 1)]
    assert lines[0] == lines[2] != lines[1]
    assert made.starts == 1


def test_an_engine_that_tells_no_score_plays_its_own_move(fake: Callable[..., Any]) -> None:
    made = plain(fake, on_go=COUNTING.replace("score", "seldepth 1 time"))
    with opening_engine(EngineSettings(path=made.path)) as engine:
        line = varied_opening(engine, chess.Board(), 2, random.Random(1))
    board = chess.Board()
    for move in line:
        assert move == next(iter(board.legal_moves))
        board.push(move)
    assert board.ply() == 2


def test_an_engine_that_heeds_no_nodes_is_stopped_at_each_move(
    fake: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("engine.stockfish.ALONE", 0.01)
    stopped = "\n    ".join(COUNTING.strip().splitlines())
    made = plain(fake, on_go="pass", on_other=f'if line == "stop":\n    {stopped}')
    board = chess.Board("k7/8/8/8/8/8/8/K7 w - - 0 1")
    with opening_engine(EngineSettings(path=made.path)) as engine:
        assert len(engine.candidates(board, lines=6, nodes=100)) == 3
    assert made.starts == 1


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
