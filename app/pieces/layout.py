"""The physical set and where each piece of it stands when a game starts.

A set is 32 pieces and spares for promotions. Every piece has a name that stays with it for the whole game.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import chess

from app import UserError
from hardware.piece_set import Colour, Kind
from hardware.table import Captured, PieceSpec, Place, TableSettings, square_place

SPARES: Mapping[Kind, int] = MappingProxyType({Kind.QUEEN: 3, Kind.ROOK: 2, Kind.BISHOP: 2, Kind.KNIGHT: 2})
"""Spare pieces of each colour.

Two of each kind serve two under-promotions to it with every original still alive; a third queen, since nearly all
promotions are to a queen. The number is bounded by the trays: both colours' spares are 18, at most 30 pieces can be
captured or promoted away (all but the kings), and 18 + 30 = 48 is what two trays of 24 places hold.
"""
KINDS: Mapping[chess.PieceType, Kind] = MappingProxyType({
    chess.PAWN: Kind.PAWN, chess.KNIGHT: Kind.KNIGHT, chess.BISHOP: Kind.BISHOP, chess.ROOK: Kind.ROOK,
    chess.QUEEN: Kind.QUEEN, chess.KING: Kind.KING,
})  # fmt: skip
"""python-chess's piece types in the words of the table."""
PIECE_TYPES: Mapping[Kind, chess.PieceType] = MappingProxyType({kind: number for number, kind in KINDS.items()})
"""The other way round."""
_BACK_RANK = (Kind.ROOK, Kind.KNIGHT, Kind.BISHOP, Kind.QUEEN, Kind.KING, Kind.BISHOP, Kind.KNIGHT, Kind.ROOK)


class PositionImpossible(UserError):
    """The physical set cannot show this position."""


class TraysTooSmall(UserError):
    """Trays and boxes cannot hold all that may have to leave the board in one game."""

    def __init__(self, places: int, needed: int, what: str = "all pieces except the kings") -> None:
        super().__init__(
            f"the trays have {places} places, {needed} are needed for {what}: "
            "enlarge tray_rows or tray_columns of the table"
        )


class BoxesTooSmall(UserError):
    """The boxes cannot hold all that may leave the board in one game."""

    def __init__(self, places: int, needed: int) -> None:
        super().__init__(
            f"the boxes have room for {places} pieces, {needed} are needed for all except the kings: "
            "enlarge box_points or box_rounds of the table"
        )


@dataclass(frozen=True, slots=True)
class SetPiece:
    """A piece of the physical set, not yet placed."""

    name: str
    kind: Kind
    colour: Colour
    home: chess.Square | None
    """Its square in the usual starting position; None for a spare."""


def kind_of(piece: chess.Piece) -> Kind:
    """Kind of a python-chess piece."""
    return KINDS[piece.piece_type]


def colour_of(colour: chess.Color) -> Colour:
    """Side of a python-chess colour (True is white)."""
    return Colour.WHITE if colour else Colour.BLACK


def physical_set() -> tuple[SetPiece, ...]:
    """All 50 pieces: the 32 of the usual start first, then the spares; white before black."""
    originals = tuple(piece for colour in Colour for piece in _originals(colour))
    return originals + tuple(
        SetPiece(f"{colour}-{kind}-spare-{number}", kind, colour, None)
        for colour in Colour
        for kind, count in SPARES.items()
        for number in range(1, count + 1)
    )


def start_layout(board: chess.Board, table: TableSettings) -> tuple[PieceSpec, ...]:
    """Place the whole physical set for a position.

    Pieces of the position stand on their squares, each on its home square or file where that is possible. Spares and
    what the position lacks stand in the trays, outer column first and near the rank where their colour promotes, so
    that the innermost places stay free for captures. With boxes for captured pieces, only spares stand in the trays;
    what the position lacks is not on the table, since it could never serve any more.

    Args:
        board: any position with one king a side; it is not changed.
        table: board and trays.

    Returns:
        One entry for each of the 50 pieces, or of those on the table, in the order of :func:`physical_set`.

    Raises:
        PositionImpossible: the position needs more of a kind than set and spares hold, or not one king a side.
        TraysTooSmall: the trays do not hold all pieces but the kings, or with boxes, all spares.
        BoxesTooSmall: the boxes do not hold all pieces but the kings.
    """
    pieces = physical_set()
    _check_room(pieces, table)
    _check_enough(board, pieces)
    placed = pieces_on_squares(board, pieces)
    if table.captured is Captured.BOX:
        pieces = tuple(piece for piece in pieces if piece in placed or piece.home is None)
    return tuple(
        PieceSpec(piece.name, piece.kind, piece.colour, place)
        for piece, place in _with_trays(pieces, placed, table).items()
    )


