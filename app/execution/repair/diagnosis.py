"""From what should stand on the board and what is seen there to what the arm does about it, and what people must do."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from typing import Final

import chess

from app.execution.repair.belief import Belief, believe, doubted
from app.execution.repair.observed import KNOWN, BoardObservation
from app.pieces.inventory import Inventory, Transfer
from app.pieces.order import Point, rearrange
from hardware.piece_set import Colour, Kind
from hardware.table import PieceSpec, square_place
from vision.pieces.placement_faults import TOLERANCE

SEEN_WITHIN: Final = 0.75
"""A piece stands no farther than this off the centre of the square where it is seen, along either axis [its sides]."""


@dataclass(frozen=True, slots=True)
class Ask:
    """What a person has to do, as the arm cannot.

    Attributes:
        sentence: for that person.
        squares: that it is about, 0 = a1 … 63 = h8.
        names: of pieces that are to be brought back.
    """

    sentence: str
    squares: tuple[int, ...]
    names: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Repair:
    """What the arm does.

    Attributes:
        believed: what stands where now. Without pieces that are no longer on the table.
        transfers: in order of execution; none: nothing is wrong.
        sentence: for people.
        rest: what a person has to do afterwards.
    """

    believed: Inventory
    transfers: tuple[Transfer, ...]
    sentence: str
    rest: Ask | None = None


def mend(
    expected: Inventory,
    observation: BoardObservation,
    board: chess.Board | None = None,
    *,
    tolerance: float = TOLERANCE,
    rest: Point = (0.0, 0.0),
) -> Repair | Ask:
    """Decide what to do about a board that is not as it should be.

    The arm carries pieces only once all that stands on the board is known: what lies there, or may be taller than it is
    thought to be, is in its way. Pieces that are merely missing are not, and are asked for afterwards.

    Args:
        expected: what should stand where.
        observation: what is seen.
        board: the position that should be there: two moves in a row that look like one piece carried off are told from
            it; None: they are not thought of.
        tolerance: pieces farther off the centre of their square are set right [m].
        rest: where the arm comes from.

    Raises:
        ValueError: a piece was seen outside of its square.
    """
    beliefs = _beliefs(expected, observation, board)
    gone = tuple(piece for belief in beliefs.values() for piece in belief.gone)
    if asks := _asks(expected, observation, beliefs):
        asks += [missing_ask(gone)] if gone else []
        return Ask("; ".join(ask.sentence for ask in asks), tuple(sorted({at for ask in asks for at in ask.squares})))
    there = {name: square_place(square) for belief in beliefs.values() for name, square in belief.standing.items()}
    left = tuple(piece for piece in expected if piece not in gone)
    believed = Inventory.of(
        (PieceSpec(p.name, p.kind, p.colour, there.get(p.name, p.place)) for p in left), expected.table
    )
    return repair_towards(believed, expected, observation, tolerance=tolerance, rest=rest)


def repair_towards(
    believed: Inventory,
    wanted: Inventory,
    observation: BoardObservation,
    *,
    tolerance: float = TOLERANCE,
    rest: Point = (0.0, 0.0),
) -> Repair | Ask:
    """Plan how the arm gets from what is believed to stand there (missing pieces are left out) to what is wanted.

    The places of the observation may come from another look, at the pieces where they are believed to stand;
    ``tolerance`` and ``rest`` are as of :func:`mend`.

    Raises:
        PieceBoxed: a piece that lies in a box is wanted elsewhere.
        ValueError: a piece was seen outside of its square.
    """
    there = {piece.name for piece in believed}
    gone = tuple(piece for piece in wanted if piece.name not in there)
    target = Inventory.of((piece for piece in wanted if piece.name in there), wanted.table)
    seen = _seen(believed, target, observation, tolerance, {piece.colour for piece in gone})
    aside = tuple(place for place in map(square_place, range(64)) if wanted.at(place) is None)
    transfers = rearrange(believed, target, seen=seen, aside=aside, rest=rest)
    missing = missing_ask(gone) if gone else None
    if missing is not None and not transfers:
        return missing
    return Repair(believed, transfers, what_is_done(believed, target, transfers), missing)


def _beliefs(expected: Inventory, observation: BoardObservation, board: chess.Board | None) -> dict[Colour, Belief]:
    looks = {square: _looks(square, expected, observation) for square in range(64)}
    kinds = {square: chances for square, chances in observation.kinds.items() if square not in observation.fallen}
    beliefs = dict[Colour, Belief]()
    for colour in Colour:
        pieces = [p for p in expected if p.place.on_board and p.colour is colour]
        squares = [square for square, look in looks.items() if look is colour]
        beliefs[colour] = believe(colour, pieces, squares, kinds, expected.table)
    if board is None or not any(piece.place.index != square for piece, square in _standing(expected, beliefs)):
        return beliefs
    believed = {square: piece.kind for piece, square in _standing(expected, beliefs)}
    doubts = doubted(board, looks, believed, kinds)
    return {
        colour: replace(belief, doubtful=tuple(sorted({*belief.doubtful, *(s for s in doubts if looks[s] is colour)})))
        for colour, belief in beliefs.items()
    }


def _standing(expected: Inventory, beliefs: Mapping[Colour, Belief]) -> Iterator[tuple[PieceSpec, int]]:
    """Pieces that are believed to stand on the board, and where."""
    for belief in beliefs.values():
        for name, square in belief.standing.items():
            yield expected.find(name), square


def _looks(square: int, expected: Inventory, observation: BoardObservation) -> Colour | None:
    """What stands on a square; what lies there counts as the piece that should stand there."""
    piece = expected.at(square_place(square))
    should = None if piece is None else piece.colour
    if square in observation.fallen or square in observation.unclear:
        return should
    return observation.looks.get(square, should)


def _seen(
    believed: Inventory, target: Inventory, observation: BoardObservation, tolerance: float, lacking: Set[Colour]
) -> dict[str, Point]:
    """Where pieces stand that the arm takes, by name."""
    seen, most = dict[str, Point](), SEEN_WITHIN * believed.table.square
    for square, (x, y) in observation.places.items():
        piece = believed.at(square_place(square))
        if piece is None:
            continue
        dx, dy = (a - b for a, b in zip((x, y), believed.table.xy(piece.place), strict=True))
        if max(abs(dx), abs(dy)) > most:
            raise ValueError(
                f"what stands on {piece.place} was seen ({1e3 * dx:.0f}, {1e3 * dy:.0f}) mm from its centre, outside "
                "that square: name the square on which it was seen"
            )
        stays = target.find(piece.name).place == piece.place
        # where a piece is missing, one that was touched may be it, having taken another of its own side
        if stays and (
            math.hypot(dx, dy) <= tolerance or (piece.colour in lacking and not _is_known(piece, observation))
        ):
            continue
        seen[piece.name] = (x, y)
    return seen


def _is_known(piece: PieceSpec, observation: BoardObservation) -> bool:
    chances = observation.kinds.get(piece.place.index, {})
    return chances.get(piece.kind, 0.0) >= KNOWN


# sentences


def _asks(expected: Inventory, observation: BoardObservation, beliefs: Mapping[Colour, Belief]) -> list[Ask]:
    """What must be done by people before the arm may move."""
    asks = [_fallen(square, expected) for square in sorted(observation.fallen)]
    asks += [_unclear(square, expected) for square in sorted(observation.unclear - observation.fallen)]
    for colour, belief in beliefs.items():
        doubtful = [square for square in belief.doubtful if square not in belief.extra]
        if doubtful:
            asks.append(_doubtful(doubtful, colour, belief, expected))
        if belief.extra:
            asks.append(_extra(belief.extra, colour))
    return asks


def _fallen(square: int, expected: Inventory) -> Ask:
    place, piece = square_place(square), expected.at(square_place(square))
    if piece is None:
        return Ask(f"a piece lies on {place}, which the arm cannot stand up: take it off the board", (square,))
    return Ask(
        f"the {_name(piece)} on {place} has fallen, and the arm cannot stand it up: stand it on {place}", (square,)
    )


def _unclear(square: int, expected: Inventory) -> Ask:
    place, piece = square_place(square), expected.at(square_place(square))
    if piece is None:
        return Ask(f"something lies on {place}: take it away", (square,))
    return Ask(f"it is not clear what stands on {place}: put the {_name(piece)} there", (square,))


def _doubtful(doubtful: Sequence[int], colour: Colour, belief: Belief, expected: Inventory) -> Ask:
    """What should stand on the squares in doubt, and on those from which pieces may have come."""
    pieces = [piece for piece in expected if piece.place.on_board and piece.colour is colour]
    away = {p.place.index for p in pieces if belief.standing.get(p.name, p.place.index) != p.place.index}
    squares = sorted({*doubtful, *away})
    here = {square: expected.at(square_place(square)) for square in squares}
    puts = [f"the {_name(piece)} on {square_place(square)}" for square, piece in here.items() if piece is not None]
    empty = [str(square_place(square)) for square, piece in here.items() if piece is None]
    puts += [f"nothing on {_list(empty)}"] if empty else []
    return Ask(
        f"it is not clear which {colour} piece{'s stand' if len(doubtful) > 1 else ' stands'} on "
        f"{_list([str(square_place(square)) for square in doubtful])}: put {_list(puts)}, or say what stands there, as "
        f"'{square_place(doubtful[0])} {colour} {Kind.KNIGHT}'",
        tuple(squares),
    )


def _extra(squares: Sequence[int], colour: Colour) -> Ask:
    places = [str(square_place(square)) for square in squares]
    verb, pieces, them = ("stands", "piece", "it") if len(squares) == 1 else ("stand", "pieces", "them")
    article = "a " if len(squares) == 1 else ""
    return Ask(
        f"{article}{colour} {pieces} {verb} on {_list(places)} that should not be on the board: take {them} off",
        tuple(squares),
    )


def missing_ask(gone: Sequence[PieceSpec]) -> Ask:
    """A person has to bring these back; their places say where to."""
    places = [(piece, f"into its box ({piece.place})" if piece.place.in_box else f"on {piece.place}") for piece in gone]
    puts = _list([f"the {_name(piece)} {place}" for piece, place in sorted(places, key=lambda one: one[0].place)])
    what = f"{len(gone)} pieces are" if len(gone) > 1 else "a piece is"
    squares = sorted(piece.place.index for piece in gone if piece.place.on_board)
    return Ask(f"{what} missing: put {puts}", tuple(squares), tuple(piece.name for piece in gone))


def what_is_done(believed: Inventory, target: Inventory, transfers: Sequence[Transfer]) -> str:
    """For people."""
    if not transfers:
        return "the board is as it should be"
    done = []
    for name in dict.fromkeys(transfer.name for transfer in transfers):
        piece, goal = believed.find(name), target.find(name).place
        done.append(
            f"sets the {_name(piece)} right on {goal}"
            if piece.place == goal
            else f"puts the {_name(piece)} back from {piece.place} on {goal}"
        )
    return f"the arm {_list(done)}"


def _name(piece: PieceSpec) -> str:
    return f"{piece.colour} {piece.kind}"


def _list(words: Sequence[str]) -> str:
    *first, last = words
    return f"{', '.join(first)} and {last}" if first else last
