"""Why a move is bad, in one sentence."""

from __future__ import annotations

import chess
import pytest
from chess.engine import Cp, Mate, PovScore, Score

from app.analysis.reasons import line_text, reason
from engine.answers import Candidate


def line(board: chess.Board, text: str, score: Score) -> Candidate:
    """A line in SAN, with a score from the side to move."""
    position, moves = board.copy(), []
    for san in text.split():
        moves.append(position.push_san(san))
    return Candidate(moves[0], PovScore(score, board.turn), tuple(moves))


@pytest.mark.parametrize(
    ("fen", "move", "best", "reply", "said"),
    [
        (  # the queen is taken, and taken back by nobody
            "r1b1kbnr/ppp2ppp/2n5/3qp3/8/2N5/PPPP1PPP/R1BQKBNR b KQkq - 0 1", "Bf5",
            ("Qd8", Cp(0)), ("Nxd5 Bxc2 Qxc2 a6", Cp(900)),
            "Bf5 loses a queen and a bishop for a pawn: 2. Nxd5 Bxc2 3. Qxc2 a6; Qd8 was better",
        ),
        (
            chess.STARTING_FEN, "f3", ("e4", Cp(30)), ("e5 Nc3 Nf6", Cp(80)),
            "f3 lets the winning chances fall from 53 to 43 %: 1… e5 2. Nc3 Nf6; e4 was better",
        ),
        (
            "rnbqkbnr/pppp1ppp/8/4p3/8/5P2/PPPPP1PP/RNBQKBNR w KQkq - 0 2", "g4", ("e4", Cp(-50)), ("Qh4#", Mate(1)),
            "g4 allows mate in 1: 2… Qh4#; e4 was better",
        ),
        (
            "6k1/5ppp/8/8/8/8/5PPP/R5K1 w - - 0 1", "h3", ("Ra8#", Mate(1)), ("h6", Cp(-500)),
            "h3 misses mate in 1: 1. Ra8#",
        ),
    ],
)  # fmt: skip
def test_the_line_says_why(fen: str, move: str, best: tuple[str, Score], reply: tuple[str, Score], said: str) -> None:
    board = chess.Board(fen)
    made = board.parse_san(move)
    after = board.copy()
    after.push(made)
    assert reason(board, made, line(board, *best), line(after, *reply)) == said


def test_an_exchange_that_the_line_does_not_finish_counts_for_nothing() -> None:
    board = chess.Board("rnbqkbnr/ppp1pppp/8/3p4/4P3/8/PPPP1PPP/RNBQKBNR w KQkq - 0 2")
    made = board.parse_san("Nc3")
    after = board.copy()
    after.push(made)
    assert "loses" not in reason(board, made, line(board, "exd5", Cp(30)), line(after, "dxe4", Cp(30)))


def test_a_stalemate_given_away_is_a_draw() -> None:
    board = chess.Board("7k/8/6K1/8/8/8/8/5Q2 w - - 0 1")
    assert reason(board, board.parse_san("Qf7"), line(board, "Qf8#", Mate(1)), None).startswith("Qf7 misses mate in 1")
    assert reason(board, board.parse_san("Qf7"), None, None) == "Qf7 ends the game in a draw"


def test_a_line_is_written_as_players_write_it() -> None:
    board = chess.Board()
    assert line_text(board, line(board, "e4 e5 Nf3", Cp(0)).pv) == "1. e4 e5 2. Nf3"
    board.push_san("e4")
    assert line_text(board, line(board, "e5 Nf3 Nc6", Cp(0)).pv, most=2) == "1… e5 2. Nf3"
