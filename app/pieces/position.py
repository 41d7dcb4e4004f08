"""Which piece stands on which square of a position, and where the others go: the fewest transfers, then short ways.

Pieces of one kind and colour are alike. Those that stand right stay; the others are assigned by the shortest ways in
all. Rings in which pieces block each other cost a transfer each, and are opened where alike pieces can change roles.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import chess
import numpy as np

from app import UserError
from app.pieces.inventory import Inventory, Transfer
from app.pieces.layout import SPARES, colour_of, kind_of, physical_set
from app.pieces.order import rearrange, rings_of
from hardware.piece_set import Colour, Kind
from hardware.table import PieceSpec, Place, TableSettings, square_place
from vision.arrays import Array, cheapest_pairs

Ways = dict[str, tuple[Place, Place]]
"""Source and target of each piece that moves, by name."""
_MOVED: Final = 10.0
"""What a transfer counts, whatever its way: more than all ways of a plan [m]."""
_INNER: Final = 2.0
"""What a metre counts by which a place of a tray is nearer to the board than its outer column: the inner places stay
free for captures."""
_PROMOTION: Final = 0.5
"""What a metre counts between a piece that pawns promote to and the rank where they do."""
_PROMOTION_CORNER: Final = {Colour.WHITE: chess.A8, Colour.BLACK: chess.A1}
_VACATED: Final = 1.0
"""What it counts to go to a place that is not free yet [m]."""
_BOXED: Final = 5.0
"""What it counts to be dropped into a box, from which nothing comes back [m]."""


class Lack(NamedTuple):
    """Pieces of one kind that a position needs and that are not at hand.

    Attributes:
        kind: which.
        colour: which.
        needed: by the position.
        there: on board and trays.
        boxed: names of those that lie in boxes.
    """

    kind: Kind
    colour: Colour
    needed: int
    there: int
    boxed: tuple[str, ...]


class PiecesMissing(UserError):
    """Board and trays do not hold the pieces that a position needs."""

    def __init__(self, lacks: Sequence[Lack]) -> None:
        needs = ", and ".join(
            f"{lack.needed} {lack.colour} {lack.kind}{'s' * (lack.needed != 1)}, "
            + (f"only {lack.there} stand{'s' * (lack.there == 1)}" if lack.there else "none stands")
            + " on board and trays"
            for lack in lacks
        )
        super().__init__(f"the position needs {needs}: {_remedy(lacks)}")
        self.lacks = tuple(lacks)


class PlacesMissing(UserError):
    """Trays and boxes do not hold what has to leave the board."""

    def __init__(self, leaving: int, free: int) -> None:
        super().__init__(
            f"{leaving} piece{'s' * (leaving != 1)} must leave the board, and trays and boxes have "
            f"{free or 'no'} free place{'s' * (free != 1)}: choose a position with at least {leaving - free} more of "
            "the pieces on the board, or enlarge the trays of the table"
        )
        self.leaving = leaving
        self.free = free


def set_up(now: Inventory, board: chess.BaseBoard) -> tuple[Transfer, ...]:
    """Plan the transfers that put any position on the board, also one that no game leads to.

    Raises:
        PiecesMissing: a piece that the position needs is neither on the board nor in a tray.
        PlacesMissing: the trays do not hold what has to leave the board.
        NowhereAside: see :func:`rearrange`.
    """
    return rearrange(now, arranged(now, board))


def arranged(now: Inventory, board: chess.BaseBoard) -> Inventory:
    """The inventory with a position on the board that takes the fewest transfers; what lies in boxes stays there.

    Raises:
        PiecesMissing: as of :func:`set_up`.
        PlacesMissing: as of :func:`set_up`.
    """
    wanted = _wanted(now, board)
    goals, leaving = dict[str, Place](), list[PieceSpec]()
    for look, pieces in _alike(now).items():
        chosen = _assigned(now, pieces, wanted.get(look, []))
        goals |= chosen
        leaving += [piece for piece in pieces if piece.name not in chosen and piece.place.on_board]
    goals |= _left(now, goals, leaving)
    here = {piece.name: piece for piece in now}
    ways = {name: (here[name].place, place) for name, place in goals.items() if place != here[name].place}
    goals |= {name: place for name, (_, place) in _opened(now, ways).items()}
    return Inventory.of(
        (PieceSpec(p.name, p.kind, p.colour, goals.get(p.name, p.place)) for p in here.values()), now.table
    )


Look = tuple[Colour, Kind]


def _wanted(now: Inventory, board: chess.BaseBoard) -> dict[Look, list[Place]]:
    """Squares by what shall stand there, all of which is at hand."""
    wanted = defaultdict[Look, list[Place]](list)
    for square, piece in sorted(board.piece_map().items()):
        wanted[colour_of(piece.color), kind_of(piece)].append(square_place(square))
    alike, lacks = _alike(now), list[Lack]()
    for (colour, kind), squares in wanted.items():
        there = len(alike.get((colour, kind), ()))
        if there < len(squares):
            boxed = tuple(p.name for p in now if p.place.in_box and (p.colour, p.kind) == (colour, kind))
            lacks.append(Lack(kind, colour, len(squares), there, boxed))
    if lacks:
        raise PiecesMissing(lacks)
    return dict(wanted)


def _alike(now: Inventory) -> dict[Look, list[PieceSpec]]:
    """Pieces that the arm can take, by what they look like."""
    alike = defaultdict[Look, list[PieceSpec]](list)
    for piece in now:
        if not piece.place.in_box:
            alike[piece.colour, piece.kind].append(piece)
    return dict(alike)


def _assigned(now: Inventory, pieces: Sequence[PieceSpec], squares: Sequence[Place]) -> dict[str, Place]:
    """A piece for each square, out of at least as many that are alike."""
    if not squares:
        return {}
    places = [piece.place for piece in pieces]
    cost = np.zeros((len(pieces), len(pieces)))  # the columns after the squares' are for pieces without one
    cost[:, : len(squares)] = _MOVED + _ways(now.table, places, squares)
    cost[:, : len(squares)][[[place == square for square in squares] for place in places]] = 0.0
    aside = _MOVED + _ways(now.table, places, now.table.tray_places()).min(axis=1)
    cost[:, len(squares) :] = np.where([place.on_board for place in places], aside, 0.0)[:, None]
    rows, columns = cheapest_pairs(cost)
    pairs = zip(rows.tolist(), columns.tolist(), strict=True)
    return {pieces[i].name: squares[j] for i, j in pairs if j < len(squares)}


def _ways(table: TableSettings, starts: Sequence[Place], ends: Sequence[Place]) -> Array:
    """Lengths of all ways, shape (starts, ends) [m]; to a micrometre, so that equal ones tie on every machine."""
    here, there = (np.array([table.xy(place) for place in places]) for places in (starts, ends))
    ways: Array = np.linalg.norm(here[:, None] - there, axis=2).round(6)
    return ways


def _left(now: Inventory, goals: Mapping[str, Place], leaving: Sequence[PieceSpec]) -> dict[str, Place]:
    """Places beside the board for pieces that leave it."""
    if not leaving:
        return {}
    stay = {piece.place for piece in now if piece.name not in goals}
    places = [place for place in (*now.table.tray_places(), *now.table.box_places()) if place not in stay]
    if len(places) < len(leaving):
        raise PlacesMissing(len(leaving), len(places))
    rows, columns = cheapest_pairs(_beside(now, leaving, places))
    return {leaving[i].name: places[j] for i, j in zip(rows.tolist(), columns.tolist(), strict=True)}


def _beside(now: Inventory, pieces: Sequence[PieceSpec], places: Sequence[Place]) -> Array:
    """What it counts for pieces to leave the board for places: the way, and what the next game will say to it, shape
    (pieces, places) [m].
    """
    table, x_y = now.table, np.array([now.table.xy(place) for place in places])
    boxed = np.array([place.in_box for place in places])
    rounds = np.array([table.box_round(place) if place.in_box else 0 for place in places])
    outer = max(abs(table.xy(place)[0]) for place in table.tray_places())
    tray = _INNER * (outer - np.abs(x_y[:, 0])) + _VACATED * np.array([now.at(place) is not None for place in places])
    promotion = np.array([table.xy(square_place(_PROMOTION_CORNER[piece.colour]))[1] for piece in pieces])
    serves = np.array([piece.kind in SPARES for piece in pieces])  # what pawns promote to is missed more in a box
    near = _PROMOTION * np.abs(x_y[:, 1] - promotion[:, None]) * serves[:, None]
    cost: Array = np.where(boxed, _BOXED * (1.0 + rounds + serves[:, None]), tray + near)
    return cost + _ways(table, [piece.place for piece in pieces], places)


def _opened(now: Inventory, ways: Ways) -> Ways:
    """The same moves with fewer rings: two alike pieces of which one is in a ring change targets, as that joins it to
    what the other one waits for. Of all such pairs the one whose ways get least longer.
    """
    ways, looks = dict(ways), {piece.name: (piece.colour, piece.kind) for piece in now}
    while True:
        pairs = [
            (name, other)
            for ring in rings_of(ways)
            for name in ring
            for other in ways
            if other not in ring and looks[other] == looks[name]
        ]
        if not pairs:
            return ways

        def longer(pair: tuple[str, str]) -> tuple[float, tuple[str, str]]:
            (a, goal), (b, other) = (ways[name] for name in pair)
            lengths = now.travel(a, other), now.travel(b, goal), -now.travel(a, goal), -now.travel(b, other)
            return math.fsum(lengths), pair

        one, two = min(pairs, key=longer)
        (a, goal), (b, other) = ways[one], ways[two]
        ways[one], ways[two] = (a, other), (b, goal)


def _remedy(lacks: Sequence[Lack]) -> str:
    """What to do: boxed pieces are taken out by hand; more than the set holds, no table can show."""
    boxed = [name for lack in lacks for name in lack.boxed]
    held = Counter((piece.colour, piece.kind) for piece in physical_set())
    if any(lack.needed > held[lack.colour, lack.kind] for lack in lacks):
        most = " and ".join(f"{held[lack.colour, lack.kind]} {lack.colour} {lack.kind}s" for lack in lacks)
        return f"choose a position with at most {most}"
    if boxed:
        lie, them = ("lies in a box", "it") if len(boxed) == 1 else ("lie in the boxes", "what is missing")
        return f"{', '.join(boxed)} {lie}, which the arm cannot reach into: take {them} out by hand"
    return "put the missing pieces on free places of the trays"
