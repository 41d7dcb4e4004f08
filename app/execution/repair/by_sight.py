"""Which piece is which of those that depth shows standing: everything that is seen, explained by the fewest acts.

All pieces of the game and all that is seen are given to each other at once, on the board, beside it, between squares.
It costs nothing for a piece to stand where it was, something to have been carried, and more to be nowhere in sight; and
a height that is not that of its kind costs as much as it is unlikely. Heights are held against those of the pieces that
stand where they should, in the same picture: what light and camera do to one they do to all.

This is sure, or nothing: where a sighting might be another kind, or belongs to nobody, ``belief`` and people have to
say. Pure.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace
from itertools import product
from types import MappingProxyType
from typing import Final

import numpy as np

from app.execution.repair.diagnosis import SEEN_WITHIN, Ask, Repair, missing_ask, what_is_done
from app.execution.repair.observed import HEIGHTS
from app.pieces.inventory import Inventory
from app.pieces.order import Point, rearrange
from hardware.piece_set import Colour, Kind, Look
from hardware.table import PieceSpec, Place, square_place
from vision.arrays import cheapest_pairs
from vision.standing.sightings import Sighting, Sightings, kind_cost

_HOME: Final = 0.016
"""A piece no further from the middle of its place has not been carried [m]: less than half a square."""
_NUDGED: Final = 0.0085
"""One in a tray that stands further off is put right [m]: fingers find it up to 10 mm off, and 1.5 are for sight."""
ABOUT: Final = 0.024
"""What stands, or lies, so near to the middle of a square may be that square's piece [m]."""
LOWER: Final = 0.005
"""What lies is lower than the same piece standing by more than this [m]: a pawn 21 mm, not 31."""
_CARRIED: Final = 3.0
"""Cost of a piece on another place: one in twenty."""
_FARTHER: Final = 1.0
"""… and of each metre [1/m]: of two alike pieces each went to the nearer place."""
_NOWHERE: Final = 7.0
"""… of a piece that should be in sight and is not."""
_LIES: Final = 2.0
"""… where something lies that may be it."""
_UNSEEN: Final = 1.0
"""… of one whose place is hidden."""
_NOBODYS: Final = 9.0
"""… of something that stands there and is no piece of the game."""
_FALLS_OUT: Final = 2.0
"""… besides, of one that lay in a box: few bounce out of it."""
_LOOKS_THE_SAME: Final = 2.3
"""Of another piece that looks just like the one before, within 1.7 mm of where that stood: a hand hits three in ten so
well, and outlines tell two of three of those (`vision.pieces.swapped`): one in ten."""
_OTHER_SIDE: Final = 20.0
"""Of evidence for the other side, see ``Sighting.white``."""
_BEHIND: Final = 0.05
"""Of what colours say, where something else hides most of a piece."""
_CONTRADICTED: Final = 30.0
"""Of what a person says is something else."""
_LEAST_APART: Final = 8.0
"""By so much in lightness, of 255, both sides differ in a picture in which that says which is which, however dark it
is: most of either side's pieces are between 2 and 5 in the darkest ones that were drawn, or from 21 on; …"""
_TOLD_APART: Final = 0.5
"""… and so much of that lies between the lightest quarter of the dark ones and the darkest of the light ones; …"""
_CLEARLY: Final = 0.25
"""… of what is no further from one side's, as a share of the difference (of 30 pieces in 100 pictures with doubled
randomisation whose colours spoke for the other side 28 were, and none of 2,200 whose colours were right)."""
SURE: Final = 2.9
"""What is believed is so much likelier than any other kind, as a logarithm: 18 times."""
_IMPOSSIBLE: Final = 1e6


@dataclass(frozen=True, slots=True)
class Whereabouts:
    """What stands where.

    Attributes:
        standing: of each piece that is seen, by name: where, board frame [m].
        moved: names of those that were carried.
        missing: pieces of the board that do not stand in sight, though nothing hides their places.
        nudged: names of those out of play that were pushed off their places, and have not been carried.
        hidden: places of which nobody can tell whether a piece stands there.
        lying: where something does not stand, or more than one thing is, board frame [m]; they are some of the missing
            pieces.
    """

    standing: Mapping[str, Point]
    moved: frozenset[str]
    missing: tuple[PieceSpec, ...]
    lying: tuple[Point, ...] = ()
    nudged: frozenset[str] = frozenset()
    hidden: frozenset[Place] = frozenset()

    def fallen_beside(self, stands: Inventory) -> set[Place]:
        """Places in trays whose pieces are not seen to stand, where something lies."""
        if not self.lying:
            return set()
        return {piece.place for piece in stands if piece.place.in_tray and piece.name not in self.standing}


