"""Games at odds."""

from __future__ import annotations

import chess
import pytest

from app import UserError
from app.practice.odds import at_odds
from app.settings.defaults import Odds


@pytest.mark.parametrize("giver", chess.COLORS)
@pytest.mark.parametrize("odds", Odds)
def test_one_piece_of_the_giver_is_missing(odds: Odds, giver: chess.Color) -> None:
    start = chess.Board()
    board = at_odds(start, odds, giver)
    assert board.is_valid()
    assert start.fen() == chess.STARTING_FEN
    (square,) = set(start.piece_map()) - set(board.piece_map())
    piece = start.piece_at(square)
    assert piece == chess.Piece(chess.PIECE_NAMES.index(odds), giver)
    assert board.has_queenside_castling_rights(giver) is (odds is not Odds.ROOK)
    assert board.has_kingside_castling_rights(giver)


def test_no_odds_change_nothing_and_another_start_is_refused() -> None:
    board = chess.Board("4k3/8/8/8/8/8/8/R3K3 w Q - 0 1")
    assert at_odds(board, None, chess.WHITE) == board
    with pytest.raises(UserError, match=r"^odds are given from the usual start"):
        at_odds(board, Odds.ROOK, chess.WHITE)
