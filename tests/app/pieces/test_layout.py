"""The physical set: names, places, and what it cannot show."""

from __future__ import annotations

import random
import re
from collections import Counter

import chess
import pytest

from app.pieces.layout import (
    KINDS,
    SPARES,
    PositionImpossible,
    TraysTooSmall,
    colour_of,
    kind_of,
    physical_set,
    start_layout,
)
from hardware.piece_set import Colour, Kind
from hardware.table import PieceSpec, TableSettings, square_place

TABLE = TableSettings()


def layout(fen: str = chess.STARTING_FEN, *, chess960: bool = False) -> dict[str, PieceSpec]:
    return {piece.name: piece for piece in start_layout(chess.Board(fen, chess960=chess960), TABLE)}


def assert_shows(pieces: dict[str, PieceSpec], board: chess.Board) -> None:
    shown = {p.place.index: (p.kind, p.colour) for p in pieces.values() if p.place.on_board}
    assert shown == {sq: (kind_of(p), colour_of(p.color)) for sq, p in board.piece_map().items()}
    assert len({p.place for p in pieces.values()}) == len(pieces) == 50


def test_the_set_has_32_pieces_and_18_spares_with_readable_names() -> None:
    pieces = physical_set()
    names = [piece.name for piece in pieces]
    assert len(set(names)) == len(names) == 50
    assert sum(piece.home is not None for piece in pieces) == 32
    assert {"white-pawn-e", "white-king", "black-queen", "black-rook-a", "white-knight-g"} < set(names)
    assert {"black-queen-spare-1", "black-queen-spare-3", "white-knight-spare-2"} < set(names)


@pytest.mark.parametrize("colour", list(Colour))
def test_each_colour_has_its_spares(colour: Colour) -> None:
    spares = Counter(p.kind for p in physical_set() if p.home is None and p.colour is colour)
    assert spares == dict(SPARES)


def test_there_is_always_a_place_in_the_trays() -> None:
    """All pieces but the two kings may have to lie in the trays at once, and that is exactly what they hold."""
    assert sum(piece.kind is not Kind.KING for piece in physical_set()) == len(TABLE.tray_places()) == 48
    bare = layout("4k3/8/8/8/8/8/8/4K3 w - - 0 1")
    assert {p.place for p in bare.values() if not p.place.on_board} == set(TABLE.tray_places())


def test_the_usual_start_puts_each_piece_at_home() -> None:
    pieces = layout()
    assert_shows(pieces, chess.Board())
    for piece in physical_set():
        if piece.home is not None:
            assert pieces[piece.name].place == square_place(piece.home), piece.name


def test_spares_leave_the_inner_columns_free() -> None:
    spares = [p for p in layout().values() if not p.place.on_board]
    assert len(spares) == 18
    assert all(piece.place.index >= TABLE.tray_rows for piece in spares)


@pytest.mark.parametrize("colour", list(Colour))
@pytest.mark.parametrize("kind", list(SPARES))
def test_each_kind_of_spare_is_on_both_sides_near_its_promotion_rank(kind: Kind, colour: Colour) -> None:
    spares = [p for p in layout().values() if p.kind is kind and p.colour is colour and not p.place.on_board]
    assert {piece.place.zone for piece in spares} == {"L", "R"}
    up = 1 if colour is Colour.WHITE else -1
    assert all(TABLE.xy(piece.place)[1] * up > 0 for piece in spares)


def test_missing_pieces_lie_in_the_trays() -> None:
    pieces = layout("rnbqkbnr/pppppppp/8/8/8/8/PPPPPPP1/RNBQKBN1 w Qkq - 0 1")
    assert not pieces["white-rook-h"].place.on_board
    assert not pieces["white-pawn-h"].place.on_board


def test_names_follow_files_and_shades() -> None:
    pieces = layout("4k3/8/8/2b5/4P3/8/5B2/4K3 w - - 0 1")
    assert str(pieces["white-pawn-e"].place) == "e4"
    assert str(pieces["black-bishop-f"].place) == "c5"  # the black bishop of the dark squares starts on f8
    assert str(pieces["white-bishop-c"].place) == "f2"


def test_promoted_queens_are_spares() -> None:
    fen = "4k3/8/8/QQ6/QQ6/8/8/4K3 w - - 0 1"
    pieces = layout(fen)
    assert_shows(pieces, chess.Board(fen))
    assert pieces["white-queen-spare-3"].place.on_board


@pytest.mark.parametrize("number", range(0, 960, 37))
def test_chess960_starts(number: int) -> None:
    board = chess.Board.from_chess960_pos(number)
    assert_shows({p.name: p for p in start_layout(board, TABLE)}, board)


def test_any_position_of_the_set_is_shown() -> None:
    draw = random.Random(7)
    both = [(piece.kind, piece.colour is Colour.WHITE) for piece in physical_set()]
    types = {kind: piece_type for piece_type, kind in KINDS.items()}
    for _ in range(100):
        wanted = [p for p in both if p[0] is Kind.KING or draw.random() < draw.random()]
        board = chess.Board.empty()
        for square, (kind, white) in zip(draw.sample(chess.SQUARES, len(wanted)), wanted, strict=True):
            board.set_piece_at(square, chess.Piece(types[kind], white))
        assert_shows({p.name: p for p in start_layout(board, TABLE)}, board)


def test_the_board_is_not_changed() -> None:
    board = chess.Board()
    board.push_san("e4")
    before = (board.fen(), list(board.move_stack))
    start_layout(board, TABLE)
    assert (board.fen(), board.move_stack) == before


@pytest.mark.parametrize(
    ("fen", "message"),
    [
        (
            "4k3/8/8/QQQ5/QQ6/8/8/4K3 w - - 0 1",
            "the position has 5 white queens, the set holds 4 with its spares: choose a position with at most 4",
        ),
        (
            "4k3/8/nnnnn3/8/8/8/8/4K3 w - - 0 1",
            "the position has 5 black knights, the set holds 4 with its spares: choose a position with at most 4",
        ),
        (
            "4k3/pppppppp/p7/8/8/8/8/4K3 w - - 0 1",
            "the position has 9 black pawns, the set holds 8 with its spares: choose a position with at most 8",
        ),
        ("8/8/8/8/8/8/8/4K3 w - - 0 1", "the position has 0 black kings, each side needs exactly one"),
        ("4k3/8/8/8/8/8/8/4KK2 w - - 0 1", "the position has 2 white kings, each side needs exactly one"),
    ],
)
def test_impossible_positions_are_refused_by_name(fen: str, message: str) -> None:
    with pytest.raises(PositionImpossible, match=f"^{re.escape(message)}$"):
        layout(fen)


def test_small_trays_are_refused() -> None:
    message = (
        "the trays have 44 places, 48 are needed for all pieces except the kings: "
        "enlarge tray_rows or tray_columns of the table"
    )
    with pytest.raises(TraysTooSmall, match=f"^{re.escape(message)}$"):
        start_layout(chess.Board(), TableSettings(tray_rows=11))


def test_other_tables_are_served() -> None:
    table = TableSettings(tray_rows=8, tray_columns=3)
    places = {p.place for p in start_layout(chess.Board("4k3/8/8/8/8/8/8/4K3 w - - 0 1"), table)}
    assert set(table.tray_places()) < places