def whereabouts(
    stands: Inventory,
    seen: Sightings,
    heights: Mapping[Kind, float] = HEIGHTS,
    untouched: Set[int] = frozenset(),
    told: Mapping[Place, Look] = MappingProxyType({}),
) -> Whereabouts | None:
    """Find out which piece is which; None: that is not sure.

    Args:
        stands: what should stand where.
        seen: what does.
        heights: of the kinds as this camera has seen them before [m].
        untouched: squares whose pieces look just as when they were known to stand there.
        told: what a person says stands on squares.
    """
    seen = replace(seen, all=_less_of_colours(stands, seen))
    seen = replace(seen, hidden=_hidden(stands, seen))
    tops = heights_here(stands, seen.all, heights)
    pieces, sightings, standing = _beyond_doubt(stands, seen, tops)
    pieces += boxed(stands)
    lying = tuple((one.x, one.y) for one in sightings if not one.upright)
    sightings = [one for one in sightings if one.upright]
    nowhere = _LIES if lying else _NOWHERE
    cost = _costs(stands, pieces, sightings, seen.hidden, tops, nowhere)
    cost[: len(pieces), : len(sightings)] += _strangers(stands, pieces, sightings, untouched)
    cost[: len(pieces), : len(sightings)] += _against_words(stands, pieces, sightings, told)
    rows, columns = cheapest_pairs(cost)
    chosen = dict(zip(rows.tolist(), columns.tolist(), strict=True))
    if any(column < len(sightings) for row, column in chosen.items() if row >= len(pieces)):
        return None  # something that is no piece of the game
    if not _is_sure(cost, pieces, chosen, len(sightings)):
        return None
    missing = list[PieceSpec]()
    for row, piece in enumerate(pieces):
        if chosen[row] < len(sightings):
            standing[piece.name] = sightings[chosen[row]].x, sightings[chosen[row]].y
        elif piece.place.on_board and piece.place not in seen.hidden:  # where else it is out of play matters to nobody
            missing.append(piece)
    off = {name: math.dist(at, stands.table.xy(stands.find(name).place)) for name, at in standing.items()}
    moved = frozenset(name for name, away in off.items() if away > _HOME)
    nudged = frozenset(
        name for name, away in off.items() if _NUDGED < away <= _HOME and stands.find(name).place.in_tray
    )
    return Whereabouts(standing, moved, tuple(missing), lying, nudged, seen.hidden)


def boxed(stands: Inventory) -> list[PieceSpec]:
    """Of pieces in boxes, which nobody sees, one of each look: it may have bounced out of there."""
    looks = {(piece.colour, piece.kind): piece for piece in stands if piece.place.in_box}
    return list(looks.values())


def _less_of_colours(stands: Inventory, seen: Sightings) -> tuple[Sighting, ...]:
    """Colours seen at a place that something hides are as likely of that; and those of a thing as dark, or as light, as
    the other side's pieces are of what shows beside it: they say nothing.
    """
    places = [stands.table.xy(place) for place in seen.hidden]
    (low, light, _), (_, dark, high) = (_lightness(stands, seen, side) for side in (Colour.WHITE, Colour.BLACK))
    apart = light - dark > _LEAST_APART and low - high > _TOLD_APART * (light - dark)

    def share(one: Sighting) -> float:
        lit = (one.lightness - dark) / (light - dark) if apart else math.nan
        if (one.white > 0.0 and lit < _CLEARLY) or (one.white < 0.0 and lit > 1.0 - _CLEARLY):  # NaN: neither
            return 0.0
        return _BEHIND if any(math.dist((one.x, one.y), at) < _HOME for at in places) else 1.0

    return tuple(replace(one, white=share(one) * one.white) for one in seen.all)


