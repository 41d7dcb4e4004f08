"""A chess move as a simulated person makes it: which piece is taken from where, in which order."""

from __future__ import annotations

import chess

from app.pieces.inventory import Inventory, Transfer
from app.pieces.layout import start_layout
from app.pieces.manipulation import transfers
from app.play.hand_moves import hand_transfers
from hardware.piece_set import Colour, Kind
from hardware.sim.hand.actions import Move
from hardware.table import Place, TableSettings

TABLE = TableSettings()


def inventory_for(board: chess.Board) -> Inventory:
    return Inventory.of(start_layout(board, TABLE), TABLE)


def moves_of(fen: str, uci: str) -> list[tuple[str, str]]:
    """Names of places, for each time the hand takes and puts something."""
    board = chess.Board(fen)
    inventory = inventory_for(board)
    ply = transfers(board, chess.Move.from_uci(uci), inventory)
    at = {TABLE.xy(place): str(place) for place in (*map(_square, range(64)), *TABLE.tray_places())}
    made = [(at[action.start], at[action.to]) for action in hand_transfers(ply.transfers, TABLE)]
    board.push_uci(uci)
    inventory.after(ply).check_against(board)
    return made


def _square(index: int) -> Place:
    return Place("board", index)


def test_a_quiet_move_is_one_piece_moved() -> None:
    assert moves_of(chess.STARTING_FEN, "e2e4") == [("e2", "e4")]


def test_a_captured_piece_leaves_first() -> None:
    (first, away), second = moves_of("rnbqkbnr/ppp1pppp/8/3p4/4P3/8/PPPP1PPP/RNBQKBNR w KQkq - 0 2", "e4d5")
    assert first == "d5"
    assert away[0] in "LR"
    assert second == ("e4", "d5")


def test_in_passing_the_pawn_beside_is_taken_off() -> None:
    (first, _), second = moves_of("rnbqkbnr/ppp2ppp/4p3/3pP3/8/8/PPPP1PPP/RNBQKBNR w KQkq d6 0 3", "e5d6")
    assert (first, second) == ("d5", ("e5", "d6"))


def test_castling_is_king_then_rook() -> None:
    fen = "r3k2r/pppppppp/8/8/8/8/PPPPPPPP/R3K2R w KQkq - 0 1"
    assert moves_of(fen, "e1g1") == [("e1", "g1"), ("h1", "f1")]
    assert moves_of(fen, "e1c1") == [("e1", "c1"), ("a1", "d1")]


def test_a_promoted_pawn_is_replaced_by_a_spare() -> None:
    (pawn, away), (spare, target) = moves_of("4k3/P7/8/8/8/8/8/4K3 w - - 0 1", "a7a8q")
    assert (pawn, target) == ("a7", "a8")
    assert away[0] in "LR"
    assert spare[0] in "LR"


def test_an_illegal_move_can_be_made_on_purpose() -> None:
    wrong = Transfer("white-pawn-e", Kind.PAWN, Colour.WHITE, Place.parse("e2"), Place.parse("e5"))
    assert hand_transfers([wrong], TABLE) == (Move(start=TABLE.xy(wrong.source), to=TABLE.xy(wrong.target)),)
