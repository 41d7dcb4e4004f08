"""What is in the arm's way goes aside: carried where the fingers get at it, else pushed, else what stands around it.

All of it is brought back at the end, as it is wanted where it stood.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence, Set
from dataclasses import replace
from typing import Final

from app.execution.carrier import Carrier
from app.execution.fallen import Leaning
from app.execution.interruption import BoardTouched
from app.execution.observation import GameObserver
from app.execution.recovery_plans import Blocked, leant_on
from app.execution.repair import Ask, Repair
from app.motion.plan import BoxInTheWay, InTheWay, PlanRefused
from app.pieces.inventory import Inventory, Transfer
from app.pieces.order import Point
from app.records import GameRecord
from app.terminal.game_display import UserInterface
from hardware.interfaces import Clock
from hardware.piece_set import PIECE_SHAPES
from hardware.table import Place
from vision.pieces.lying_or_standing import MisplacedPiece

MOST_PUSHES: Final = 6
"""Of one piece."""
MOST_STIRS: Final = 6
"""Of what leans."""
_CLOSE: Final = 0.065
"""Pieces that stand so near to where no push helps make way, one after the other [m]."""

Refusals = Sequence[tuple[str, PlanRefused]]
"""Names of pieces that cannot be stood up, and why."""


class Clearing:
    """Makes room for the arm.

    Args:
        observer: looks.
        carrier: carries and pushes.
        record: of the game.
        ui: shown what happens.
        clock: of the plant.

    Attributes:
        pushed: how often a piece was, since ``begin``.
    """

    def __init__(
        self, observer: GameObserver, carrier: Carrier, record: GameRecord, ui: UserInterface, clock: Clock
    ) -> None:
        self._observer, self._carrier = observer, carrier
        self._record, self._ui, self._clock = record, ui, clock
        self.pushed = Counter[str]()
        self._stirred = 0
        """So often what leans was pushed."""
        self._parted: set[str] = set()
        """Pieces that were taken away from what leans."""
        self._left = defaultdict[str, set[Place]](set)
        """From where pieces have made way: back there they would be in the way again."""
        self._freed: MisplacedPiece | None = None
        """A piece that lies, and for which another has just made way."""

    def begin(self) -> None:
        """A recovery begins."""
        self._freed = None
        self.pushed.clear()
        self._parted.clear()
        self._left.clear()
        self._stirred = 0

    def freed(self, missing: Set[Place]) -> list[MisplacedPiece]:
        """The piece that lies, and for which another has just made way, if it is missing from one of these places: as
        it lay then, for nothing has touched it since. It comes before that other one is carried back. Told once.
        """
        freed, self._freed = self._freed, None
        return [] if freed is None or freed.target not in missing else [freed]

    def prop(self, one: MisplacedPiece, misplaced: Sequence[MisplacedPiece], stands: Inventory) -> Repair | bool:
        """What a piece leans on, so that it could not be stood up, goes to its place, or out of the way for now; if the
        fingers do not get at it because of the first, one of the two is pushed aside. As ``way``.
        """
        name = leant_on(one, misplaced, stands)
        stray = next((each for each in misplaced if each.piece.name == name and not each.lies), None)
        if name is None or stands.find(name).place.in_box:
            return False
        try:
            transfer = (
                self._carrier.way_for(name, misplaced, stands)
                if stray is None
                else Transfer.of(stray.piece, stray.target, (stray.pose.x, stray.pose.y))
            )
        except PlanRefused as refused:
            both = isinstance(refused, InTheWay) and refused.piece.name == one.piece.name
            return both and self._push([Blocked(one.piece.name, name)], misplaced, stands)
        return Repair(stands, (transfer,), f"{_called(stands, name)}, on which it leans, goes first")

    def way(self, refusals: Refusals, misplaced: Sequence[MisplacedPiece], stands: Inventory) -> Repair | bool:
        """A piece that is in the way of another goes aside. If the fingers do not get at it either, one of the two is
        pushed; if that does not help, what stands around them goes first.

        Returns:
            What the arm is to carry; True: the board wants another look; False: nothing helps.
        """
        pairs = list[Blocked]()
        for name, blocked in refusals:
            if not isinstance(blocked, InTheWay):
                continue
            step = self._aside(blocked.piece.name, misplaced, stands, "makes way")
            if step is not None:
                self._freed = next(one for one in misplaced if one.piece.name == name)
                return step
            pairs.append(Blocked(name, blocked.piece.name))
        at_box = {name for name, blocked in refusals if isinstance(blocked, BoxInTheWay)}
        if any(self.swing(one, misplaced, stands) for one in misplaced if one.piece.name in at_box):
            return True
        if self._push(pairs, misplaced, stands):
            return True
        lying = [one for one in misplaced if one.lies and one.piece.name in {pair.name for pair in pairs}]
        room = self._room(pairs, misplaced, stands)
        if room is not None:
            self._freed = next(iter(lying), None)
            return room
        return any(self.swing(one, misplaced, stands) for one in lying)

    def swing(self, one: MisplacedPiece, misplaced: Sequence[MisplacedPiece], stands: Inventory) -> bool:
        """Whether a piece that lies so that no push of all of it helps was pushed at its head, its middle or its foot,
        across: it turns, rather along the boxes and trays than towards them, and lies otherwise.
        """
        others = tuple(each for each in misplaced if each is not one)
        spots = tuple(reversed(_along(one)))
        heap = Leaning(spots, frozenset({one.target}), others, Ask("", ()), itself=one)
        heaps = [*(replace(heap, towards=direction) for direction in turning(one.pose.yaw or 0.0)), heap]
        return any(self._stir(spot, each, stands) for each in heaps for spot in spots)

    def around(self, refused: PlanRefused, step: Repair, misplaced: Sequence[MisplacedPiece]) -> Repair | bool:
        """A piece that is in the way of what is carried goes first where it has to go anyway, or else aside; as
        ``way``. If nothing else helps, what was to be carried is pushed: it may lean on what is in the way.
        """
        if not isinstance(refused, InTheWay):
            return False
        name, stands = refused.piece.name, step.believed
        own = next((one for one in step.transfers if one.name == name), None)
        if own is not None and len(step.transfers) > 1 and _is_free(own, stands):
            return Repair(stands, (own,), f"the {own.kind} of {own.source} goes first")
        aside = self._aside(name, misplaced, stands, "makes way")
        if aside is not None or refused.around is None:
            return aside or False
        lying = next((one for one in misplaced if one.lies and one.piece.name == name), None)
        if lying is not None:
            away = self._aside(refused.around.name, misplaced, stands, "moves away from what lies there")
            if away is not None:  # it comes back once the other stands
                self._freed = lying
                return away
        pairs = [Blocked(refused.around.name, name, refused.around)]
        spot = refused.around.x, refused.around.y
        return (
            self._push(pairs, misplaced, stands)
            or self._room(pairs, misplaced, stands)
            or self._stir(spot, Leaning((spot,), frozenset(), tuple(misplaced), Ask("", ())), stands)
        )

    def parted(self, heap: Leaning, stands: Inventory) -> Repair | bool:
        """What stands about something that leans goes aside, one after the other, once each: without its neighbours it
        lies flat. What still does not is pushed.

        Returns:
            As ``way``.
        """
        for name in _nearest(heap.spots, heap.misplaced, stands, but=self._parted):
            if stands.find(name).place in heap.fallen:
                continue
            self._parted.add(name)
            step = self._aside(name, heap.misplaced, stands, "moves away from what leans there")
            if step is not None:
                return step
        return any(self._stir(spot, heap, stands) for spot in heap.spots)

    def _stir(self, spot: Point, heap: Leaning, stands: Inventory) -> bool:
        """Whether what leans at a spot was pushed, or the board wants another look."""
        if self._stirred >= MOST_STIRS:
            return False
        try:
            push = self._carrier.stir_for(spot, heap, stands, self._observer.seen)
        except PlanRefused as refused:
            self._ui.phase(str(refused))
            return False
        except BoardTouched:
            return True
        self._stirred += 1
        sentence = "something lies where the arm cannot grasp it: the arm pushes it"
        self._ui.say(sentence)
        self._record.found(stands, sentence, self._clock.now())
        self._observer.forget_likeness()
        self._carrier.push_aside(push, stands)
        return True

    def _aside(self, name: str, misplaced: Sequence[MisplacedPiece], stands: Inventory, does: str) -> Repair | None:
        try:
            transfer = self._carrier.way_for(name, misplaced, stands, self._left[name])
        except PlanRefused:
            return None
        self._left[name].add(transfer.source)
        return Repair(stands, (transfer,), f"the {transfer.kind} of {transfer.source} {does}")

    def _room(self, pairs: Sequence[Blocked], misplaced: Sequence[MisplacedPiece], stands: Inventory) -> Repair | None:
        """The nearest of the pieces around two that are in each other's way goes aside: then there may be a push."""
        stuck = {name for pair in pairs for name in (pair.name, pair.by)}
        astray = {one.piece.name: one for one in misplaced}
        spots = [
            spot for name in sorted(stuck)
            for spot in (_along(astray[name]) if name in astray else [stands.table.xy(stands.find(name).place)])
        ]  # fmt: skip
        near = _nearest(spots, misplaced, stands, but=stuck)
        return next(filter(None, (self._aside(name, misplaced, stands, "makes room") for name in near)), None)

    def _push(self, pairs: Sequence[Blocked], misplaced: Sequence[MisplacedPiece], stands: Inventory) -> bool:
        """Whether one of two pieces that are in each other's way was pushed aside, or the board wants another look."""
        pairs = [replace(pair, pushed=max(self.pushed[pair.name], self.pushed[pair.by])) for pair in pairs]
        pairs = [pair for pair in pairs if pair.pushed < MOST_PUSHES]
        if not pairs:
            return False
        self._observer.forget_likeness()
        try:
            push = self._carrier.push_for(pairs, misplaced, stands, self._observer.seen)
        except PlanRefused as refused:
            self._ui.phase(str(refused))
            return False
        except BoardTouched:
            return True  # what to do about it, the next look tells
        pair = next(pair for pair in pairs if push.name in (pair.name, pair.by))
        one, other = (_called(stands, each) for each in (pair.by, pair.name))
        sentence = f"{one} and {other} are in each other's way: the arm pushes {_called(stands, push.name)} aside"
        self._ui.say(sentence)
        self._record.found(stands, sentence, self._clock.now())
        self.pushed[push.name] += 1
        self._carrier.push_aside(push, stands)
        return True