def _lightness(stands: Inventory, seen: Sightings, side: Colour) -> tuple[float, float, float]:
    """Of most things at the homes of a side's pieces: quartiles and median; NaN where too few are seen."""
    homes = [stands.table.xy(piece.place) for piece in stands if piece.colour is side and piece.place.on_board]
    at_home = [one.lightness for one in seen.all for at in homes if math.dist((one.x, one.y), at) < _HOME]
    known = [lightness for lightness in at_home if not math.isnan(lightness)]
    if len(known) <= 2:
        return math.nan, math.nan, math.nan
    low, middle, high = np.quantile(known, (0.25, 0.5, 0.75)).tolist()
    return low, middle, high


def _hidden(stands: Inventory, seen: Sightings) -> frozenset[Place]:
    """Hidden places on which nothing else stands: that would not hide a piece there, but be where it was."""
    spots = [(one.x, one.y) for one in seen.all]
    return frozenset(
        place for place in seen.hidden
        if min((math.dist(stands.table.xy(place), spot) for spot in spots), default=math.inf) > _HOME
    )  # fmt: skip


def _beyond_doubt(
    stands: Inventory, seen: Sightings, tops: Mapping[Kind, float]
) -> tuple[list[PieceSpec], list[Sighting], dict[str, Point]]:
    """Pieces and sightings that are to be given to each other, and where those stand that are not: what is seen in a
    tray, perhaps cut by the picture's edge, is the piece that was put there, unless it is as low as if it lay.
    """
    table, sightings, standing = stands.table, list(seen.all), dict[str, Point]()
    pieces = [piece for piece in stands if not piece.place.in_box]
    for one in seen.all:
        nearest = min(pieces, key=lambda piece: math.dist((one.x, one.y), table.xy(piece.place)))
        lies = not one.upright and one.height < tops[nearest.kind] - LOWER
        at_home = math.dist((one.x, one.y), table.xy(nearest.place)) <= _HOME
        if nearest.place.in_tray and at_home and not lies and nearest.name not in standing:
            standing[nearest.name] = one.x, one.y
            sightings.remove(one)
    return [piece for piece in pieces if piece.name not in standing], sightings, standing


def repair_by_sight(
    stands: Inventory, wanted: Inventory, found: Whereabouts, off: Mapping[int, Point],
    fallen_in: Set[str] = frozenset(),
) -> Repair | Ask | None:  # fmt: skip
    """What the arm does so that all stands as wanted; None: it cannot be said on which places pieces stand.

    Args:
        stands: what should stand where.
        wanted: what shall.
        found: what does.
        off: where pieces stand that are on their squares, but off the centres, by square, board frame [m].
        fallen_in: names of pieces that have fallen into the boxes that they were for, if they are nowhere in sight.
    """
    believed = placed(stands, found)
    if believed is None:
        return None
    gone = [wanted.find(piece.name) for piece in found.missing]
    fell_in = [piece for piece in gone if piece.place.in_box and piece.name in fallen_in]
    believed = Inventory.of((*believed, *fell_in), stands.table)
    gone = [piece for piece in gone if piece not in fell_in]
    there = {piece.name for piece in believed}
    target = Inventory.of((piece for piece in wanted if piece.name in there), wanted.table)
    seen = {name: found.standing[name] for name in found.moved | found.nudged}
    seen |= {piece.name: off[piece.place.index] for piece in believed
             if piece.place.on_board and piece.place.index in off and piece.name not in seen}  # fmt: skip
    aside = tuple(place for place in map(square_place, range(64)) if wanted.at(place) is None)
    transfers = rearrange(believed, target, seen=seen, aside=aside)
    rest = missing_ask(gone) if gone else None
    if not transfers and len(gone) == len(found.missing):
        return rest
    return Repair(believed, transfers, what_is_done(believed, target, transfers), rest)


def placed(stands: Inventory, found: Whereabouts) -> Inventory | None:
    """On the nearest places that nobody else has; without the missing ones."""
    table, places = stands.table, dict[str, Place]()
    gone = {piece.name for piece in found.missing}
    taken = {piece.place for piece in stands if piece.name not in gone and piece.name not in found.moved}
    every = (*map(square_place, range(64)), *table.tray_places())
    for name in sorted(found.moved):
        at = found.standing[name]
        near = sorted((math.dist(at, table.xy(place)), place) for place in every if place not in taken)
        off, place = near[0]
        if off > SEEN_WITHIN * table.square:  # beside all places: as if it had been pushed off its own
            place = stands.find(name).place
            if place in taken or place.in_box:
                return None
        places[name] = place
        taken.add(place)
    return Inventory.of(
        (replace(piece, place=places.get(piece.name, piece.place)) for piece in stands if piece.name not in gone), table
    )


