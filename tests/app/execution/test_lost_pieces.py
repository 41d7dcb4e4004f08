"""Which of the pieces that the arm has lost are in boxes."""

from __future__ import annotations

import chess
import pytest

from app.execution.interruption import CarryFailed, Loss
from app.execution.repair.lost_pieces import LostPieces
from app.pieces.inventory import Inventory, Transfer
from app.pieces.layout import start_layout
from hardware.table import Captured, Place, TableSettings, square_place

TABLE = TableSettings(captured=Captured.BOX)
START = Inventory.of(start_layout(chess.Board(), TABLE), TABLE)
BOX, SAME_BOX, OTHER_BOX = Place.parse("BL1"), Place.parse("BL2"), Place.parse("BR1")


@pytest.fixture
def pieces() -> LostPieces:
    """Of a game whose board was right before anything was lost."""
    made = LostPieces()
    made.all_right(START)
    return made


def lose(
    pieces: LostPieces, square: int, target: Place, stands: Inventory = START, loss: Loss = Loss.LOST, *,
    over: bool = False,
) -> str:  # fmt: skip
    """Lose what stands on a square; its name."""
    piece = stands.at(square_place(square))
    assert piece is not None
    pieces.note(CarryFailed(loss, Transfer.of(piece, target), 0, stands, "lost", over))
    return piece.name


def after(**goals: Place) -> Inventory:
    """What is believed, or wanted, once pieces of squares are in their boxes."""
    stands = START
    for square, goal in goals.items():
        piece = stands.at(Place.parse(square))
        assert piece is not None
        stands = stands.moved(Transfer.of(piece, goal))
    return stands


def astray(pieces: LostPieces, stands: Inventory, *, seen: bool) -> list[str]:
    pieces.look_into_boxes(stands, lambda place: seen)
    return [piece.name for piece in pieces.astray(stands)]


@pytest.mark.parametrize("seen", [False, True])
def test_what_is_lost_on_its_way_is_astray_unless_its_box_holds_more(pieces: LostPieces, seen: bool) -> None:
    name = lose(pieces, chess.D7, BOX)
    assert astray(pieces, after(d7=BOX), seen=seen) == ([] if seen else [name])
    assert astray(pieces, after(d7=BOX), seen=False) == ([] if seen else [name]), "what was seen once is known"


def test_what_is_lost_over_its_box_is_not_astray(pieces: LostPieces) -> None:
    lose(pieces, chess.D7, BOX, over=True)
    assert astray(pieces, after(d7=BOX), seen=False) == []


def test_what_never_was_on_its_way_is_not_what_came_into_the_box(pieces: LostPieces) -> None:
    name = lose(pieces, chess.E7, BOX, loss=Loss.NOT_GRIPPED)
    assert astray(pieces, after(), seen=True) == [], "it is still believed on its square"
    assert astray(pieces, after(e7=BOX), seen=True) == [name]


def test_one_thing_in_a_box_is_not_two(pieces: LostPieces) -> None:
    names = [lose(pieces, chess.D7, BOX), lose(pieces, chess.E7, SAME_BOX)]
    lose(pieces, chess.F7, OTHER_BOX)
    assert astray(pieces, after(d7=BOX, e7=SAME_BOX, f7=OTHER_BOX), seen=True) == names


def test_what_was_lost_over_a_box_may_be_what_is_seen_in_it(pieces: LostPieces) -> None:
    lose(pieces, chess.D7, BOX, over=True)
    name = lose(pieces, chess.E7, SAME_BOX)
    assert astray(pieces, after(d7=BOX, e7=SAME_BOX), seen=True) == [name]


def test_what_was_dropped_there_meanwhile_may_be_what_is_seen(pieces: LostPieces) -> None:
    """As of a pawn that captures and is promoted: two go into a box in one job, and the second is lost."""
    name = lose(pieces, chess.E7, SAME_BOX, after(d7=BOX))
    assert astray(pieces, after(d7=BOX, e7=SAME_BOX), seen=True) == [name]


def test_nothing_is_known_of_boxes_before_the_board_was_right_once() -> None:
    pieces = LostPieces()
    name = lose(pieces, chess.D7, BOX)
    assert astray(pieces, after(d7=BOX), seen=True) == [name]


def test_what_is_carried_again_or_brought_back_is_lost_no_more(pieces: LostPieces) -> None:
    name = lose(pieces, chess.D7, BOX)
    pieces.forget([name])
    assert not pieces.names
    assert astray(pieces, after(d7=BOX), seen=False) == []


def test_what_was_let_go_over_a_box_may_have_bounced_out_until_the_board_is_right(pieces: LostPieces) -> None:
    stands = after(d7=BOX)
    assert [piece.place for piece in pieces.dropped(stands)] == [BOX]
    pieces.told([pieces.dropped(stands)[0].name], stands)
    assert not pieces.dropped(stands), "somebody has looked"
    assert [piece.place for piece in pieces.dropped(after(d7=BOX, e7=SAME_BOX))] == [SAME_BOX]
    pieces.all_right(after(d7=BOX, e7=SAME_BOX))
    assert not pieces.dropped(after(d7=BOX, e7=SAME_BOX))


def test_after_a_start_all_that_boxes_should_hold_may_lie_about() -> None:
    assert len(LostPieces().dropped(after(d7=BOX, e7=SAME_BOX))) == 2


def test_what_somebody_says_is_no_piece_is_known_as_long_as_it_lies_there(pieces: LostPieces) -> None:
    stands, cork, other = after(d7=BOX), (0.1, 0.02), (0.1, 0.05)
    dropped = [piece.name for piece in pieces.dropped(stands)]
    assert pieces.unknown((cork, other)) == (cork, other)
    pieces.told((), stands)
    assert pieces.unknown((cork,)) == (cork,), "they were asked for something else"
    pieces.told(dropped, stands)
    nearly = (0.109, 0.02)
    assert pieces.unknown((nearly, other)) == (other,)
    assert pieces.unknown((nearly,)) == ()
    assert pieces.unknown(()) == ()
    assert pieces.unknown((cork,)) == (cork,), "it was away, and what lies there now may be a piece"
