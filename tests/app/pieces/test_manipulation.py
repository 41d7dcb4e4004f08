"""Each kind of move as transfers of pieces, both colours, and what is refused."""

from __future__ import annotations

import math
import re

import chess
import pytest

from app.pieces.inventory import Inventory, InventoryError, MoveKind, Ply, Transfer, expected
from app.pieces.layout import start_layout
from app.pieces.manipulation import IllegalPly, NoSpare, move_kind, transfers
from hardware.piece_set import Colour, Kind
from hardware.table import PieceSpec, Place, TableSettings, square_place

TABLE = TableSettings()
KINGS = "4k3/8/8/8/8/8/8/4K3 w - - 0 1"


def stock(board: chess.Board) -> Inventory:
    return Inventory.of(start_layout(board, TABLE), TABLE)


def plan(fen: str, uci: str, *, chess960: bool = False) -> tuple[Ply, Inventory, chess.Board]:
    """Plan a move and check that the table then shows the position after it."""
    board = chess.Board(fen, chess960=chess960)
    before = stock(board)
    ply = transfers(board, chess.Move.from_uci(uci), before)
    assert board.fen() == chess.Board(fen, chess960=chess960).fen()
    assert not board.move_stack
    board.push(chess.Move.from_uci(uci))
    after = before.after(ply)
    after.check_against(board)
    return ply, before, board


def steps(ply: Ply) -> list[tuple[str, str, str]]:
    return [(transfer.name, str(transfer.source), str(transfer.target)) for transfer in ply.transfers]


def test_quiet_move() -> None:
    ply, _, _ = plan(chess.STARTING_FEN, "g1f3")
    assert steps(ply) == [("white-knight-g", "g1", "f3")]
    assert (ply.kind, ply.colour, ply.san, ply.uci) == (MoveKind.QUIET, Colour.WHITE, "Nf3", "g1f3")


@pytest.mark.parametrize(
    ("fen", "uci", "taken", "taker", "target"),
    [
        ("4k3/8/8/3p4/4P3/8/8/4K3 w - - 0 1", "e4d5", "black-pawn-d", "white-pawn-e", "L7"),
        ("4k3/8/8/3p4/4P3/8/8/4K3 b - - 0 1", "d5e4", "white-pawn-e", "black-pawn-d", "R6"),
        ("4k2r/8/8/8/8/8/8/4K2R w - - 0 1", "h1h8", "black-rook-h", "white-rook-h", "R11"),
    ],
)
def test_a_captured_piece_leaves_first_to_the_nearest_free_place(
    fen: str, uci: str, taken: str, taker: str, target: str
) -> None:
    board = chess.Board(fen)
    # only spares in the trays, so that the inner columns are free
    spares = [p for p in start_layout(board, TABLE) if p.place.on_board or "spare" in p.name]
    ply = transfers(board, chess.Move.from_uci(uci), Inventory.of(spares, TABLE))
    assert ply.kind is MoveKind.CAPTURE
    assert steps(ply) == [(taken, uci[2:], target), (taker, uci[:2], uci[2:])]


@pytest.mark.parametrize("square", [chess.A1, chess.D4, chess.E4, chess.E6, chess.H8, chess.C7])
def test_the_nearest_free_place_is_the_nearest(square: chess.Square) -> None:
    inventory = stock(chess.Board())
    chosen = inventory.nearest_free(square_place(square))
    assert inventory.at(chosen) is None
    assert chosen.zone == ("L" if chess.square_file(square) < 4 else "R")
    free = [place for place in TABLE.tray_places() if inventory.at(place) is None]
    x, y = TABLE.xy(square_place(square))
    ways = {p: (TABLE.xy(p)[0] - x) ** 2 + (TABLE.xy(p)[1] - y) ** 2 for p in free}
    assert ways[chosen] == pytest.approx(min(ways.values()))


