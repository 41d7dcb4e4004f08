"""Setting right what does not stand where it should: from what the camera finds to a plan of the arm; pure functions.

One look, one plan: a piece that lies is stood up where it lies, one that stands elsewhere is carried to its place.
Then look again. Pieces that lie come first, so that none is in the way of a carried one. The inventories say what
should stand where, with all misplaced pieces at some place.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence, Set
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import numpy as np

from app.motion.fallen.feel_board import FeelPlan, plan_feeling
from app.motion.fallen.lying import LoosePieces, Lying, crowd_of
from app.motion.fallen.push import Nudge, find_nudge, plan_nudge
from app.motion.fallen.stand_up import plan_upright, room_to_stand_up
from app.motion.finger_opening import fits_around
from app.motion.obstacles import Obstacle
from app.motion.plan import Plan, PlanRefused
from app.motion.planner import Planner
from app.pieces.inventory import Inventory, Transfer
from app.pieces.order import Point
from hardware.parameters import RobotParameters
from hardware.piece_set import PIECE_SHAPES, Kind
from hardware.table import PieceSpec, Place, TableSettings, square_place
from vision.pieces.lying_or_standing import MisplacedPiece

_CLEAR: Final = 0.11
"""What makes way goes so far from where pieces lie [m]: they are up to 60 mm long, and the fingers need as much."""
_PLACES_TRIED: Final = 6
_RAISES: Final = 2
"""So many higher grips are tried, up to …"""
_ON_THE_PIECE: Final = 0.001
"""… one at which the pads end so far below the top of the piece [m]."""
_HEAP_NAME: Final = "heap"
_HEAP_KIND: Final = Kind.KING
"""What leans is as wide as the foot of this."""
_HEAP: Final = 0.014
"""Nothing else is so near to its middle [m]."""
_STIRRED: Final = 0.016
"""By so much it is pushed [m]."""
_SHORT: Final = 0.004
"""By so much less than it was meant to has a piece gone that is still in the way, for each push [m]."""
LEANS: Final = 0.005
"""A piece no further from another may lean on it [m]."""


@dataclass(frozen=True, slots=True)
class Blocked:
    """A piece that the arm cannot take, or stand up, because of another.

    Attributes:
        name: of the piece.
        by: name of the other.
        around: where the fingers would be around it, if that is not where it stands now.
        pushed: so often one of the two was, which was not enough.
    """

    name: str
    by: str
    around: Obstacle | None = None
    pushed: int = 0


def in_order(misplaced: Sequence[MisplacedPiece]) -> list[MisplacedPiece]:
    """As they are to be righted: those that lie before those that stand."""
    return sorted(misplaced, key=lambda one: not one.lies)


def loose_pieces(misplaced: Sequence[MisplacedPiece]) -> LoosePieces:
    """As a planner needs them, which plans around them."""
    return LoosePieces(
        tuple(
            Obstacle(one.piece.name, one.target, one.pose.x, one.pose.y, one.piece.kind)
            for one in misplaced
            if not one.lies
        ),
        tuple(_lying(one) for one in misplaced if one.lies),
    )


def leant_on(one: MisplacedPiece, misplaced: Sequence[MisplacedPiece], stands: Inventory) -> str | None:
    """The piece that is nearest to one which does not lie flat, as the arm has felt; None: nothing is so near."""
    shape, yaw = PIECE_SHAPES[one.piece.kind], one.pose.yaw or 0.0
    along = np.linspace(0.0, shape.height, 12)
    axis = np.array([one.pose.x, one.pose.y]) + along[:, None] * np.array([math.cos(yaw), math.sin(yaw)])
    radius = np.where(along <= shape.foot_height, shape.foot_radius, shape.stem_radius)
    table, astray = stands.table, {each.piece.name: (each.pose.x, each.pose.y) for each in misplaced}
    nearest, found = LEANS, None
    for piece in stands:
        if piece.name == one.piece.name or piece.place.in_box:
            continue
        at = astray.get(piece.name, table.xy(piece.place))
        gap = float((np.hypot(*(axis - at).T) - radius).min()) - PIECE_SHAPES[piece.kind].foot_radius
        if gap < nearest:
            nearest, found = gap, piece.name
    return found


def plan_stand_up(
    planner: Planner, one: MisplacedPiece, others: Sequence[MisplacedPiece], inventory: Inventory, lower: float = 0.0
) -> Plan:
    """Stand a piece up where it lies, or carry it from where it stands to its place; then home.

    ``lower``: by how much the board is lower than its table says [m].

    Raises:
        PlanRefused: something is in the way; of a piece that lies, ``InTheWay`` says which piece.
    """
    gone = {other.piece.name for other in others if other.piece.name != one.piece.name}
    rest = [piece for piece in inventory if piece.name not in gone]
    if not one.lies:
        carried = Transfer.of(one.piece, one.target, (one.pose.x, one.pose.y))
        label = f"{one.piece.name} to {one.target}"
        return planner.ply(label, [carried], Inventory.of(rest, inventory.table))
    table = inventory.table
    loose = loose_pieces([other for other in others if other.piece.name in gone])
    near = (*_kept(rest, gone | {one.piece.name}, table), *loose.standing)
    return plan_upright(planner, _lying(one), near, loose.lying, lower=lower).plan


def plan_feeling_board(
    planner: Planner, one: MisplacedPiece, misplaced: Sequence[MisplacedPiece], inventory: Inventory
) -> FeelPlan:
    """Feel how high the board is beside a piece. Raises ``PlanRefused`` if no square is free."""
    loose = loose_pieces(misplaced)
    gone = {other.piece.name for other in misplaced}
    near = (*_kept(inventory, gone, inventory.table), *loose.standing)
    return plan_feeling(planner, (one.pose.x, one.pose.y), near, loose.lying)


def plan_making_way(
    planner: Planner,
    blocks: str,
    misplaced: Sequence[MisplacedPiece],
    inventory: Inventory,
    but: Set[Place] = frozenset(),
) -> tuple[Transfer, Plan]:
    """Carry a piece that stands in the way to a free place; once all is right it has to be carried back.

    ``blocks`` is its name, as ``InTheWay`` has it. It goes where it is clear of all misplaced pieces, but not to some
    places; one that itself is where it should not be goes where it belongs, if that is clear of what lies about.

    Returns:
        Where it goes, for the inventory, and the plan.

    Raises:
        PlanRefused: it lies, the fingers cannot take it either, or no place is free.
    """
    table, piece = inventory.table, inventory.find(blocks)
    itself = next((one for one in misplaced if one.piece.name == blocks), None)
    if itself is not None and itself.lies:
        raise PlanRefused(f"{blocks}, which is in the way, has fallen over too: take it off the board")
    if piece.place.in_box:
        raise PlanRefused(f"{blocks}, which is in the way, belongs in a box: put it there")
    seen = None if itself is None else (itself.pose.x, itself.pose.y)
    misplaced = [one for one in misplaced if one is not itself]
    gone = {one.piece.name for one in misplaced}
    targets = {one.target for one in misplaced}
    rest = Inventory.of([one for one in inventory if one.name not in gone], table)
    free = [
        place for place in inventory.places()
        if inventory.at(place) is None and place not in targets | but and _clear_of(table.xy(place), misplaced)
    ]  # fmt: skip
    # squares first: the camera sees whether it has come there
    free.sort(key=lambda place: (not place.on_board, inventory.travel(piece.place, place), place))
    if itself is not None and itself.target not in targets | but and _clear_of(table.xy(itself.target), misplaced):
        free.insert(0, itself.target)
    refused: PlanRefused | None = None
    for raised in _raised(piece.kind, planner.cell.parameters):
        for place in free[:_PLACES_TRIED]:
            transfer = Transfer.of(piece, place, seen, raised)
            try:
                label = f"{piece.name} out of the way to {place}"
                return transfer, planner.ply(label, [transfer], rest, loose=loose_pieces(misplaced))
            except PlanRefused as error:
                refused = refused or error
    raise refused or PlanRefused(
        f"there is no free place for {blocks}, which is in the way: take a piece off the board"
    )


def plan_pushing(
    planner: Planner, blocked: Sequence[Blocked], misplaced: Sequence[MisplacedPiece], inventory: Inventory
) -> tuple[Nudge, Plan]:
    """Push one of two pieces aside that are in each other's way, so that one of them can be taken or stood up.

    Returns:
        The push, and the plan; where the piece comes to rest, a look must tell.

    Raises:
        PlanRefused: no push helps, or it leads out of the workspace.
    """
    table, cell = inventory.table, planner.cell
    gone = {one.piece.name for one in misplaced}
    loose = loose_pieces(misplaced)
    kept = _kept(inventory, gone, table)
    scene = LoosePieces((*kept, *loose.standing), loose.lying)

    def free(one: Blocked, scene: LoosePieces) -> bool:
        others = crowd_of(scene, table, without=one.name)
        if (lying := next((piece for piece in scene.lying if piece.name == one.name), None)) is not None:
            return room_to_stand_up(lying, others, cell)
        if one.around is not None:
            return fits_around(one.around, others, cell)
        return any(piece.name == one.name and fits_around(piece, others, cell) for piece in scene.standing)

    blocked = [replace(one, around=None) if one.around in scene.standing else one for one in blocked]
    # a piece that blocks counts as blocked itself: once it can be taken, it can make way
    stuck = [one for pair in blocked for one in (pair, Blocked(pair.by, pair.name)) if not free(one, scene)]
    there = {piece.name for piece in scene.standing} | {piece.name for piece in scene.lying}
    names = tuple(dict.fromkeys(name for one in blocked for name in (one.name, one.by) if name in there))
    find = partial(
        find_nudge, names, scene, frozenset(piece.name for piece in kept),
        lambda after: any(free(one, after) for one in stuck), cell.parameters.pads, table,
    )  # fmt: skip
    shorts = dict.fromkeys((_SHORT * max(one.pushed for one in blocked), 0.0))
    nudge = next(filter(None, (find(short=short) for short in shorts)), None)
    if nudge is None:
        raise PlanRefused(f"no push of the {' or the '.join(names)} helps: move one of them away")
    return nudge, plan_nudge(planner, nudge, scene)


def plan_stirring(
    planner: Planner, spot: Point, fallen: Set[str], misplaced: Sequence[MisplacedPiece], inventory: Inventory,
    towards: float | None = None, itself: MisplacedPiece | None = None,
) -> Plan:  # fmt: skip
    """Push whatever leans at a spot of the board, so that it falls flat; ``fallen`` are names of pieces that may be it.

    It is pushed about ``towards`` a direction [rad]; None: wherever that is possible. ``itself``: what lies there, if
    that is known; then the spot is where it is pushed, off its centre of mass, so that it turns.

    Raises:
        PlanRefused: the fingers do not get at it.
    """
    table, gone = inventory.table, fallen | {one.piece.name for one in misplaced}
    loose = loose_pieces([one for one in misplaced if math.dist((one.pose.x, one.pose.y), spot) > _HEAP])
    standing = [one for one in _kept(inventory, gone, table) if math.dist((one.x, one.y), spot) > _HEAP]
    heap = Obstacle(_HEAP_NAME, square_place(0), *spot, _HEAP_KIND)
    scene = LoosePieces((heap, *standing, *loose.standing), loose.lying)
    if itself is not None:
        scene = LoosePieces((*standing, *loose.standing), (replace(_lying(itself), name=_HEAP_NAME), *loose.lying))
    begin = _middle(scene)

    def helps(after: LoosePieces) -> bool:
        return math.dist(_middle(after), begin) > _STIRRED

    nudge = find_nudge(
        (_HEAP_NAME,), scene, frozenset(), helps, planner.cell.parameters.pads, table, towards,
        at=None if itself is None else spot,
    )  # fmt: skip
    if nudge is None:
        raise PlanRefused("the fingers cannot reach what leans there: lay it flat")
    return plan_nudge(planner, nudge, scene)


def _middle(scene: LoosePieces) -> Point:
    """Of what is to be stirred, or its foot's."""
    spots = [(one.x, one.y) for one in scene.standing if one.name == _HEAP_NAME]
    return (spots + [one.base for one in scene.lying if one.name == _HEAP_NAME])[0]


def _kept(pieces: Iterable[PieceSpec], gone: Set[str], table: TableSettings) -> tuple[Obstacle, ...]:
    """Pieces at the centres of their places, without those of some names and those in boxes."""
    return tuple(
        Obstacle.at(piece.name, piece.place, piece.kind, table)
        for piece in pieces
        if piece.name not in gone and not piece.place.in_box
    )


def _raised(kind: Kind, parameters: RobotParameters) -> Iterator[float]:
    """By how much the fingers may take a piece higher than usual, so that they pass over what lies beside it [m]."""
    shape = PIECE_SHAPES[kind]
    most = shape.height - shape.grip_height - parameters.pads.half_height - _ON_THE_PIECE
    yield 0.0
    for part in range(1, _RAISES + 1):
        yield max(0.0, most) * part / _RAISES


def _clear_of(point: tuple[float, float], misplaced: Sequence[MisplacedPiece]) -> bool:
    return all(math.dist(point, (one.pose.x, one.pose.y)) > _CLEAR for one in misplaced)


def _lying(one: MisplacedPiece) -> Lying:
    assert one.pose.yaw is not None
    return Lying(one.piece.kind, (one.pose.x, one.pose.y), one.pose.yaw, one.piece.name)
