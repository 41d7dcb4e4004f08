"""A move as a task in words, which a policy that reads can be told."""

from __future__ import annotations

import chess

from app.pieces.inventory import MoveKind
from app.pieces.layout import KINDS, colour_of
from app.pieces.manipulation import move_kind


def task_of(board: chess.Board, move: chess.Move) -> str:
    """What the arm is to do, in one phrase, such as ``move the white knight from g1 to f3``.

    Args:
        board: the position before the move; it is not changed.
        move: a legal move; castling in either notation.
    """
    match move_kind(board, move):
        case MoveKind.CASTLING:
            return _castling(board, move)
        case MoveKind.PROMOTION:
            return _promotion(board, move)
        case MoveKind.EN_PASSANT:
            passed = chess.square(chess.square_file(move.to_square), chess.square_rank(move.from_square))
            return f"{_capture(board, move, passed)} to {chess.square_name(move.to_square)} en passant"
        case MoveKind.CAPTURE:
            return _capture(board, move, move.to_square)
        case MoveKind.QUIET:
            return f"move the {_from(board, move)} to {chess.square_name(move.to_square)}"


def _capture(board: chess.Board, move: chess.Move, captured: chess.Square) -> str:
    return f"capture the {_piece(board, captured)} on {chess.square_name(captured)} with the {_from(board, move)}"


def _promotion(board: chess.Board, move: chess.Move) -> str:
    assert move.promotion is not None
    into = KINDS[move.promotion]
    if board.is_capture(move):
        return f"{_capture(board, move, move.to_square)} and promote it to a {into}"
    return f"promote the {_from(board, move)} to a {into} on {chess.square_name(move.to_square)}"


def _castling(board: chess.Board, move: chess.Move) -> str:
    """Where king and rook stand and come to stand; one that stays, as it may in Chess960, is not named."""
    kingside = board.is_kingside_castling(move)
    rank = chess.square_rank(move.from_square)
    rights = chess.SquareSet(board.clean_castling_rights() & chess.BB_RANKS[rank])
    rooks = [square for square in rights if (square > move.from_square) == kingside]
    ways = [
        (chess.KING, move.from_square, chess.square(6 if kingside else 2, rank)),
        (chess.ROOK, rooks[-1 if kingside else 0], chess.square(5 if kingside else 3, rank)),
    ]
    steps = [
        f"{KINDS[piece]} from {chess.square_name(source)} to {chess.square_name(target)}"
        for piece, source, target in ways
        if source != target
    ]
    return f"castle {'kingside' if kingside else 'queenside'} with {colour_of(board.turn)}: {', '.join(steps)}"


def _from(board: chess.Board, move: chess.Move) -> str:
    return f"{_piece(board, move.from_square)} from {chess.square_name(move.from_square)}"


def _piece(board: chess.Board, square: chess.Square) -> str:
    piece = board.piece_at(square)
    assert piece is not None, "a legal move moves a piece, and captures one"
    return f"{colour_of(piece.color)} {KINDS[piece.piece_type]}"