def test_equal_travel_goes_to_the_lower_number() -> None:
    inventory = stock(chess.Board())
    e6, lower, upper = square_place(chess.E6), Place("R", 7), Place("R", 8)
    assert inventory.travel(e6, lower) == inventory.travel(e6, upper)
    assert inventory.nearest_free(e6) == lower


def test_equal_travel_is_equal_in_spite_of_rounding() -> None:
    table = TableSettings(square=0.044, tray_row_pitch=0.022)
    a2, lower, upper = square_place(chess.A2), Place("L", 0), Place("L", 1)
    assert math.dist(table.xy(a2), table.xy(lower)) > math.dist(table.xy(a2), table.xy(upper))  # by the last bit
    assert Inventory.of((), table).nearest_free(a2) == lower


@pytest.mark.parametrize("notation", ["king to square", "king takes rook"])
@pytest.mark.parametrize(
    ("turn", "side", "expected_steps"),
    [
        ("w", "g", [("white-king", "e1", "g1"), ("white-rook-h", "h1", "f1")]),
        ("w", "c", [("white-king", "e1", "c1"), ("white-rook-a", "a1", "d1")]),
        ("b", "g", [("black-king", "e8", "g8"), ("black-rook-h", "h8", "f8")]),
        ("b", "c", [("black-king", "e8", "c8"), ("black-rook-a", "a8", "d8")]),
    ],
)
def test_castling(turn: str, side: str, expected_steps: list[tuple[str, str, str]], notation: str) -> None:
    rank = "1" if turn == "w" else "8"
    target = side if notation == "king to square" else {"g": "h", "c": "a"}[side]
    ply, _, _ = plan(f"r3k2r/8/8/8/8/8/8/R3K2R {turn} KQkq - 0 1", f"e{rank}{target}{rank}")
    assert ply.kind is MoveKind.CASTLING
    assert steps(ply) == expected_steps
    assert ply.uci == f"e{rank}{side}{rank}"


@pytest.mark.parametrize(
    ("back_rank", "rights", "uci", "expected_steps"),
    [
        ("4K2R", "H", "e1h1", [("white-king", "e1", "g1"), ("white-rook-h", "h1", "f1")]),
        ("5K1R", "H", "f1h1", [("white-king", "f1", "g1"), ("white-rook-h", "h1", "f1")]),
        ("4K1R1", "G", "e1g1", [("white-rook-h", "g1", "f1"), ("white-king", "e1", "g1")]),
        ("6KR", "H", "g1h1", [("white-rook-h", "h1", "f1")]),
        ("4KR2", "F", "e1f1", [("white-king", "e1", "g1")]),
        ("RK6", "A", "b1a1", [("white-king", "b1", "c1"), ("white-rook-a", "a1", "d1")]),
        ("R1K5", "A", "c1a1", [("white-rook-a", "a1", "d1")]),
        ("2RK4", "C", "d1c1", [("white-king", "d1", "c2"), ("white-rook-a", "c1", "d1"), ("white-king", "c2", "c1")]),
        ("5KR1", "G", "f1g1", [("white-king", "f1", "f2"), ("white-rook-h", "g1", "f1"), ("white-king", "f2", "g1")]),
    ],
)
def test_castling_in_chess960_never_collides(
    back_rank: str, rights: str, uci: str, expected_steps: list[tuple[str, str, str]]
) -> None:
    ply, _, _ = plan(f"4k3/8/8/8/8/8/8/{back_rank} w {rights} - 0 1", uci, chess960=True)
    assert ply.kind is MoveKind.CASTLING
    assert steps(ply) == expected_steps
    assert ply.changes() == {name: _place(target) for name, _, target in expected_steps}


def _place(square: str) -> Place:
    return square_place(chess.parse_square(square))


