"""Pieces that the arm has lost, until each is carried again or the board is right; and which of them are in boxes."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence, Set
from typing import Final

from app.execution.interruption import CarryFailed, Loss
from app.execution.repair.by_sight import Whereabouts
from app.pieces.inventory import Inventory
from app.pieces.order import Point
from hardware.table import PieceSpec, Place, square_place
from vision.pieces.lying_or_standing import MisplacedPiece
from vision.pieces.placement_faults import Fault, FaultKind

SAME_SPOT: Final = 0.02
"""What lies no further from where something lay is that [m]: less than a piece's height, more than a look errs."""


class LostPieces:
    """What the arm has lost, or not got."""

    def __init__(self) -> None:
        self._names = set[str]()
        self._boxed = set[str]()
        """Those in the boxes that they were for."""
        self._astray = dict[str, bool]()
        """Those that were to go into boxes, and are not known to be in there; and whether they were on their way, and
        nothing had been dropped into the box since the board was last right."""
        self._held: frozenset[str] | None = None
        """Those that were in boxes when the board was last right; None: it has not been, as far as is known."""
        self._missed = Counter[str]()
        """How often the fingers have felt nothing where a piece was taken to be, since the board was last right."""
        self._strange: Sequence[Point] = ()
        """Where something lay that may be a piece, when it was last looked for."""
        self._no_pieces: Sequence[Point] = ()
        """Where something lies that is none, as somebody has said."""

    @property
    def names(self) -> Set[str]:
        """Of all."""
        return self._names

    def doubt(self, names: Iterable[str]) -> None:
        """Another program may have lost these: whether they are where it believed them to be is to be seen."""
        self._names.update(names)

    def note(self, failure: CarryFailed) -> None:
        """One more."""
        name, target = failure.transfer.name, failure.transfer.target
        self.forget({name})
        self._names.add(name)
        self._missed[name] += failure.loss is Loss.NOT_GRIPPED
        if failure.over_box:
            self._boxed.add(name)
        elif target.in_box:
            alone = self._held is not None and not any(
                piece.place.zone == target.zone for piece in self.dropped(failure.inventory)
            )
            self._astray[name] = alone and failure.loss is Loss.LOST  # what was not gripped may have been knocked over

    def forget(self, names: Iterable[str]) -> None:
        """That these were lost: they have been carried since, or somebody has brought them back."""
        for name in names:
            self._names.discard(name)
            self._boxed.discard(name)
            self._astray.pop(name, None)

    def all_right(self, stands: Inventory) -> None:
        """Nothing is lost any more; this is what stands where."""
        self.forget(tuple(self._names))
        self._missed.clear()
        self._held = frozenset(piece.name for piece in stands if piece.place.in_box)

    def dropped(self, stands: Inventory) -> list[PieceSpec]:
        """Those let go over boxes since the board was last right: one may have bounced out."""
        return [piece for piece in stands if piece.place.in_box and piece.name not in (self._held or ())]

    def unknown(self, strange: Sequence[Point]) -> tuple[Point, ...]:
        """Of the spots [m] where something lies that may be a piece, those where nobody has said that it is none."""
        self._strange = strange
        # what has been taken away may not excuse what comes to lie there later
        self._no_pieces = [spot for spot in strange if _near(spot, self._no_pieces)]
        return tuple(spot for spot in strange if spot not in self._no_pieces)

    def told(self, names: Iterable[str], stands: Inventory) -> None:
        """Somebody has been asked for these, and says that they are where they should be."""
        names = tuple(names)
        self.forget(names)
        self._missed.clear()
        self._held = (self._held or frozenset()).union(names)
        if not self.dropped(stands):
            self._no_pieces = self._strange

    def look_into_boxes(self, wanted: Inventory, has_fallen_in: Callable[[Place], bool]) -> None:
        """Of those on their way to a box one may be seen to have come into it, where nothing else has been dropped into
        it or lost over it.

        Args:
            wanted: what shall stand where.
            has_fallen_in: whether something has come into the box of a place since the board was last right.
        """
        for name, alone in tuple(self._astray.items()):
            goal = wanted.find(name).place
            same = [one for one in (*self._boxed, *self._astray) if wanted.find(one).place.zone == goal.zone]
            if alone and goal.in_box and same == [name] and has_fallen_in(goal):
                self._boxed.add(name)
                del self._astray[name]

    def in_boxes(
        self, seen: Whereabouts, stands: Inventory, wanted: Inventory, faults: Iterable[Fault]
    ) -> list[PieceSpec]:
        """Of those in their boxes, the ones that are still on the board as far as is believed."""
        empty = {square_place(fault.square) for fault in faults if fault.kind is FaultKind.MISSING}
        boxed = [stands.find(name) for name in sorted(self._boxed - seen.standing.keys())]
        return [
            one for one in boxed if (one.place in empty or one in seen.missing) and wanted.find(one.name).place.in_box
        ]

    def not_in_trays(
        self, stands: Inventory, seen: Whereabouts | None, misplaced: Callable[[], Iterable[MisplacedPiece]]
    ) -> set[str]:
        """Names of those that are believed in trays, and are neither seen there nor ``misplaced``: what something hides
        may be there, unless the fingers have felt nothing twice.
        """
        if seen is None:
            return set()
        hidden, places = seen.hidden, {name: stands.find(name).place for name in self._names - seen.standing.keys()}
        gone = {
            name for name, place in places.items()
            if place.in_tray and (place not in hidden or self._missed[name] > 1)
        }  # fmt: skip
        return gone - {one.piece.name for one in misplaced()} if gone else gone

    def astray(self, stands: Inventory) -> list[PieceSpec]:
        """Those that are believed in boxes, and were not seen to come into them."""
        return [one for name in sorted(self._astray) if (one := stands.find(name)).place.in_box]


def _near(spot: Point, others: Iterable[Point]) -> bool:
    return any(math.dist(spot, other) <= SAME_SPOT for other in others)
