"""What the arm does by itself about pieces that were found lying, or standing elsewhere; pure functions."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass, replace
from typing import Final

import chess
import numpy as np

from app.execution.repair import Ask, Repair, Whereabouts
from app.execution.repair.diagnosis import missing_ask
from app.pieces.inventory import Inventory, Transfer
from app.pieces.order import Point, rearrange
from hardware.table import PieceSpec, Place, TableSettings, square_place
from vision.pieces.lying_or_standing import MisplacedPiece
from vision.pieces.misplaced import PUT_BY
from vision.pieces.placement_faults import TOLERANCE, Fault, FaultKind

MOST_TRIES: Final = 6
"""To stand one piece up: the fingers may slip, and what lies askew lies otherwise after each."""
SWUNG_AFTER: Final = 2
"""Each time that it did not come up so often, it is pushed first, so that it lies otherwise."""


@dataclass(frozen=True, slots=True)
class Fallen:
    """Pieces lie on the board; with all that are out of place."""

    misplaced: tuple[MisplacedPiece, ...]


@dataclass(frozen=True, slots=True)
class Leaning:
    """Something lies, and nobody can say how.

    Attributes:
        spots: where it is, board frame [m].
        fallen: places whose pieces do not stand.
        misplaced: pieces that were found elsewhere.
        otherwise: what is to be done where nothing can be done about it.
        towards: where it is to be pushed to [rad]; None: that does not matter.
        itself: what lies there, if that was found.
    """

    spots: tuple[Point, ...]
    fallen: frozenset[Place]
    misplaced: tuple[MisplacedPiece, ...]
    otherwise: Ask
    towards: float | None = None
    itself: MisplacedPiece | None = None


def unaided(
    missing: Set[Place],
    stands: Inventory,
    wanted: Inventory,
    misplaced: Callable[[], list[MisplacedPiece]],
    handled: Set[str],
    *,
    people: bool,
) -> Repair | Fallen | None:
    """What the arm does where something lies; or where some of what is missing stands in sight.

    Args:
        missing: where pieces should stand and do not, or may not.
        stands: what should stand where.
        wanted: what shall stand where.
        misplaced: searches for what lies or stands elsewhere; called only where something is missing.
        handled: names of pieces that the arm has stood up or pushed.
        people: somebody may have moved pieces; then only ones that lie, that are still on their square or that the arm
            has handled, are known to be what they look like.
    """
    if not missing:
        return None
    # where exactly a piece stands in its place in a tray matters once the arm has failed to take it
    found = [
        one for one in misplaced()
        if one.lies or one.target.on_board or one.target in missing or one.piece.name in handled
        or not _is_there(one, one.target, stands.table, PUT_BY)
    ]  # fmt: skip
    if any(one.lies for one in found):
        return Fallen(tuple(found))
    # of what belongs in a box, and stands about, depth says more
    found = [one for one in found if not one.target.in_box]
    # what hides a piece from one look may not from the next
    right = [one for one in found if _is_there(one, one.target, stands.table)]
    found = [one for one in found if one not in right]
    if people:
        found = [
            one for one in found if one.piece.name in handled or _is_on(one, one.target, stands.table)
        ]  # fmt: skip
    # what is still missing may be hidden by what is carried now
    if missing.isdisjoint(one.target for one in found):
        return None
    goals = {one.piece.name: _goal(one, stands, wanted) for one in found}
    there = [one.piece.name for one in found if _is_there(one, goals[one.piece.name], stands.table)]
    believed = Inventory.of(
        [replace(piece, place=goals[piece.name]) if piece.name in there else piece for piece in stands], stands.table
    )
    transfers = tuple(
        Transfer.of(one.piece, goals[one.piece.name], (one.pose.x, one.pose.y))
        for one in found
        if one.piece.name not in there
    )
    return Repair(believed, transfers, "the arm carries the pieces it has found to their places")


def leaning(
    faults: Sequence[Fault],
    seen: Whereabouts | None,
    misplaced: Callable[[], Sequence[MisplacedPiece]],
    stands: Inventory,
    otherwise: Repair | Ask,
) -> Leaning | Repair | Ask:
    """Whether a person would be asked for what lies and was not found as such: it leans on something."""
    fallen = frozenset(square_place(fault.square) for fault in faults if fault.kind is FaultKind.FALLEN)
    spots = tuple(stands.table.xy(place) for place in fallen) if seen is None else seen.lying
    if isinstance(otherwise, Repair) or not spots:
        return otherwise
    return Leaning(spots, fallen, tuple(misplaced()), otherwise)


def bounced_out(
    spots: Sequence[Point], dropped: Sequence[PieceSpec], misplaced: Sequence[MisplacedPiece], stands: Inventory
) -> Leaning:
    """Something lies at spots [m], and is not found to be one of the pieces that were let go over their boxes."""
    ask = missing_ask(dropped)
    where = " and ".join(dict.fromkeys(whereabout(spot, stands.table) for spot in spots))
    sentence = f"something lies {where} that may have bounced out of a box: if so, {ask.sentence.partition(': ')[2]}"
    return Leaning(tuple(spots), frozenset(), tuple(misplaced), replace(ask, sentence=sentence))


def continued(stands: Inventory, wanted: Inventory, gone: Set[str], astray: Sequence[PieceSpec]) -> Repair | Ask | None:
    """Where the board shows what it should: what is still to be carried, then what a person has to bring.

    Args:
        stands: what stands where.
        wanted: what shall.
        gone: names of pieces that are not where they should be.
        astray: those that are believed in boxes, and may not be there.
    """
    there = stands.without(gone)
    transfers = rearrange(there, wanted.without(gone))
    missing = [*astray, *map(wanted.find, sorted(gone))]
    ask = missing_ask(missing) if missing else None
    return Repair(there, transfers, "the arm continues", ask) if transfers else ask


def whereabout(at: Point, table: TableSettings) -> str:
    """Where a point of the board frame [m] is, for people."""
    half = 4.0 * table.square
    if max(map(abs, at)) > half:
        return "beside the board"
    file, rank = (int((c + half) / table.square) for c in at)
    return f"on {square_place(chess.square(min(file, 7), min(rank, 7)))}"


def with_missing(stands: Inventory, before: Inventory, wanted: Inventory, but: Set[Place] = frozenset()) -> Inventory:
    """With the pieces that are in nobody's sight, where they were, or wherever there is room for them; not on some
    places.
    """
    there = {piece.name for piece in stands}
    for piece in before:
        if piece.name in there:
            continue
        places = (piece.place, wanted.find(piece.name).place, *stands.table.tray_places())
        free = next(place for place in places if place not in but and stands.at(place) is None)
        stands = Inventory.of((*stands, replace(piece, place=free)), stands.table)
    return stands


def _goal(one: MisplacedPiece, stands: Inventory, wanted: Inventory) -> Place:
    """Where a piece that was found goes: to where it shall stand, if that is free; else to where it should be now."""
    goal = wanted.find(one.piece.name).place
    return goal if stands.at(goal) is None or goal == one.target else one.target


def _is_on(one: MisplacedPiece, square: Place, table: TableSettings) -> bool:
    """Whether it stands on that square, wherever there."""
    off = np.subtract((one.pose.x, one.pose.y), table.xy(square))
    return float(np.abs(off).max()) <= 0.5 * table.square


def _is_there(one: MisplacedPiece, goal: Place, table: TableSettings, within: float = TOLERANCE) -> bool:
    """Whether it stands where it goes already: what the fingers lost over a tray often does."""
    return not goal.in_box and math.dist((one.pose.x, one.pose.y), table.xy(goal)) <= within
