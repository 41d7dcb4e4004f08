"""From a chess move to transfers of physical pieces.

Everything here is pure: no function changes the board, the inventory or a ply it is given. Errors::

    UserError
    ├── NoSpare            the set has no piece of that kind left to promote to
    └── PieceBoxed         the piece was dropped into a box, from which the arm takes nothing
    ValueError
    └── IllegalPly         the move is not legal in that position
    RuntimeError
    └── InventoryError     a bug: the inventory and what is done to it contradict each other
"""

from __future__ import annotations

import chess

from app import UserError
from app.pieces.inventory import Inventory, MoveKind, Ply, Transfer
from app.pieces.layout import KINDS, colour_of
from hardware.piece_set import Colour, Kind
from hardware.table import Place, square_place

_PROMOTED = (Kind.QUEEN, Kind.ROOK, Kind.BISHOP, Kind.KNIGHT)


class IllegalPly(ValueError):
    """The move is not legal in the position."""

    def __init__(self, move: chess.Move, board: chess.Board) -> None:
        super().__init__(f"{move.uci()} is not a legal move in {board.fen()}")


class NoSpare(UserError):
    """No piece of the promoted kind and colour is beside the board."""

    def __init__(self, kind: Kind, colour: Colour, square: Place, others: tuple[Kind, ...]) -> None:
        remedy = f"promote to a {' or '.join(others)} instead" if others else "no other piece is left either"
        super().__init__(f"no spare {colour} {kind} is left for the promotion on {square}: {remedy}")
        self.kind = kind
        self.colour = colour
        self.others = others


def move_kind(board: chess.Board, move: chess.Move) -> MoveKind:
    """What kind of move a legal move is."""
    if move.promotion is not None:
        return MoveKind.PROMOTION
    if board.is_castling(move):
        return MoveKind.CASTLING
    if board.is_en_passant(move):
        return MoveKind.EN_PASSANT
    return MoveKind.CAPTURE if board.is_capture(move) else MoveKind.QUIET


def transfers(board: chess.Board, move: chess.Move, inventory: Inventory) -> Ply:
    """Plan the transfers that show a move on the table; none ever ends on an occupied place.

    A captured piece leaves first, then a promoted pawn; where to, :meth:`Inventory.nearest_free` says. A promotion
    takes the nearest piece of its kind beside the board.

    Args:
        board: the position before the move; it is not changed.
        move: a legal move; castling in either notation (king to its square or onto the rook).
        inventory: what stands where before the move.

    Raises:
        IllegalPly: the move is not legal.
        InventoryError: inventory and position do not agree.
        NoSpare: nothing to promote to is left of that kind.
    """
    if not move or not board.is_legal(move):
        raise IllegalPly(move, board)
    inventory.check_against(board)
    kind = move_kind(board, move)
    plan = _PlyTransfers(inventory)
    if kind is MoveKind.CASTLING:
        _castle(plan, board, move)
    else:
        _step(plan, board, move)
    return Ply(board.san(move), board.uci(move), kind, colour_of(board.turn), tuple(plan.transfers))


class _PlyTransfers:
    """Transfers decided so far and the inventory after them, which refuses any collision."""

    def __init__(self, inventory: Inventory) -> None:
        self.inventory = inventory
        self.transfers: list[Transfer] = []

    def carry(self, source: Place, target: Place) -> None:
        piece = self.inventory.standing[source]
        transfer = Transfer.of(piece, target)
        self.inventory = self.inventory.moved(transfer)
        self.transfers.append(transfer)

    def clear(self, source: Place) -> None:
        self.carry(source, self.inventory.nearest_free(source))


def _step(plan: _PlyTransfers, board: chess.Board, move: chess.Move) -> None:
    source, target = square_place(move.from_square), square_place(move.to_square)
    if board.is_capture(move):
        plan.clear(_captured(board, move))
    if move.promotion is None:
        plan.carry(source, target)
        return
    spare = _spare(plan.inventory, KINDS[move.promotion], colour_of(board.turn), target)
    plan.clear(source)
    plan.carry(spare, target)


def _captured(board: chess.Board, move: chess.Move) -> Place:
    if board.is_en_passant(move):  # the pawn taken stands beside the one that takes it, not on its target
        return square_place(chess.square(chess.square_file(move.to_square), chess.square_rank(move.from_square)))
    return square_place(move.to_square)


def _spare(inventory: Inventory, kind: Kind, colour: Colour, square: Place) -> Place:
    found = [piece.place for piece in inventory.spares(kind, colour)]
    if not found:
        others = tuple(other for other in _PROMOTED if inventory.spares(other, colour))
        raise NoSpare(kind, colour, square, others)
    return min(found, key=lambda place: (inventory.travel(place, square), place))


def _castle(plan: _PlyTransfers, board: chess.Board, move: chess.Move) -> None:
    """King first, then rook; the rook first, or a detour of the king, where they block each other (Chess960)."""
    king, rook = square_place(move.from_square), square_place(_castling_rook(board, move))
    king_target, rook_target = _castled(board, move)
    if king_target == rook and rook_target == king:
        detour = _detour(plan.inventory, king, king_target)
        steps = [(king, detour), (rook, rook_target), (detour, king_target)]
    elif king_target == rook:
        steps = [(rook, rook_target), (king, king_target)]
    else:
        steps = [(king, king_target), (rook, rook_target)]
    for source, target in steps:
        if source != target:
            plan.carry(source, target)


def _castling_rook(board: chess.Board, move: chess.Move) -> chess.Square:
    """Square of the rook; a legal castling leaves exactly one with rights on the king's rank and side."""
    rank = chess.BB_RANKS[chess.square_rank(move.from_square)]
    rooks = chess.SquareSet(board.clean_castling_rights() & rank)
    return next(r for r in rooks if (r < move.from_square) == (move.to_square < move.from_square))


def _castled(board: chess.Board, move: chess.Move) -> tuple[Place, Place]:
    """Where king and rook stand after castling."""
    rank = chess.square_rank(move.from_square)
    king_file, rook_file = (2, 3) if board.is_queenside_castling(move) else (6, 5)
    return square_place(chess.square(king_file, rank)), square_place(chess.square(rook_file, rank))


def _detour(inventory: Inventory, source: Place, target: Place) -> Place:
    """The free place, square or tray, with the shortest way from source to target over it."""
    free = [place for place in inventory.places() if inventory.at(place) is None]
    return min(free, key=lambda place: (inventory.travel(source, place) + inventory.travel(place, target), place))
