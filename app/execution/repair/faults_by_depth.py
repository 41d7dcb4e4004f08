"""What is wrong on the board as depth knows it better than outlines: what lies, what stands all the same, what was
exchanged.

Pure; see ``by_sight`` for which piece is which.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Final

from app.execution.repair.by_sight import ABOUT, LOWER, SURE, Whereabouts, heights_here
from app.execution.repair.observed import HEIGHTS
from app.pieces.inventory import Inventory
from hardware.piece_set import PIECE_SHAPES, Colour, Kind
from hardware.table import PieceSpec, square_place
from vision.pieces.placement_faults import Fault, FaultKind, off_centre
from vision.standing.sightings import Sightings, kind_cost

_CENTRED: Final = 0.006
"""One that depth sees so near to its centre, to 2 mm, is none that outlines look for in vain: up to 10 mm off [m]."""
_UNDECIDED: Final = 0.4
"""Less evidence for a side says nothing, see ``Sighting.white``: in the dark, or in light from the side."""


def toppled(stands: Inventory, seen: Sightings) -> Iterator[Fault]:
    """Pieces of the board in whose place something lies, though from afar it may look as if they stood."""
    for piece in stands:
        at = stands.table.xy(piece.place)
        if not piece.place.on_board or piece.place in seen.hidden:
            continue
        near = [one for one in seen.all if math.dist((one.x, one.y), at) < ABOUT]
        low = [one for one in near if not one.upright and one.height < PIECE_SHAPES[piece.kind].height - LOWER]
        if low and len(low) == len(near):
            sentence = f"something lies on {piece.place}, where a {piece.colour} {piece.kind} should stand"
            yield Fault(FaultKind.FALLEN, piece.place.index, sentence, (low[0].x, low[0].y))


def refuted(
    faults: Iterable[Fault], stands: Inventory, seen: Sightings, before: Mapping[Kind, float] = HEIGHTS
) -> frozenset[Fault]:
    """Of these faults those that depth knows better: light from the side may hide an outline, but not a height.

    A piece is said to lie, or to be missing, and on its square there stands one thing, of its kind's height and not of
    the other side; or it is said to stand off its centre, and what stands there is near to that, and nearer.
    ``before`` are heights as of ``whereabouts`` [m].
    """
    heights = heights_here(stands, seen.all, before)

    def is_refuted(fault: Fault, piece: PieceSpec) -> bool:
        at = stands.table.xy(piece.place)
        near = [one for one in seen.all if math.dist((one.x, one.y), at) < ABOUT]
        if len(near) != 1 or not near[0].upright:
            return False
        one, off = near[0], math.dist((near[0].x, near[0].y), at)
        if fault.kind is FaultKind.OFF_CENTRE:
            return fault.place is not None and off <= _CENTRED and off < math.dist((one.x, one.y), fault.place)
        costs = {kind: kind_cost(kind, one, heights[kind]) for kind in Kind}
        mine = one.white if piece.colour is Colour.WHITE else -one.white
        return off <= _CENTRED and mine > -_UNDECIDED and costs[piece.kind] - min(costs.values()) < SURE

    pieces = ((fault, stands.at(square_place(fault.square))) for fault in faults)
    return frozenset(fault for fault, piece in pieces if piece is not None and is_refuted(fault, piece))


def known_better(
    faults: Iterable[Fault], stands: Inventory, seen: Sightings, before: Mapping[Kind, float] = HEIGHTS
) -> tuple[Fault, ...]:
    """Faults as depth knows them: without those that it refutes, and what is off its centre, and far from where its
    outline seems to be, where depth shows it: of what stands behind another piece the outline is half a guess.

    ``before`` as of ``refuted``.
    """
    faults = tuple(faults)
    wrong = refuted(faults, stands, seen, before)

    def known(fault: Fault) -> Fault:
        piece = stands.at(square_place(fault.square))
        if fault.kind is not FaultKind.OFF_CENTRE or fault.place is None or piece is None:
            return fault
        at = stands.table.xy(piece.place)
        near = [(one.x, one.y) for one in seen.all if one.upright and math.dist((one.x, one.y), at) < ABOUT]
        if len(near) != 1 or math.dist(near[0], fault.place) <= _CENTRED:
            return fault
        return off_centre(fault.square, piece, stands.table, near[0])

    return tuple(known(fault) for fault in faults if fault not in wrong)


def exchanged(stands: Inventory, seen: Whereabouts) -> Iterator[Fault]:
    """Pieces that look as if nothing had happened, since each stands where another one was of its side."""
    for name in sorted(seen.moved):
        piece, at = stands.find(name), seen.standing[name]
        if piece.place.on_board:
            squares = map(square_place, range(64))
            there = min(squares, key=lambda place: math.dist(at, stands.table.xy(place)))
            sentence = f"the {piece.colour} {piece.kind} of {piece.place} stands on {there}"
            yield Fault(FaultKind.FOREIGN, piece.place.index, sentence, at)
