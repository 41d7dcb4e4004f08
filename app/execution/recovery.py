"""The look after each job, and putting right what is not as it should be: by the arm where it can, else by a person.

Each round looks at the board, finds out what stands where, and lets the arm carry what stands wrong; the next round
looks again. Every round is in the record before the arm moves, so that a program that goes on with the game knows.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from typing import Final

import chess
import numpy as np

from app import UserError
from app.execution.carrier import BoardTouched, Carrier, CarryFailed
from app.execution.fallen import Fallen, unaided, with_missing
from app.execution.observation import GameObserver
from app.execution.recovery_plans import Blocked, in_order, leant_on
from app.execution.repair import Ask, BoardObservation, Repair, mend, repair_by_sight
from app.execution.repair.diagnosis import SEEN_WITHIN, repair_towards
from app.execution.state import Asker, AwaitedReply, Job, RecoveryResult, changed
from app.motion.plan import InTheWay, PlanRefused
from app.pieces.inventory import Inventory, Transfer
from app.pieces.order import rearrange
from app.records import GameRecord
from app.records.events import Purpose
from app.terminal.interface import UserInterface
from hardware.interfaces import Clock
from hardware.table import square_place
from vision.pieces.pose_search import MisplacedPiece
from vision.pieces.verify import Fault, FaultKind

MOST_ROUNDS: Final = 40
"""Of the arm, two or three for a piece that has fallen, and some more for each that is in its way; what is
not right then, it will not get right."""
_GONE: Final = frozenset({FaultKind.MISSING, FaultKind.FALLEN, FaultKind.OFF_CENTRE})
"""Off its centre may be what lies along the view: a closer look tells."""
MOST_PUSHES: Final = 6
"""Of one piece."""
_CLOSE: Final = 0.065
"""Pieces that stand so near to where no push helps make way, one after the other [m]."""
MOST_TRIES: Final = 3
"""To stand one piece up."""
FRESH: Final = 0.5
"""The arm relies for so long on what the camera has seen [s]."""


class Recovery:
    """Looks, and puts right.

    Args:
        observer: look.
        carrier: carries.
        asker: asks a person.
        record: of the game.
        ui: shown what happens.
        clock: of the plant.
    """

    def __init__(
        self,
        observer: GameObserver,
        carrier: Carrier,
        asker: Asker,
        record: GameRecord,
        ui: UserInterface,
        clock: Clock,
    ) -> None:
        self.observer = observer
        self._carrier, self._asker = carrier, asker
        self._record, self._ui, self._clock = record, ui, clock
        self._tried = Counter[str]()
        """How often a piece could not be stood up."""
        self._handled: set[str] = set()
        """Pieces that the arm has stood up or pushed since it began."""
        self._pushed = Counter[str]()
        """How often a piece was."""
        self._loose: tuple[MisplacedPiece, ...] = ()
        """What the arm has to keep clear of in what it does next."""
        self._lost: set[str] = set()
        """Pieces that the arm has lost, or not got, since the board was last right."""

    @property
    def stale(self) -> bool:
        """Whether the board was looked at too long ago for the arm to rely on it: somebody may have touched it."""
        return self._clock.now() - self.observer.looked_at > FRESH

    def note_loss(self, failure: CarryFailed) -> None:
        """The arm has lost a piece, or not got it: that is in the record, whatever comes of it."""
        self._lost.add(failure.transfer.name)
        self._ui.phase(str(failure))
        squares = (str(failure.transfer.source), str(failure.transfer.target))
        self._record.trouble(failure.loss.value, squares, str(failure), None, self._clock.now())

    def mend(
        self, stands: Inventory, wanted: Inventory, board: chess.Board | None = None, reply: AwaitedReply | None = None
    ) -> RecoveryResult:
        """Until the board shows what is wanted.

        Args:
            stands: what should stand where now, as far as is known.
            wanted: what shall stand where.
            board: the position that ``stands`` shows, where a person may have moved something; None: only the arm has.
            reply: the next move, which a person may have made already: it is theirs, and nothing to mend; None: nobody
                can have.

        Raises:
            UserError: a person is needed, and nobody is there; or it cannot be put right.
        """
        rounds, duration = 0, 0.0
        self._handled.clear()
        self._pushed.clear()
        self._tried.clear()
        while True:
            faults, step = self._decide(stands, wanted, board)
            if faults and not changed(stands, wanted) and reply is not None and self.observer.answered(reply):
                return RecoveryResult(stands, rounds, duration, answered=True)
            if step is None:
                self._lost.clear()
                return RecoveryResult(stands, rounds, duration)
            if isinstance(step, Fallen):
                stands, took, step = self._stand_up(step, stands, faults)
                duration += took
            rounds, counted = _next_round(rounds, faults), True
            while isinstance(step, Repair):
                if step.transfers:
                    rounds, counted = (rounds if counted else _next_round(rounds, faults)), False
                    before = stands
                    stands, took, step = self._carry(step, faults)
                    stands, duration = with_missing(stands, before, wanted), duration + took
                else:  # it has come to stand where it shall
                    stands, step = step.believed, step.rest
            if step is not None:
                self._ask(step, faults, stands)
                stands = wanted

    def _decide(
        self, stands: Inventory, wanted: Inventory, board: chess.Board | None
    ) -> tuple[tuple[Fault, ...], Repair | Ask | Fallen | None]:
        """What is wrong, and what to do about it; None: nothing, the board shows what is wanted."""
        found = self.observer.verify(stands)
        if found.faults:  # one frame may be wrong
            found = self.observer.verify(stands)
        # a hand may have exchanged pieces that look alike, or moved some in the trays
        sighted = self._by_sight(stands, wanted, found) if found.faults or board is not None else None
        if sighted is not None:
            return found.faults, sighted
        # a second's search: once a look, and only where it is needed
        misplaced = cache(lambda: self.observer.misplaced(stands))
        missing = {square_place(fault.square) for fault in found.faults if fault.kind in _GONE}
        missing |= {place for name in self._lost | self._handled if (place := stands.find(name).place).in_tray}
        alone = unaided(missing, stands, wanted, misplaced, self._handled, people=board is not None)
        self._loose = alone.misplaced if isinstance(alone, Fallen) else () if alone is None else tuple(misplaced())
        if not found.faults:
            rest = rearrange(stands, wanted)
            return (), alone or (Repair(stands, rest, "the arm goes on") if rest else None)
        step = mend(stands, found, board)
        if isinstance(alone, Fallen) or isinstance(step, Ask):  # fingers must not take what lies for what stands
            return found.faults, alone or step
        self._loose = ()
        places = {**found.places, **self._places(stands, step.believed, misplaced)}
        lost = [name for name, place in changed(stands, step.believed).items() if place.index not in places]
        if lost:  # the fingers would run into it
            return found.faults, Ask(f"{_sentence(found.faults)}: see to it", squares_of(found.faults))
        step = repair_towards(step.believed, wanted, replace(found, places=places))
        if isinstance(step, Repair) and not step.transfers and step.rest is None and not changed(stands, step.believed):
            return found.faults, Ask(f"{_sentence(found.faults)}: see to it", squares_of(found.faults))
        return found.faults, step

    def _by_sight(self, stands: Inventory, wanted: Inventory, found: BoardObservation) -> Repair | Ask | None:
        """What to do where depth shows for sure what stands where, and something was carried; None: it does not."""
        seen, self._loose = self.observer.whereabouts(stands), ()
        if seen is None or seen.lying or not (seen.moved or seen.missing):
            return None
        return repair_by_sight(stands, wanted, seen, found.places)

    def _places(
        self, stands: Inventory, believed: Inventory, misplaced: Callable[[], list[MisplacedPiece]]
    ) -> dict[int, tuple[float, float]]:
        """Where pieces stand, board frame (x, y) [m], by the square where they are believed to; also of those that are
        far from the centre of any.
        """
        places = self.observer.places(believed)
        moved = {name: place for name, place in changed(stands, believed).items() if place.index not in places}
        if moved:
            most = SEEN_WITHIN * stands.table.square
            for one in misplaced():
                place = moved.get(one.piece.name)
                if place is None or one.lies:
                    continue
                off = np.subtract((one.pose.x, one.pose.y), stands.table.xy(place))
                if np.abs(off).max() <= most:
                    places[place.index] = one.pose.x, one.pose.y
        return places

    def _stand_up(
        self, step: Fallen, stands: Inventory, faults: Sequence[Fault]
    ) -> tuple[Inventory, float, Repair | Ask | None]:
        """The first of the pieces that lie at which the fingers get is stood up; then what is next: nothing but to
        look, making way, or to ask.
        """
        now, refusals = self._clock.now(), list[tuple[str, str, PlanRefused]]()
        for one in (stray for stray in in_order(step.misplaced) if stray.lies):
            sentence = f"the {one.piece.colour} {one.piece.kind} of {one.target} lies on the board"
            if self._tried[one.piece.name] >= MOST_TRIES:
                unable = PlanRefused(f"it could not be stood up in {MOST_TRIES} attempts")
                refusals.append((one.piece.name, f"{sentence}, and {unable}: stand it on {one.target}", unable))
                continue
            if self._tried[one.piece.name] and (away := self._take_prop(one, step.misplaced, stands)) is not None:
                return stands, 0.0, away
            self._ui.say(f"{sentence}: the arm stands it up")
            self._record.found(stands, sentence, now)
            self.observer.forget_likeness()
            try:
                took = self._carrier.stand_up(one, step.misplaced, stands, self.observer.seen)
            except BoardTouched:
                return stands, 0.0, None
            except PlanRefused as refused:
                refusals.append((one.piece.name, f"{sentence}, and {refused}: stand it on {one.target}", refused))
                continue
            if took is None:
                self._tried[one.piece.name] += 1
                return stands, 0.0, None
            self._handled.add(one.piece.name)
            self._record.trouble(FaultKind.FALLEN.value, (str(one.target),), sentence, "arm", now)
            return stands, took, None
        return stands, 0.0, self._make_way(refusals, step, stands, faults)

    def _take_prop(self, one: MisplacedPiece, misplaced: Sequence[MisplacedPiece], stands: Inventory) -> Repair | None:
        """What a piece leans on, so that it could not be stood up, goes to its place, or out of the way for now."""
        name = leant_on(one, misplaced, stands)
        stray = next((each for each in misplaced if each.piece.name == name and not each.lies), None)
        if name is None:
            return None
        try:
            transfer = (
                self._carrier.way_for(name, misplaced, stands)
                if stray is None
                else Transfer.of(stray.piece, stray.target, (stray.pose.x, stray.pose.y))
            )
        except PlanRefused:
            return None
        return Repair(stands, (transfer,), f"{_called(stands, name)}, on which it leans, goes first")

    def _make_way(
        self, refusals: Sequence[tuple[str, str, PlanRefused]], step: Fallen, stands: Inventory, faults: Sequence[Fault]
    ) -> Repair | Ask | None:
        """A piece that is in the way goes aside; it is brought back at the end, as it is wanted where it stood. If the
        fingers do not get at it either, one of the two is pushed.
        """
        sentence, pairs = refusals[0][1], list[Blocked]()
        for name, _, blocked in refusals:
            if not isinstance(blocked, InTheWay):
                continue
            try:
                transfer = self._carrier.way_for(blocked.piece.name, step.misplaced, stands)
            except PlanRefused as refused:
                sentence = f"{blocked}; {refused}"
                pairs.append(Blocked(name, blocked.piece.name))
                continue
            return Repair(stands, (transfer,), f"the {transfer.kind} of {transfer.source} makes way")
        if self._push(pairs, step.misplaced, stands):
            return None
        return self._make_room(pairs, step.misplaced, stands) or Ask(sentence, squares_of(faults))

    def _make_room(
        self, pairs: Sequence[Blocked], misplaced: Sequence[MisplacedPiece], stands: Inventory
    ) -> Repair | None:
        """The nearest of the pieces around two that are in each other's way goes aside: then there may be a push."""
        table, astray = stands.table, {one.piece.name: (one.pose.x, one.pose.y) for one in misplaced}
        stuck = {name for pair in pairs for name in (pair.name, pair.by)}
        spots = [astray.get(name, table.xy(stands.find(name).place)) for name in stuck]
        near = list[tuple[float, str]]()
        for piece in stands:
            if piece.name in stuck or piece.place.in_box:
                continue
            at = astray.get(piece.name, table.xy(piece.place))
            distance = min((math.dist(at, spot) for spot in spots), default=math.inf)
            if distance < _CLOSE:
                near.append((distance, piece.name))
        for _, name in sorted(near):
            try:
                transfer = self._carrier.way_for(name, misplaced, stands)
            except PlanRefused:
                continue
            return Repair(stands, (transfer,), f"the {transfer.kind} of {transfer.source} makes room")
        return None

    def _push(self, pairs: Sequence[Blocked], misplaced: Sequence[MisplacedPiece], stands: Inventory) -> bool:
        """Whether one of two pieces that are in each other's way was pushed aside, or the board wants another look."""
        pairs = [pair for pair in pairs if max(self._pushed[pair.name], self._pushed[pair.by]) < MOST_PUSHES]
        if not pairs:
            return False
        self.observer.forget_likeness()
        try:
            push = self._carrier.push_for(pairs, misplaced, stands, self.observer.seen)
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
        self._handled.add(push.name)
        self._pushed[push.name] += 1
        self._carrier.push_aside(push, stands)
        return True

    def _carry(self, step: Repair, faults: Sequence[Fault]) -> tuple[Inventory, float, Repair | Ask | None]:
        """One round: recorded, carried; what stands where then, how long it took [s], and what has to be done
        before it could be, or, by a person, afterwards.
        """
        label, now = "put the board right", self._clock.now()
        for fault in faults:
            self._record.trouble(fault.kind.value, (str(square_place(fault.square)),), fault.sentence, "arm", now)
        self._ui.say(f"{_sentence(faults)}: {step.sentence}" if faults else step.sentence)
        self._record.found(step.believed, _sentence(faults) or "not all is carried yet", now)
        self._record.task(Purpose.REPAIR, label, step.transfers, now)
        self.observer.forget_likeness()
        try:
            job = Job(label, step.transfers, misplaced=self._loose)
            carried = self._carrier.carry(job, step.believed, seen=self.observer.seen)
        except BoardTouched:
            return step.believed, 0.0, None
        except CarryFailed as failure:
            self.note_loss(failure)
            return failure.inventory, 0.0, None
        except UserError as error:
            if not self._carrier.untouched:
                raise
            return step.believed, 0.0, self._around(error, step, faults)  # the fingers do not get at it
        # what a person would be asked for may be in sight now
        rest = None if isinstance(step.rest, Ask) else step.rest
        return step.believed.after_all(step.transfers), carried.done.duration, rest

    def _around(self, refused: UserError, step: Repair, faults: Sequence[Fault]) -> Repair | Ask | None:
        """A piece that is in the way goes first where it has to go anyway, or else aside."""
        asked = Ask(str(refused), squares_of(faults))
        if not isinstance(refused, InTheWay):
            return asked
        own = next((one for one in step.transfers if one.name == refused.piece.name), None)
        if own is not None and len(step.transfers) > 1 and _is_free(own, step.believed):
            return Repair(step.believed, (own,), f"the {own.kind} of {own.source} goes first")
        self._loose = misplaced = tuple(self.observer.misplaced(step.believed))
        try:
            transfer = self._carrier.way_for(refused.piece.name, misplaced, step.believed)
        except PlanRefused:
            if refused.around is None:
                return asked
            pair = Blocked(refused.around.name, refused.piece.name, refused.around)
            if self._push([pair], misplaced, step.believed):
                return None
            return self._make_room([pair], misplaced, step.believed) or asked
        return Repair(step.believed, (transfer,), f"the {transfer.kind} of {transfer.source} makes way")

    def _ask(self, step: Ask, faults: Sequence[Fault], stands: Inventory) -> None:
        squares = tuple(str(square_place(square)) for square in step.squares)
        self._asker.mend(step.sentence, squares, stands)
        self.observer.forget_likeness()
        self._tried.clear()
        for fault in faults:
            place = (str(square_place(fault.square)),)
            self._record.trouble(fault.kind.value, place, fault.sentence, "person", self._clock.now())


def _next_round(rounds: int, faults: Sequence[Fault]) -> int:
    if rounds >= MOST_ROUNDS:
        raise UserError(
            f"the board is still not right after {MOST_ROUNDS} attempts ({_sentence(faults)}): put it right by hand, "
            "then go on with 'touchmove resume'"
        )
    return rounds + 1


def _called(stands: Inventory, name: str) -> str:
    """A piece as people would say it."""
    piece = stands.find(name)
    return f"the {piece.colour} {piece.kind} of {piece.place}"


def _is_free(transfer: Transfer, stands: Inventory) -> bool:
    there = stands.at(transfer.target)
    return there is None or there.name == transfer.name


def squares_of(faults: Sequence[Fault]) -> tuple[int, ...]:
    """That faults are about."""
    return tuple(fault.square for fault in faults)


def _sentence(faults: Sequence[Fault]) -> str:
    return "; ".join(fault.sentence for fault in faults)