def _originals(colour: Colour) -> Iterable[SetPiece]:
    back, front = (0, 1) if colour is Colour.WHITE else (7, 6)
    for file, kind in enumerate(_BACK_RANK):
        letter = f"-{chess.FILE_NAMES[file]}" if _BACK_RANK.count(kind) > 1 else ""
        yield SetPiece(f"{colour}-{kind}{letter}", kind, colour, chess.square(file, back))
    for file, letter in enumerate(chess.FILE_NAMES):
        yield SetPiece(f"{colour}-{Kind.PAWN}-{letter}", Kind.PAWN, colour, chess.square(file, front))


def _check_room(pieces: tuple[SetPiece, ...], table: TableSettings) -> None:
    needed, room = sum(piece.kind is not Kind.KING for piece in pieces), len(table.tray_places())
    if table.captured is Captured.TRAY:
        if room < needed:
            raise TraysTooSmall(room, needed)
        return
    spares = sum(piece.home is None for piece in pieces)
    if room < spares:
        raise TraysTooSmall(room, spares, "the spares")
    if len(table.box_places()) < needed:
        raise BoxesTooSmall(len(table.box_places()), needed)


def _check_enough(board: chess.Board, pieces: tuple[SetPiece, ...]) -> None:
    wanted = Counter((colour_of(piece.color), kind_of(piece)) for piece in board.piece_map().values())
    held = Counter((piece.colour, piece.kind) for piece in pieces)
    for (colour, kind), count in held.items():
        asked = wanted[colour, kind]
        if kind is Kind.KING and asked != 1:
            raise PositionImpossible(f"the position has {asked} {colour} kings, each side needs exactly one")
        if asked > count:
            raise PositionImpossible(
                f"the position has {asked} {colour} {kind}s, the set holds {count} with its spares: "
                f"choose a position with at most {count}"
            )


def pieces_on_squares(board: chess.Board, pieces: tuple[SetPiece, ...]) -> dict[SetPiece, Place]:
    """Choose a piece of the set for each occupied square: the best fitting pair first."""
    wanted = {square: (colour_of(p.color), kind_of(p)) for square, p in board.piece_map().items()}
    pairs = sorted(
        (_misfit(piece, square), square, rank)
        for square, look in wanted.items()
        for rank, piece in enumerate(pieces)
        if (piece.colour, piece.kind) == look
    )
    placed: dict[SetPiece, Place] = {}
    filled: set[chess.Square] = set()
    for _, square, rank in pairs:
        if square not in filled and pieces[rank] not in placed:
            filled.add(square)
            placed[pieces[rank]] = square_place(square)
    return placed


def _misfit(piece: SetPiece, square: chess.Square) -> int:
    """How far a name would mislead there: 0 at home, then files away from it, bishops of the other shade, spares."""
    if piece.home is None:
        return 20
    if piece.home == square:
        return 0
    other_shade = piece.kind is Kind.BISHOP and _is_light(piece.home) != _is_light(square)
    files = abs(chess.square_file(piece.home) - chess.square_file(square))
    return 1 + files + (10 if other_shade else 0)


def _is_light(square: chess.Square) -> bool:
    return bool(chess.BB_LIGHT_SQUARES & chess.BB_SQUARES[square])


def _with_trays(
    pieces: tuple[SetPiece, ...], placed: Mapping[SetPiece, Place], table: TableSettings
) -> dict[SetPiece, Place]:
    """Give every piece without a square a place in a tray; spares first, as they belong nearest to promotion."""
    places = dict(placed)
    order = {colour: _tray_order(colour, table) for colour in Colour}
    taken: set[Place] = set()
    for piece in sorted((p for p in pieces if p not in placed), key=lambda p: p.home is not None):
        places[piece] = next(place for place in order[piece.colour] if place not in taken)
        taken.add(places[piece])
    return {piece: places[piece] for piece in pieces}


def _tray_order(colour: Colour, table: TableSettings) -> list[Place]:
    """Tray places for a colour's spares: outer columns first, then by distance to its promotion rank, L before R."""
    _, promotion_y = table.xy(square_place(chess.A8 if colour is Colour.WHITE else chess.A1))

    def key(place: Place) -> tuple[float, float, Place]:
        x, y = table.xy(place)
        return -round(abs(x), 6), round(abs(y - promotion_y), 6), place

    # L and R mirror each other, so this order alternates the trays: each kind of spare is at hand on both sides
    return sorted(table.tray_places(), key=key)
