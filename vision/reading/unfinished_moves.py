"""A move of two pieces that somebody has half made: what stands there then, and how to go on, in words."""

from __future__ import annotations

from collections.abc import Iterator

import chess
from chess import square_name

from vision.arrays import Indices
from vision.reading.appearance import EMPTY
from vision.reading.evidence import codes_of, states_of


def halves_of(board: chess.Board, move: chess.Move) -> Iterator[tuple[Indices, str]]:
    """What stands there while a move is half made, and how to go on."""
    states, san = states_of(codes_of(board)), board.san(move)
    after = states_of(codes_of(played(board, move)))
    if board.is_castling(move):
        kingside = board.is_kingside_castling(move)
        rank = chess.square_rank(move.from_square)
        old, new = (chess.square(file, rank) for file in ((7, 5) if kingside else (0, 3)))
        king = chess.square(6 if kingside else 2, rank)
        first = states.copy()
        first[move.from_square], first[king] = EMPTY, states[move.from_square]
        yield first, f"{san} is only half made: put the rook from {square_name(old)} on {square_name(new)}"
        return
    if board.is_capture(move):
        taken = _captured(board, move)
        start, end, place = (square_name(square) for square in (move.from_square, move.to_square, taken))
        off = states.copy()
        off[taken] = EMPTY
        yield off, f"the piece on {place} is off: finish the capture, or put it back on {place}"
        lifted = off.copy()
        lifted[move.from_square] = EMPTY
        yield lifted, f"{san} is only half made: put the piece from {start} on {end}"
        if board.is_en_passant(move):
            left = after.copy()
            left[taken] = states[taken]
            yield left, f"{san} is only half made: take the pawn on {place} off the board"


def played(board: chess.Board, move: chess.Move) -> chess.Board:
    """The position after a move, without its history."""
    after = board.copy(stack=False)
    after.push(move)
    return after


def _captured(board: chess.Board, move: chess.Move) -> int:
    if board.is_en_passant(move):
        return chess.square(chess.square_file(move.to_square), chess.square_rank(move.from_square))
    return move.to_square