def test_the_detour_takes_another_way_where_squares_are_taken() -> None:
    ply, _, _ = plan("4k3/8/8/8/8/8/5PP1/5KR1 w G - 0 1", "f1g1", chess960=True)
    assert steps(ply)[0] == ("white-king", "f1", "e1")
    assert len(ply.transfers) == 3


@pytest.mark.parametrize(
    ("fen", "uci", "taken_from", "taken"),
    [
        ("4k3/8/8/3pP3/8/8/8/4K3 w - d6 0 1", "e5d6", "d5", "black-pawn-d"),
        ("4k3/8/8/4Pp2/8/8/8/4K3 w - f6 0 1", "e5f6", "f5", "black-pawn-f"),
        ("4k3/8/8/8/3pP3/8/8/4K3 b - e3 0 1", "d4e3", "e4", "white-pawn-e"),
        ("4k3/8/8/8/2Pp4/8/8/4K3 b - c3 0 1", "d4c3", "c4", "white-pawn-c"),
    ],
)
def test_en_passant_takes_the_pawn_that_passed(fen: str, uci: str, taken_from: str, taken: str) -> None:
    ply, _, _ = plan(fen, uci)
    assert ply.kind is MoveKind.EN_PASSANT
    (name, source, target), mover = steps(ply)
    assert (name, source) == (taken, taken_from)
    assert target[0] in "LR"
    assert mover[1:] == (uci[:2], uci[2:])


PROMOTED = {"q": Kind.QUEEN, "r": Kind.ROOK, "b": Kind.BISHOP, "n": Kind.KNIGHT}


@pytest.mark.parametrize("letter", PROMOTED)
@pytest.mark.parametrize(
    ("fen", "uci"),
    [
        ("k7/4P3/8/8/8/8/8/4K3 w - - 0 1", "e7e8"),
        ("4k3/8/8/8/8/8/3p4/6K1 b - - 0 1", "d2d1"),
        ("k2r4/4P3/8/8/8/8/8/4K3 w - - 0 1", "e7d8"),
        ("4k3/8/8/8/8/8/3p4/2Q3K1 b - - 0 1", "d2c1"),
    ],
)
def test_promotion(fen: str, uci: str, letter: str) -> None:
    ply, before, _ = plan(fen, uci + letter)
    colour = Colour.WHITE if "w" in fen.split() else Colour.BLACK
    assert (ply.kind, ply.colour) == (MoveKind.PROMOTION, colour)
    *captured, pawn, spare = ply.transfers
    if chess.Board(fen).is_capture(chess.Move.from_uci(uci + letter)):
        (taken,) = captured
        assert (str(taken.source), taken.target.on_board, taken.colour) == (uci[2:], False, _other(colour))
    else:
        assert not captured
    assert (pawn.kind, pawn.colour, str(pawn.source), pawn.target.on_board) == (Kind.PAWN, colour, uci[:2], False)
    assert (spare.kind, spare.colour, str(spare.target)) == (PROMOTED[letter], colour, uci[2:])
    ways = [before.travel(piece.place, spare.target) for piece in before.spares(spare.kind, colour)]
    assert before.travel(spare.source, spare.target) == min(ways)


def _other(colour: Colour) -> Colour:
    return Colour.BLACK if colour is Colour.WHITE else Colour.WHITE


def play(board: chess.Board, line: str, inventory: Inventory) -> tuple[list[Ply], Inventory]:
    plies = []
    for san in line.split():
        move = board.parse_san(san)
        plies.append(transfers(board, move, inventory))
        inventory = inventory.after(plies[-1])
        board.push(move)
        inventory.check_against(board)
    return plies, inventory


