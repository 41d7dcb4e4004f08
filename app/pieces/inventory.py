"""What stands where, and what a ply does about it: the inventory of named pieces, and transfers between places."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from types import MappingProxyType

import chess

from app import UserError
from app.pieces.layout import colour_of, kind_of
from hardware.piece_set import PIECE_SHAPES, Colour, Kind, PieceShape
from hardware.table import Captured, PieceSpec, Place, TableSettings, square_place

_TIE = 6
"""Decimals of a metre to which travel is compared, so that equal distances tie on every machine."""


class InventoryError(RuntimeError):
    """The inventory contradicts the board or a transfer; a bug of the program, not an event of the game."""


class PieceBoxed(UserError):
    """The piece lies in a box, somehow and somewhere: no arm that cannot see it takes it out."""

    def __init__(self, name: str, place: Place) -> None:
        super().__init__(
            f"{name} was dropped into the box ({place}) and lies there in an unknown position: take it out by hand, "
            'or play with captured = "tray", where pieces can be taken back'
        )


class MoveKind(StrEnum):
    """What a move is for the arm; a promotion that captures is a promotion."""

    QUIET = "quiet"
    CAPTURE = "capture"
    CASTLING = "castling"
    EN_PASSANT = "en_passant"
    PROMOTION = "promotion"


class Stage(StrEnum):
    """Parts of a transfer; the arm rests between them."""

    APPROACH = "approach"
    """Over to the piece and down, with open fingers."""
    GRASP = "grasp"
    """The fingers close."""
    CARRY = "carry"
    """Up, over, and down until it stands."""
    RELEASE = "release"
    """The fingers open, and the arm goes to the next piece or home."""
    RETURN = "return"
    """Home, after the last transfer, where that was broken off."""


@dataclass(frozen=True, slots=True)
class Transfer:
    """One piece carried from where it stands to a free place, or set right on its own.

    Attributes:
        name: of the piece.
        kind: of the piece.
        colour: of the piece.
        source: its place.
        target: where it goes; its source again only if it was seen off the centre.
        seen: where it really stands, board frame (x, y) [m]; None: at the centre of its source.
        raised: the fingers take it so much higher than usual, over something that lies beside it [m].
    """

    name: str
    kind: Kind
    colour: Colour
    source: Place
    target: Place
    seen: tuple[float, float] | None = None
    raised: float = 0.0

    @classmethod
    def of(
        cls, piece: PieceSpec, target: Place, seen: tuple[float, float] | None = None, raised: float = 0.0
    ) -> Transfer:
        """Of a piece from where it stands."""
        return cls(piece.name, piece.kind, piece.colour, piece.place, target, seen, raised)

    @property
    def shape(self) -> PieceShape:
        """Of its piece, gripped where the fingers take it."""
        shape = PIECE_SHAPES[self.kind]
        return replace(shape, grip_height=shape.grip_height + self.raised) if self.raised else shape

    def grasped_at(self, table: TableSettings) -> tuple[float, float]:
        """Where the fingers take it, board frame (x, y) [m]."""
        return table.xy(self.source) if self.seen is None else self.seen


@dataclass(frozen=True, slots=True)
class Ply:
    """One move as the arm does it: transfers in the order of execution."""

    san: str
    uci: str
    kind: MoveKind
    colour: Colour
    """The side that moves."""
    transfers: tuple[Transfer, ...]

    def changes(self) -> dict[str, Place]:
        """Where each piece that was touched stands in the end, by name."""
        return {transfer.name: transfer.target for transfer in self.transfers}


@dataclass(frozen=True, slots=True)
class Inventory:
    """Which physical piece stands at which place, on the board and in the trays, or lies in which box.

    A piece's ``place`` is where it stands now, so the pieces of an inventory can start a world in the same state.
    """

    table: TableSettings
    standing: MappingProxyType[Place, PieceSpec]
    """Read-only; build one with :meth:`of`."""

    @classmethod
    def of(cls, pieces: Iterable[PieceSpec], table: TableSettings) -> Inventory:
        """Take stock of pieces, for example of ``layout.start_layout``.

        Raises:
            InventoryError: two pieces share a place or a name.
            ValueError: the table has no such place.
        """
        standing: dict[Place, PieceSpec] = {}
        names: set[str] = set()
        for piece in pieces:
            table.xy(piece.place)
            if piece.place in standing:
                raise InventoryError(f"{piece.name} and {standing[piece.place].name} both stand on {piece.place}")
            if piece.name in names:
                raise InventoryError(f"two pieces are named {piece.name}")
            standing[piece.place] = piece
            names.add(piece.name)
        return cls(table, MappingProxyType(standing))

    def __iter__(self) -> Iterator[PieceSpec]:
        """All pieces, each where it stands now."""
        return iter(self.standing.values())

    def at(self, place: Place) -> PieceSpec | None:
        """The piece at a place, None if it is free."""
        return self.standing.get(place)

    def find(self, name: str) -> PieceSpec:
        """The piece of that name; its ``place`` says where it stands.

        Raises:
            InventoryError: there is no such piece.
        """
        for piece in self:
            if piece.name == name:
                return piece
        raise InventoryError(f"there is no piece named {name}")

    def without(self, names: Collection[str]) -> Inventory:
        """Where all others stand."""
        return Inventory.of((piece for piece in self if piece.name not in names), self.table)

    def spares(self, kind: Kind, colour: Colour) -> tuple[PieceSpec, ...]:
        """Pieces beside the board that can serve for a promotion: spares and captured ones alike, but none in a box."""
        beside = (p for p in self if not p.place.on_board and not p.place.in_box)
        return tuple(p for p in beside if p.kind is kind and p.colour is colour)

    def travel(self, source: Place, target: Place) -> float:
        """Distance between two places in the plane of the table, to a micrometre [m]."""
        return round(math.dist(self.table.xy(source), self.table.xy(target)), _TIE)

    def nearest_free(self, place: Place) -> Place:
        """Where a piece that leaves the board goes from ``place``.

        The free place of the trays with the shortest travel; ties go to the left, then to the lower number. With boxes,
        the drop point with the shortest travel of those that were used least, so that no heap grows.

        Raises:
            InventoryError: all are full (``layout.start_layout`` sees to it that this cannot happen).
        """
        if self.table.captured is Captured.BOX:
            return self._next_drop(place)
        free = [tray for tray in self.table.tray_places() if tray not in self.standing]
        if not free:
            raise InventoryError(f"all {2 * self.table.tray_size} places of the trays are taken")
        return min(free, key=lambda tray: (self.travel(place, tray), tray))

    def _next_drop(self, place: Place) -> Place:
        free = [drop for drop in self.table.box_places() if drop not in self.standing]
        if not free:
            raise InventoryError(f"the boxes are full with {len(self.table.box_places())} pieces")
        return min(free, key=lambda drop: (self.table.box_round(drop), self.travel(place, drop), drop))

    def moved(self, transfer: Transfer) -> Inventory:
        """The inventory after one transfer.

        Raises:
            PieceBoxed: it would be taken out of a box.
            InventoryError: another piece or none stands at the source, or the target is taken: also by the piece
                itself, unless it was seen off the centre and is set right.
        """
        piece = self.at(transfer.source)
        if piece is None or piece.name != transfer.name:
            found = "nothing" if piece is None else piece.name
            raise InventoryError(f"{transfer.name} should stand on {transfer.source}, but {found} does")
        if transfer.source.in_box:
            raise PieceBoxed(transfer.name, transfer.source)
        if transfer.target == transfer.source and transfer.seen is not None:
            return self
        taken = self.at(transfer.target)
        if taken is not None:
            raise InventoryError(f"{transfer.name} cannot go to {transfer.target}: {taken.name} stands there")
        self.table.xy(transfer.target)
        standing = self.standing.copy()
        del standing[transfer.source]
        standing[transfer.target] = replace(piece, place=transfer.target)
        return Inventory(self.table, MappingProxyType(standing))

    def after(self, ply: Ply) -> Inventory:
        """The inventory after all transfers of a ply; raises as ``after_all``."""
        return self.after_all(ply.transfers)

    def after_all(self, transfers: Iterable[Transfer]) -> Inventory:
        """The inventory after some transfers.

        Raises:
            InventoryError: they were not planned for this inventory.
        """
        inventory = self
        for transfer in transfers:
            inventory = inventory.moved(transfer)
        return inventory

    def places(self) -> tuple[Place, ...]:
        """Where pieces can stand: all squares, and the places of the trays."""
        return (*map(square_place, range(64)), *self.table.tray_places())

    def check_against(self, board: chess.Board) -> None:
        """Make sure that every square holds what the game says.

        Raises:
            InventoryError: a square differs; the message names the lowest one.
        """
        here = {p.place.index: f"{p.colour} {p.kind}" for p in self if p.place.on_board}
        game = {sq: f"{colour_of(p.color)} {kind_of(p)}" for sq, p in board.piece_map().items()}
        if here == game:
            return
        square = min(sq for sq in chess.SQUARES if here.get(sq) != game.get(sq))
        raise InventoryError(
            f"the inventory has {here.get(square, 'nothing')} on {chess.square_name(square)}, "
            f"the game has {game.get(square, 'nothing')}"
        )


def expected(inventory: Inventory) -> dict[Place, PieceSpec]:
    """What must be where, for the referee: every occupied place of board, trays and boxes, sorted by place."""
    return {place: inventory.standing[place] for place in sorted(inventory.standing)}
