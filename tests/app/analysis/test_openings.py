"""Openings by name."""

from __future__ import annotations

import chess

from app.analysis.openings import opening_of_game, openings


def test_every_opening_is_of_a_position_and_has_a_code() -> None:
    assert len(openings()) > 3000
    for position, opening in openings().items():
        board = chess.Board(f"{position} 0 1")
        assert board.epd() == position
        assert board.is_valid()
        assert opening.eco[0] in "ABCDE"
        assert opening.eco[1:].isdecimal()
        assert opening.name == opening.name.strip() != ""


def test_a_game_has_the_last_name_that_one_of_its_positions_had() -> None:
    board = chess.Board()
    assert opening_of_game(board) is None
    for san in ("e4", "c5", "a3", "h5"):
        board.push_san(san)
    found = opening_of_game(board)
    assert found is not None
    assert found[0].name.startswith("Sicilian")
    assert found[1] == 3
    assert len(board.move_stack) == 4