def heights_here(stands: Inventory, seen: Sequence[Sighting], before: Mapping[Kind, float]) -> dict[Kind, float]:
    """Of the kinds as they look in this picture: of those that stand at home, or as before and as much off as those."""
    tops = defaultdict[Kind, list[float]](list)
    for piece in (piece for piece in stands if piece.place.on_board):
        x, y = stands.table.xy(piece.place)
        tops[piece.kind] += [one.height for one in seen if math.dist((one.x, one.y), (x, y)) < _HOME]
    known = {kind: float(np.median(some)) for kind, some in tops.items() if len(some) > 2}
    usual = float(np.median([height - before[kind] for kind, height in known.items()])) if known else 0.0
    return {kind: known.get(kind, before[kind] + usual) for kind in Kind}


def _costs(
    stands: Inventory, pieces: Sequence[PieceSpec], seen: Sequence[Sighting], hidden: Set[Place],
    heights: Mapping[Kind, float], nowhere: float,
) -> np.ndarray:  # fmt: skip
    """Rows: the pieces, then nobody for each sighting. Columns: the sightings, then nowhere for each piece."""
    cost = np.full((len(pieces) + len(seen), len(seen) + len(pieces)), _IMPOSSIBLE)
    cost[len(pieces) :, len(seen) :] = 0.0
    for (i, piece), (j, one) in product(enumerate(pieces), enumerate(seen)):
        away = math.dist((one.x, one.y), stands.table.xy(piece.place))
        other = max(0.0, -one.white if piece.colour is Colour.WHITE else one.white)
        cost[i, j] = (
            kind_cost(piece.kind, one, heights[piece.kind])
            + _OTHER_SIDE * other
            + (_FALLS_OUT if piece.place.in_box else 0.0)
            + (0.0 if away <= _HOME else _CARRIED + _FARTHER * away)
        )
    for i, piece in enumerate(pieces):
        unseen = _UNSEEN if piece.place in hidden else nowhere
        cost[i, len(seen) + i] = 0.0 if piece.place.in_box else unseen
    for j in range(len(seen)):
        cost[len(pieces) + j, j] = _NOBODYS
    return cost


def _against_words(
    stands: Inventory, pieces: Sequence[PieceSpec], seen: Sequence[Sighting], told: Mapping[Place, Look]
) -> np.ndarray:
    """What it costs to believe something else than a person says, (pieces, sightings)."""
    cost = np.zeros((len(pieces), len(seen)))
    for (place, said), (j, one) in product(told.items(), enumerate(seen)):
        if math.dist((one.x, one.y), stands.table.xy(place)) < ABOUT:
            cost[:, j] = [0.0 if (piece.colour, piece.kind) == said else _CONTRADICTED for piece in pieces]
    return cost


def _strangers(
    stands: Inventory, pieces: Sequence[PieceSpec], seen: Sequence[Sighting], untouched: Set[int]
) -> np.ndarray:
    """What it costs besides that another kind stands where a piece looks as it did, (pieces, sightings)."""
    cost = np.zeros((len(pieces), len(seen)))
    for j, one in enumerate(seen):
        for square in untouched:
            there = stands.at(square_place(square))
            if there is not None and math.dist((one.x, one.y), stands.table.xy(there.place)) <= _HOME:
                cost[[not _alike(piece, there) for piece in pieces], j] = _LOOKS_THE_SAME
    return cost


def _is_sure(cost: np.ndarray, pieces: Sequence[PieceSpec], chosen: Mapping[int, int], seen: int) -> bool:
    """Whether nothing else would do nearly as well, with another kind on any of what is seen."""
    cheapest = sum(float(cost[row, column]) for row, column in chosen.items())
    for row, column in chosen.items():
        if column >= seen or row >= len(pieces):
            continue
        other = cost.copy()
        other[[i for i, piece in enumerate(pieces) if _alike(piece, pieces[row])], column] = _IMPOSSIBLE
        rows, columns = cheapest_pairs(other)
        if float(other[rows, columns].sum()) - cheapest < SURE:
            return False
    return True


def _alike(one: PieceSpec, other: PieceSpec) -> bool:
    return one.kind is other.kind and one.colour is other.colour
