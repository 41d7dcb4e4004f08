"""What a look at the board says, as far as it matters for putting it right."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final

import chess
import numpy as np
from numpy.typing import NDArray

from app.pieces.inventory import Inventory
from app.pieces.layout import PIECE_TYPES
from app.pieces.order import Point
from hardware.piece_set import PIECE_SHAPES, Colour, Kind
from hardware.table import PieceSpec, square_place
from vision.pieces.centres import Centre
from vision.pieces.placement_faults import Fault, FaultKind
from vision.reading.appearance import BLACK, EMPTY, WHITE
from vision.reading.piece_kinds import SPREAD

States = NDArray[np.intp]
Heights = NDArray[np.float64]
Chances = Mapping[Kind, float]
"""How likely each kind is; they add up to 1."""
FLUKE: Final = 1e-3
"""No kind is less likely than this, whatever its height: depth pictures have spots that are wrong."""
KNOWN: Final = 0.9
"""A kind as likely as this is known."""
HEIGHTS: Final[Mapping[Kind, float]] = MappingProxyType({kind: shape.height for kind, shape in PIECE_SHAPES.items()})
"""Of the kinds [m]."""
_LIKELY: Final = 0.5
"""Of a piece's height: it is what it should be."""
_COLOURS: Final[Mapping[int, Colour]] = MappingProxyType({WHITE: Colour.WHITE, BLACK: Colour.BLACK})


@dataclass(frozen=True, slots=True)
class BoardObservation:
    """What the camera sees.

    Attributes:
        looks: colour of what stands on squares (0 = a1 … 63 = h8), None: nothing does. Squares that are left out look
            as they should.
        places: where pieces stand that are not known to stand at the centre of their square, board frame (x, y) [m], by
            square.
        fallen: squares on which a piece lies.
        unclear: squares on which something is that looks like no piece, or not like the one that should stand there.
        kinds: how likely what stands on a square is of each kind; left out: unknown.
        faults: what is not as it should be.
    """

    looks: Mapping[int, Colour | None]
    places: Mapping[int, Point] = field(default_factory=dict)
    fallen: frozenset[int] = frozenset()
    unclear: frozenset[int] = frozenset()
    kinds: Mapping[int, Chances] = field(default_factory=dict)
    faults: tuple[Fault, ...] = ()

    @classmethod
    def of(
        cls,
        expected: Inventory,
        states: NDArray[np.intp],
        faults: Sequence[Fault] = (),
        centres: Mapping[int, Centre] = MappingProxyType({}),
        kinds: Mapping[int, Chances] = MappingProxyType({}),
    ) -> BoardObservation:
        """From what ``vision`` reports.

        A fault is about the piece that should stand on its square. Where another colour stands, or, by its height,
        another kind, a fault says nothing.

        Args:
            expected: what should stand where.
            states: what each square looks like, shape (64,), of ``Evidence.read``.
            faults: of ``examine_board`` against what should stand there.
            centres: of ``piece_centres`` by square, of what does stand there; they count for more than faults.
            kinds: as of the class.
        """
        looks = {square: _COLOURS.get(int(state)) for square, state in enumerate(states.tolist())}
        places, fallen, unclear = dict[int, Point](), set[int](), set[int]()
        for fault in faults:
            here, square = looks[fault.square], fault.square
            piece = expected.at(square_place(square))
            alike = piece is not None and here is piece.colour and _may_be(piece.kind, kinds.get(square, {}))
            if fault.kind is FaultKind.OFF_CENTRE and alike and fault.place is not None:
                places[square] = fault.place
            elif fault.kind is FaultKind.FALLEN and (alike or here is None):
                fallen.add(square)
            elif (fault.kind is FaultKind.MISSING and alike) or (fault.kind is FaultKind.FOREIGN and here is None):
                unclear.add(square)
        places |= {square: (c.x, c.y) for square, c in centres.items() if c.upright and looks[square] is not None}
        return cls(looks, places, frozenset(fallen), frozenset(unclear), dict(kinds), tuple(faults))


def _may_be(kind: Kind, chances: Chances) -> bool:
    return all(chance < KNOWN for other, chance in chances.items() if other is not kind)


def kinds_by_height(height: float, known: Mapping[Kind, float] = HEIGHTS, spread: float = SPREAD) -> dict[Kind, float]:
    """How likely each kind is by how high a piece looks [m], all of them being as likely before.

    A height that none has says nothing: a piece that lies is lower than all. ``known`` has the height of each kind as
    the camera sees it, and ``spread`` is the standard deviation of one, both [m].
    """
    likely = {kind: max(math.exp(-0.5 * ((height - of) / spread) ** 2), FLUKE) for kind, of in known.items()}
    whole = math.fsum(likely.values())
    return {kind: chance / whole for kind, chance in likely.items()}


def on_board(inventory: Inventory) -> dict[int, PieceSpec]:
    """The pieces that stand on squares, by square."""
    return {piece.place.index: piece for piece in inventory if piece.place.on_board}


def shown_position(stands: Inventory) -> chess.Board:
    """The position that an inventory has on the board; whose move it is, nobody can see."""
    board = chess.Board(None)
    for square, piece in on_board(stands).items():
        board.set_piece_at(square, chess.Piece(PIECE_TYPES[piece.kind], piece.colour is Colour.WHITE))
    return board


def kinds_on_squares(
    stands: Inventory, states: States, top: Heights | None, known: Mapping[Kind, float]
) -> dict[int, Chances]:
    """How likely what stands on a square is of each kind by its height: of what stands where it should not, and of
    what is as high as it should be, so that it is not taken for something else.
    """
    if top is None:
        return {}
    expected = np.full(64, EMPTY)
    for square, piece in on_board(stands).items():
        expected[square] = WHITE if piece.colour is Colour.WHITE else BLACK
    strange = np.flatnonzero((states != expected) & (states != EMPTY) & (top > 0.0))
    kinds: dict[int, Chances] = {int(square): kinds_by_height(float(top[square]), known) for square in strange}
    for square, piece in on_board(stands).items():
        if square not in kinds and states[square] != EMPTY and top[square] > 0.0:
            chances = kinds_by_height(float(top[square]), known)
            if chances[piece.kind] >= _LIKELY:
                kinds[square] = chances
    return kinds


def squares_of(faults: Sequence[Fault]) -> tuple[int, ...]:
    """That faults are about."""
    return tuple(fault.square for fault in faults)


def sentence_of(faults: Sequence[Fault]) -> str:
    """What faults are, for people; empty if there are none."""
    return "; ".join(fault.sentence for fault in faults)
