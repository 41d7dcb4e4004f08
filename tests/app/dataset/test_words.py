"""A move is a task in words: what is moved, from where, to where, and what it takes."""

from __future__ import annotations

import chess
import pytest

from app.dataset.words import task_of


@pytest.mark.parametrize(
    ("fen", "uci", "words"),
    [
        (chess.STARTING_FEN, "g1f3", "move the white knight from g1 to f3"),
        (
            "rnbqkbnr/ppp1pppp/8/3p4/4P3/8/PPPP1PPP/RNBQKBNR w KQkq - 0 2", "e4d5",
            "capture the black pawn on d5 with the white pawn from e4",
        ),
        (
            "4k3/8/8/3pP3/8/8/8/4K3 w - d6 0 1", "e5d6",
            "capture the black pawn on d5 with the white pawn from e5 to d6 en passant",
        ),
        ("r3k2r/8/8/8/8/8/8/R3K2R w KQkq - 0 1", "e1g1",
         "castle kingside with white: king from e1 to g1, rook from h1 to f1"),
        ("r3k2r/8/8/8/8/8/8/R3K2R b KQkq - 0 1", "e8c8",
         "castle queenside with black: king from e8 to c8, rook from a8 to d8"),
        ("8/2P1k3/8/8/8/8/8/4K3 w - - 0 1", "c7c8q", "promote the white pawn from c7 to a queen on c8"),
        (
            "8/4k3/8/8/8/8/6p1/4K2R b - - 0 1", "g2h1n",
            "capture the white rook on h1 with the black pawn from g2 and promote it to a knight",
        ),
    ],
)  # fmt: skip
def test_task_of_each_kind_of_move(fen: str, uci: str, words: str) -> None:
    assert task_of(chess.Board(fen), chess.Move.from_uci(uci)) == words


@pytest.mark.parametrize(
    ("fen", "uci", "words"),
    [
        ("4k3/8/8/8/8/8/8/1R3KR1 w GB - 0 1", "f1g1",
         "castle kingside with white: king from f1 to g1, rook from g1 to f1"),
        ("4k3/8/8/8/8/8/8/1RK3R1 w GB - 0 1", "c1b1", "castle queenside with white: rook from b1 to d1"),
    ],
)  # fmt: skip
def test_castling_of_chess960_names_what_moves(fen: str, uci: str, words: str) -> None:
    assert task_of(chess.Board(fen, chess960=True), chess.Move.from_uci(uci)) == words