def with_freed(found: Sequence[MisplacedPiece], freed: Sequence[MisplacedPiece]) -> list[MisplacedPiece]:
    """What a look has found; and what it has missed of what lay there just before."""
    names = {one.piece.name for one in found}
    return [*found, *(one for one in freed if one.piece.name not in names)]


def _nearest(
    spots: Sequence[Point], misplaced: Sequence[MisplacedPiece], stands: Inventory, but: Set[str]
) -> Iterator[str]:
    """Names of pieces that stand close to some spots, the nearest first, but for some."""
    astray = {one.piece.name: (one.pose.x, one.pose.y) for one in misplaced}
    near = list[tuple[float, str]]()
    for piece in stands:
        if piece.name in but or piece.place.in_box:
            continue
        at = astray.get(piece.name, stands.table.xy(piece.place))
        distance = min((math.dist(at, spot) for spot in spots), default=math.inf)
        if distance < _CLOSE:
            near.append((distance, piece.name))
    return (name for _, name in sorted(near))


def turning(yaw: float) -> tuple[float, float]:
    """Where the head of a piece that lies in a direction goes to as it is turned, rather along the files [rad]."""
    side = math.copysign(0.5 * math.pi, math.sin(2.0 * yaw))
    return yaw + side, yaw - side


def _along(one: MisplacedPiece) -> list[Point]:
    """Where a piece is, from its foot to its head [m]."""
    x, y, yaw = one.pose.x, one.pose.y, one.pose.yaw
    if yaw is None:
        return [(x, y)]
    height = PIECE_SHAPES[one.piece.kind].height
    return [(x + part * height * math.cos(yaw), y + part * height * math.sin(yaw)) for part in (0.0, 0.5, 1.0)]


def _called(stands: Inventory, name: str) -> str:
    """A piece as people would say it."""
    piece = stands.find(name)
    return f"the {piece.colour} {piece.kind} of {piece.place}"


def _is_free(transfer: Transfer, stands: Inventory) -> bool:
    there = stands.at(transfer.target)
    return there is None or there.name == transfer.name