def test_a_captured_piece_serves_as_a_spare_when_it_is_nearest() -> None:
    board = chess.Board("1q6/k6P/8/8/7Q/6r1/8/1K6 b - - 0 1")
    pieces = [p for p in start_layout(board, TABLE) if p.place.on_board or p.name == "white-queen-spare-1"]
    inventory = Inventory.of(pieces, TABLE)
    assert inventory.find("white-queen-spare-1").place.zone == "L"
    plies, inventory = play(board, "Rh3 Kc2 Rxh4 h8=Q", inventory)
    assert [t.name for t in plies[-1].transfers] == ["white-pawn-h", "white-queen"]
    assert inventory.at(_place("h8")) == PieceSpec("white-queen", Kind.QUEEN, Colour.WHITE, _place("h8"))
    assert inventory.find("white-queen-spare-1").place.zone == "L"


def test_a_promoted_queen_keeps_the_name_of_the_spare() -> None:
    board = chess.Board("k7/4P3/8/8/8/8/8/4K3 w - - 0 1")
    plies, inventory = play(board, "e8=Q+ Ka7 Qe7+ Kb6 Qb4+ Kc6", stock(board))
    name = plies[0].transfers[-1].name
    assert name.startswith("white-queen")
    assert plies[2].transfers[0].name == plies[4].transfers[0].name == name
    assert str(inventory.find(name).place) == "b4"


def test_no_spare_is_refused_with_the_kinds_that_are_left() -> None:
    board = chess.Board("k7/4P3/8/8/QQQQ4/8/8/4K3 w - - 0 1")
    message = "no spare white queen is left for the promotion on e8: promote to a rook or bishop or knight instead"
    with pytest.raises(NoSpare, match=f"^{re.escape(message)}$") as caught:
        transfers(board, chess.Move.from_uci("e7e8q"), stock(board))
    assert (caught.value.kind, caught.value.colour) == (Kind.QUEEN, Colour.WHITE)
    assert caught.value.others == (Kind.ROOK, Kind.BISHOP, Kind.KNIGHT)


def test_no_spare_at_all_is_refused() -> None:
    board = chess.Board("4k3/8/8/8/8/8/3p4/6K1 b - - 0 1")
    bare = Inventory.of([p for p in start_layout(board, TABLE) if p.place.on_board], TABLE)
    message = "no spare black knight is left for the promotion on d1: no other piece is left either"
    with pytest.raises(NoSpare, match=f"^{re.escape(message)}$"):
        transfers(board, chess.Move.from_uci("d2d1n"), bare)


@pytest.mark.parametrize("uci", ["e2e5", "e7e5", "0000", "e1g1"])
def test_illegal_moves_are_refused(uci: str) -> None:
    board = chess.Board()
    message = f"{uci} is not a legal move in {chess.STARTING_FEN}"
    with pytest.raises(IllegalPly, match=f"^{re.escape(message)}$"):
        transfers(board, chess.Move.from_uci(uci), stock(board))


def test_an_inventory_that_contradicts_the_game_is_a_bug() -> None:
    board = chess.Board()
    inventory = stock(board)
    board.push_san("e4")
    message = "the inventory has white pawn on e2, the game has nothing"
    with pytest.raises(InventoryError, match=f"^{message}$"):
        inventory.check_against(board)
    with pytest.raises(InventoryError, match=f"^{message}$"):
        transfers(board, chess.Move.from_uci("e7e5"), inventory)
    promoted = chess.Board("3qk3/8/8/8/8/8/8/4K3 w - - 0 1")
    other = chess.Board("3rk3/8/8/8/8/8/8/4K3 w - - 0 1")
    with pytest.raises(InventoryError, match=r"^the inventory has black queen on d8, the game has black rook$"):
        stock(promoted).check_against(other)


def transfer(name: str, source: Place, target: Place) -> Transfer:
    return Transfer(name, Kind.KING, Colour.WHITE, source, target)


