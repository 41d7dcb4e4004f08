"""The move that a person has made while nobody looked, from the board as it stands afterwards.

An observer that has followed a game knows what the board looked like before a move. A program that goes on with a game
of another one has no such picture; but it knows the position, and of all moves that are legal there one may explain all
that the picture shows, outline by outline.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

import chess
import numpy as np

from app.pieces.layout import colour_of, kind_of
from hardware.interfaces import Frame
from hardware.table import PieceSpec, square_place
from vision.board.view import BoardView
from vision.pieces.placement_faults import Fault, FaultKind, examine_board
from vision.reading.appearance import BLACK, WHITE
from vision.reading.evidence import codes_of
from vision.reading.observer import likelihood_by_others
from vision.reading.rectified_view import sight_of_frame

NEAR: Final = 0.25
"""So far off its square's centre along both axes a piece may be that a person has put there, in squares …"""
OTHER_COLOUR: Final = 1.0
"""… and by so much a piece that has captured must look more like its own colour than like the captured piece's, in
natural logarithms: an outline tells that a piece fits there, but so it does where a larger one stands."""


def reply_shown(frame: Frame, view: BoardView, board: chess.Board, wrong: Collection[int]) -> chess.Move | None:
    """The only legal move after which the board would be just as it looks in a frame with nothing over it.

    Squares that are ``wrong`` do not look as in the position before it.

    Returns:
        None: nothing is wrong, or no move explains it, or more than one does. Of promotions on one square the first
        of ``board.legal_moves``: what the pawn has become is left open.
    """
    found: chess.Move | None = None
    for move in board.legal_moves:
        changed = _changed(board, move)
        if not wrong or not set(wrong) <= changed:
            continue
        after = board.copy(stack=False)
        after.push(move)
        if not all(_is_near(fault, view) for fault in examine_board(frame, view, pieces_of(after)).faults):
            continue
        if board.piece_at(move.to_square) is not None and not _captured(frame, view, board, move):
            continue
        if found is None:
            found = move
        elif (found.from_square, found.to_square) != (move.from_square, move.to_square):
            return None
    return found


def _is_near(fault: Fault, view: BoardView) -> bool:
    """Whether nothing is wrong but that a piece is not quite on its square's centre: people are not so exact."""
    if fault.kind is not FaultKind.OFF_CENTRE or fault.place is None:
        return False
    off = np.subtract(fault.place, view.table.xy(square_place(fault.square)))
    return bool(np.abs(off).max() <= NEAR * view.table.square)


def _captured(frame: Frame, view: BoardView, board: chess.Board, move: chess.Move) -> bool:
    """Whether what stands where a piece was captured has the colour of the piece that did it."""
    if board.is_castling(move):
        return True
    looks = likelihood_by_others(sight_of_frame(frame, view), codes_of(board), _changed(board, move))
    own, other = (WHITE, BLACK) if board.turn else (BLACK, WHITE)
    return bool(looks[move.to_square, own] > looks[move.to_square, other] + OTHER_COLOUR)


def pieces_of(board: chess.Board) -> dict[int, PieceSpec]:
    """Of a position, by square."""
    return {
        square: PieceSpec(chess.square_name(square), kind_of(piece), colour_of(piece.color), square_place(square))
        for square, piece in board.piece_map().items()
    }


def _changed(board: chess.Board, move: chess.Move) -> set[int]:
    after = board.copy(stack=False)
    after.push(move)
    return {square for square in chess.SQUARES if board.piece_at(square) != after.piece_at(square)}
