"""What the arm does by itself about pieces that were found lying or standing elsewhere."""

from __future__ import annotations

from collections.abc import Set

import chess
import pytest

from app.execution.fallen import Fallen, unaided, with_missing
from app.execution.repair import Repair
from app.pieces.inventory import Inventory, Transfer
from app.pieces.layout import start_layout
from hardware.table import Place, TableSettings
from vision.pieces.lying_or_standing import MisplacedPiece
from vision.pieces.poses import Pose

TABLE = TableSettings()
STANDS = Inventory.of(start_layout(chess.Board("4k3/8/8/3p4/4P3/8/8/4K3 w - - 0 1"), TABLE), TABLE)


FREE = next(str(place) for place in TABLE.tray_places() if STANDS.at(place) is None)


def place(text: str) -> Place:
    return Place.parse(text)


def stray(square: str, at: str, off: float = 0.0, yaw: float | None = None) -> MisplacedPiece:
    piece = STANDS.at(place(square))
    assert piece is not None
    x, y = TABLE.xy(place(at))
    return MisplacedPiece(piece, piece.place, Pose(x + off, y, yaw))


def decided(
    *found: MisplacedPiece,
    missing: Set[str],
    wanted: Inventory = STANDS,
    handled: Set[str] = frozenset(),
    people: bool = False,
) -> Repair | Fallen | None:
    return unaided({place(one) for one in missing}, STANDS, wanted, lambda: list(found), handled, people=people)


def moved(piece: MisplacedPiece, to: str) -> Inventory:
    return STANDS.moved(Transfer.of(piece.piece, place(to)))


def test_where_nothing_is_missing_nobody_searches() -> None:
    assert unaided(set(), STANDS, STANDS, lambda: pytest.fail("searched"), set(), people=False) is None


def test_what_lies_comes_first() -> None:
    lies, stands = stray("d5", "d4", yaw=0.3), stray("e4", "f4")
    step = decided(stands, lies, missing={"d5", "e4"})
    assert isinstance(step, Fallen)
    assert step.misplaced == (stands, lies)


def test_who_stands_something_up_knows_what_else_stands_elsewhere() -> None:
    """Else its place in the tray counts as taken, and where it stands as free."""
    lies, spare = stray("d5", "d4", yaw=0.3), next(piece for piece in STANDS if piece.place.in_tray)
    elsewhere = MisplacedPiece(spare, spare.place, Pose(*TABLE.xy(place("g2"))))
    step = decided(elsewhere, lies, missing={"d5"})
    assert isinstance(step, Fallen)
    assert step.misplaced == (elsewhere, lies)


def test_a_lost_piece_goes_straight_to_where_it_shall_stand() -> None:
    pawn = stray("e4", "f4", 0.004)
    step = decided(pawn, missing={"e4"}, wanted=moved(pawn, "e5"))
    assert isinstance(step, Repair)
    (transfer,) = step.transfers
    assert (str(transfer.source), str(transfer.target)) == ("e4", "e5")
    assert transfer.seen == (pawn.pose.x, pawn.pose.y)


def test_if_another_piece_stands_there_yet_it_goes_back_to_where_it_was() -> None:
    """A capture of which the captured piece is still on the board."""
    pawn, captured = stray("e4", "f4"), stray("d5", "d5")
    wanted = moved(captured, FREE).moved(Transfer.of(pawn.piece, place("d5")))
    step = decided(pawn, missing={"e4"}, wanted=wanted)
    assert isinstance(step, Repair)
    assert [str(one.target) for one in step.transfers] == ["e4"]


def test_what_was_lost_over_its_place_in_a_tray_is_believed_there() -> None:
    captured = stray("d5", FREE, 0.003)
    step = decided(captured, missing={"d5"}, wanted=moved(captured, FREE))
    assert isinstance(step, Repair)
    assert step.transfers == ()
    assert str(step.believed.find(captured.piece.name).place) == FREE


def test_pieces_of_trays_are_left_alone_unless_the_arm_has_failed_there() -> None:
    spare = next(piece for piece in STANDS if piece.place.in_tray)
    x, y = TABLE.xy(spare.place)
    off = MisplacedPiece(spare, spare.place, Pose(x + 0.008, y))
    assert decided(off, missing={"e4"}) is None
    step = decided(off, missing={str(spare.place)})
    assert isinstance(step, Repair)
    assert [one.name for one in step.transfers] == [spare.name]


@pytest.mark.parametrize(
    ("at", "off", "handled", "carried"),
    [("f6", 0.0, False, False), ("f6", 0.0, True, True), ("e4", 0.008, False, True)],
)
def test_what_people_may_have_moved_is_not_known_by_its_looks(
    at: str, off: float, handled: bool, carried: bool
) -> None:
    pawn = stray("e4", at, off)
    step = decided(pawn, missing={"e4"}, handled={pawn.piece.name} if handled else set(), people=True)
    assert (step is not None) is carried


def test_some_of_what_is_missing_is_carried_as_it_may_hide_the_rest() -> None:
    step = decided(stray("e4", "f4"), missing={"e4", "d5"})
    assert isinstance(step, Repair)
    assert [str(one.source) for one in step.transfers] == ["e4"]


def test_what_is_in_nobodys_sight_stays_in_the_books() -> None:
    gone, there = stray("e4", "e4").piece, stray("d5", "d5").piece
    less = Inventory.of([piece for piece in STANDS if piece.name != gone.name], TABLE)
    assert dict(with_missing(less, STANDS, STANDS).standing) == dict(STANDS.standing)
    taken = less.moved(Transfer.of(there, place("e4")))
    books = with_missing(taken, STANDS, moved(stray("e4", "e4"), "e5"))
    assert str(books.find(gone.name).place) == "e5"