@pytest.mark.parametrize(
    ("step", "message"),
    [
        (transfer("white-king", _place("e1"), _place("e8")), "white-king cannot go to e8: black-king stands there"),
        (transfer("white-king", _place("e2"), _place("e3")), "white-king should stand on e2, but nothing does"),
        (transfer("white-king", _place("e8"), _place("e3")), "white-king should stand on e8, but black-king does"),
    ],
)
def test_transfers_that_do_not_fit_are_bugs(step: Transfer, message: str) -> None:
    inventory = stock(chess.Board(KINGS))
    with pytest.raises(InventoryError, match=f"^{message}$"):
        inventory.moved(step)
    ply = Ply("Kx", "e1e8", MoveKind.QUIET, Colour.WHITE, (step,))
    with pytest.raises(InventoryError, match=f"^{message}$"):
        inventory.after(ply)


def test_a_transfer_to_a_place_that_is_not_there_is_refused() -> None:
    inventory = stock(chess.Board(KINGS))
    with pytest.raises(ValueError, match=r"^there is no place R25: trays are L1 to L24 and R1 to R24$"):
        inventory.moved(transfer("white-king", _place("e1"), Place("R", 24)))


def test_an_inventory_has_one_piece_a_place_and_one_place_a_name() -> None:
    king = PieceSpec("white-king", Kind.KING, Colour.WHITE, _place("e1"))
    queen = PieceSpec("white-queen", Kind.QUEEN, Colour.WHITE, _place("e1"))
    with pytest.raises(InventoryError, match=r"^white-queen and white-king both stand on e1$"):
        Inventory.of([king, queen], TABLE)
    twin = PieceSpec("white-king", Kind.KING, Colour.WHITE, _place("e2"))
    with pytest.raises(InventoryError, match=r"^two pieces are named white-king$"):
        Inventory.of([king, twin], TABLE)
    with pytest.raises(ValueError, match=r"^there is no place X1: "):
        Inventory.of([PieceSpec("white-king", Kind.KING, Colour.WHITE, Place("X", 0))], TABLE)


def test_full_trays_are_a_bug() -> None:
    inventory = stock(chess.Board(KINGS))
    with pytest.raises(InventoryError, match=r"^all 48 places of the trays are taken$"):
        inventory.nearest_free(_place("e1"))


def test_finding_pieces_by_name() -> None:
    inventory = stock(chess.Board())
    assert str(inventory.find("black-king").place) == "e8"
    with pytest.raises(InventoryError, match=r"^there is no piece named white-dragon$"):
        inventory.find("white-dragon")


def test_expected_lists_every_piece_by_place() -> None:
    board = chess.Board()
    inventory = stock(board)
    ply = transfers(board, board.parse_san("e4"), inventory)
    after = expected(inventory.after(ply))
    assert list(after) == sorted(after)
    assert len(after) == 50
    assert after[_place("e4")] == PieceSpec("white-pawn-e", Kind.PAWN, Colour.WHITE, _place("e4"))
    assert all(place == piece.place for place, piece in after.items())
    assert expected(inventory)[_place("e2")].name == "white-pawn-e"  # the one before is as it was


def test_an_inventory_cannot_be_changed() -> None:
    inventory = stock(chess.Board())
    with pytest.raises(TypeError):
        del inventory.standing[_place("e2")]  # type: ignore[attr-defined]  # the point of the test


@pytest.mark.parametrize(
    ("fen", "uci", "kind"),
    [
        (chess.STARTING_FEN, "e2e4", "quiet"),
        ("4k3/8/8/3p4/4P3/8/8/4K3 w - - 0 1", "e4d5", "capture"),
        ("4k3/8/8/8/8/8/8/R3K3 w Q - 0 1", "e1c1", "castling"),
        ("4k3/8/8/3pP3/8/8/8/4K3 w - d6 0 1", "e5d6", "en_passant"),
        ("k2r4/4P3/8/8/8/8/8/4K3 w - - 0 1", "e7d8q", "promotion"),
    ],
)
def test_kinds_are_written_as_in_the_contract(fen: str, uci: str, kind: str) -> None:
    assert str(move_kind(chess.Board(fen), chess.Move.from_uci(uci))) == kind
