"""Games at odds: the stronger side begins without a piece."""

from __future__ import annotations

from types import MappingProxyType
from typing import Final

import chess

from app import UserError
from app.settings.defaults import Odds

_FILES: Final = MappingProxyType({Odds.PAWN: "f", Odds.KNIGHT: "b", Odds.BISHOP: "c", Odds.ROOK: "a", Odds.QUEEN: "d"})
"""Where the piece is missing, by custom: the king's bishop's pawn, else the piece on the queen's side."""


def at_odds(board: chess.Board, odds: Odds | None, giver: chess.Color) -> chess.Board:
    """The usual start without one piece of the side that gives odds; None: as it is.

    ``board`` is left alone. Raises ``UserError`` if it is not the usual start.
    """
    if odds is None:
        return board
    if board.fen() != chess.STARTING_FEN:
        raise UserError("odds are given from the usual start: leave the other position out, or remove the piece there")
    rank = (2 if odds is Odds.PAWN else 1) if giver else (7 if odds is Odds.PAWN else 8)
    found = board.copy()
    found.remove_piece_at(chess.parse_square(f"{_FILES[odds]}{rank}"))
    found.castling_rights = found.clean_castling_rights()
    return found
