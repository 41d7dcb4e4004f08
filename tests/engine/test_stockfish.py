"""The real Stockfish: strength, limits, repeatable games."""

from __future__ import annotations

import random
import re

import chess
import chess.engine
import pytest

from engine.errors import EngineRefused
from engine.levels import WEAKEST
from engine.stockfish import Engine, EngineMove, EngineSettings

PLIES = 24


def line_of_play(engine: Engine) -> list[tuple[chess.Move, chess.engine.PovScore | None, int | None]]:
    """A game of the engine against itself."""
    board = chess.Board()
    line = []
    for _ in range(PLIES):
        chosen = engine.choose(board)
        line.append((chosen.move, chosen.score, chosen.nodes))
        board.push(chosen.move)
    return line


def test_a_move_and_what_stockfish_says_of_it(stockfish: str) -> None:
    board = chess.Board("7k/8/5K2/6Q1/8/8/8/8 w - - 0 1")
    with Engine(EngineSettings(path=stockfish, nodes=5000)) as engine:
        chosen = engine.choose(board)
    assert isinstance(chosen, EngineMove)
    assert chosen.move == chess.Move.from_uci("g5g7")
    assert chosen.score is not None
    assert chosen.score.white() == chess.engine.Mate(1)
    assert chosen.depth is not None
    assert chosen.depth >= 1
    assert chosen.nodes is not None
    assert chosen.nodes > 0
    assert chosen.wall > 0.0


def test_a_node_limit_on_one_thread_repeats_a_game(stockfish: str) -> None:
    settings = EngineSettings(path=stockfish, nodes=3000)
    with Engine(settings) as engine:
        first = line_of_play(engine)
        engine.new_game()
        again = line_of_play(engine)
    with Engine(settings) as engine:
        fresh = line_of_play(engine)
    assert first == again == fresh


def test_without_a_new_game_the_hash_shows(stockfish: str) -> None:
    with Engine(EngineSettings(path=stockfish, nodes=3000)) as engine:
        assert line_of_play(engine) != line_of_play(engine)


def test_move_time_is_kept(stockfish: str) -> None:
    with Engine(EngineSettings(path=stockfish, move_time=0.2)) as engine:
        assert 0.1 < engine.choose(chess.Board()).wall < 30.0


def test_elo_is_refused_outside_stockfishs_own_limits(stockfish: str) -> None:
    with chess.engine.SimpleEngine.popen_uci(stockfish) as plain:
        option, name = plain.options["UCI_Elo"], plain.id["name"]
    assert option.min is not None
    assert option.max is not None
    for elo, sentence in (
        (WEAKEST - 1, f"Elo 399 is outside what {name} can play: choose 400 to {option.max}, or leave it out"),
        (
            option.max + 1,
            f"Elo {option.max + 1} is outside what {name} can play: choose 400 to {option.max}, or leave it out",
        ),
    ):
        with pytest.raises(EngineRefused, match=f"^{re.escape(sentence)}$"):
            Engine(EngineSettings(path=stockfish, elo=elo, nodes=1)).open()
    for elo in (option.min, option.max):
        with Engine(EngineSettings(path=stockfish, elo=elo, nodes=100)) as engine:
            assert engine.choose(chess.Board()).move in chess.Board().legal_moves


@pytest.mark.parametrize("elo", [None, 1500])
def test_moves_are_legal_all_over_the_rules(stockfish: str, elo: int | None) -> None:
    rng = random.Random(7)
    with Engine(EngineSettings(path=stockfish, elo=elo, nodes=50)) as engine:
        for _ in range(6):
            board = chess.Board()
            while not board.is_game_over() and board.ply() < 80:
                move = engine.choose(board).move if board.ply() % 4 == 0 else rng.choice(list(board.legal_moves))
                assert board.is_legal(move)
                board.push(move)


def test_candidates_are_best_first_and_clear_the_hash(stockfish: str) -> None:
    board = chess.Board("r1bqkbnr/pppp1ppp/2n5/4p2Q/2B1P3/8/PPPP1PPP/RNB1K1NR w KQkq - 4 4")
    with Engine(EngineSettings(path=stockfish, nodes=100)) as engine:
        first = engine.candidates(board, lines=3, nodes=5000)
        engine.choose(board, chess.engine.Limit(nodes=50_000))
        again = engine.candidates(board, lines=3, nodes=5000)
        alone = engine.candidates(board, lines=1, nodes=5000)
        assert engine.choose(board).move == chess.Move.from_uci("h5f7")
    assert first == again
    assert len(first) == len({candidate.move for candidate in first}) == 3
    assert first[0].move == alone[0].move == chess.Move.from_uci("h5f7")
    assert first[0].score.relative == chess.engine.Mate(1)
    assert first[0].score.relative > first[1].score.relative
