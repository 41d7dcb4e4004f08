"""Two moves that look like one piece carried off: the first one's square is taken again by the second.

A pawn goes from e2 to e4, then the queen from d1 to e2: d1 is empty, and something white stands on e4, as if the queen
had been carried there. Colours alone do not tell.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import chess

from app.execution.repair.belief import SURE
from app.execution.repair.observed import FLUKE, Chances
from app.pieces.layout import kind_of
from hardware.table import Colour, Kind


def doubted(
    board: chess.Board, looks: Mapping[int, Colour | None], believed: Mapping[int, Kind], kinds: Mapping[int, Chances]
) -> frozenset[int]:
    """Squares on which other kinds than believed may stand, since two moves in a row would look the same.

    Args:
        board: the position that should be there; it is not changed.
        looks: colour of what stands on each of the 64 squares.
        believed: kind of what stands on squares.
        kinds: how likely what stands on a square is of each kind; left out: unknown.
    """
    white, black = (sum(1 << square for square, look in looks.items() if look is colour) for colour in Colour)
    squares = set[int]()
    for after in _after_two(board, white, black):
        placed = {square: kind_of(piece) for square, piece in after.items()}
        other = {square for square, kind in believed.items() if placed[square] is not kind}
        margin = math.fsum(
            math.log(_chance(kinds, square, believed[square])) - math.log(_chance(kinds, square, placed[square]))
            for square in other
        )
        if margin < SURE:
            squares |= other
    return frozenset(squares)


def _chance(kinds: Mapping[int, Chances], square: int, kind: Kind) -> float:
    return max(kinds[square].get(kind, 0.0), FLUKE) if square in kinds else 1.0 / len(Kind)


def _after_two(board: chess.Board, white: int, black: int) -> Iterator[Mapping[int, chess.Piece]]:
    """Positions after two legal moves, by both sides or by the one to move, in which each side has these squares."""
    now = board.copy(stack=False)
    for first in list(now.legal_moves):
        now.push(first)
        for own in (False, True):
            after = now if not own else _passed(now)
            mine = white if after.turn else black
            for second in after.generate_legal_moves(~mine, mine | after.occupied_co[after.turn]):
                if not (mine >> second.to_square & 1 or after.is_castling(second)):
                    continue
                after.push(second)
                if after.occupied_co[chess.WHITE] == white and after.occupied_co[chess.BLACK] == black:
                    yield after.piece_map()
                after.pop()
        now.pop()


def _passed(board: chess.Board) -> chess.Board:
    """The same position with the other side to move."""
    passed = board.copy(stack=False)
    passed.turn, passed.ep_square = not board.turn, None
    return passed
