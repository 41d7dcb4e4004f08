"""The look after each job, and putting right what is not as it should be: by the arm where it can, else by a person.

Each round looks at the board, finds out what stands where, and lets the arm carry what stands wrong; the next round
looks again. Every round is in the record before the arm moves, so that a program that goes on with the game knows.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cache
from typing import Final

import chess
import numpy as np

from app.execution.carrier import Carrier
from app.execution.clearing import Clearing, with_freed
from app.execution.fallen import (
    MOST_TRIES,
    SWUNG_AFTER,
    Fallen,
    Leaning,
    bounced_out,
    continued,
    leaning,
    unaided,
    whereabout,
    with_missing,
)
from app.execution.interruption import BoardTouched, CarryFailed
from app.execution.observation import GameObserver
from app.execution.recovery_plans import in_order
from app.execution.repair import Ask, BoardObservation, Repair, Whereabouts, mend, repair_by_sight
from app.execution.repair.attempts import Attempts
from app.execution.repair.by_sight import boxed
from app.execution.repair.diagnosis import SEEN_WITHIN, missing_ask, repair_towards
from app.execution.repair.lost_pieces import LostPieces
from app.execution.repair.observed import sentence_of, squares_of
from app.execution.state import Asker, AwaitedReply, Job, RecoveryResult, changed
from app.motion.plan import PlanRefused
from app.pieces.inventory import Inventory
from app.records import GameRecord
from app.records.events import Purpose, RepairedBy
from app.terminal.game_display import UserInterface
from hardware.interfaces import Clock
from hardware.table import square_place
from vision.pieces.lying_or_standing import MisplacedPiece
from vision.pieces.placement_faults import Fault, FaultKind
from vision.reading.outcome import LOOKS

_GONE: Final = frozenset({FaultKind.MISSING, FaultKind.FALLEN, FaultKind.OFF_CENTRE})
"""Off its centre may be what lies along the view: a closer look tells."""
FRUITLESS: Final = 3
"""After so many looks at what a person should have put right, it says what it sees, and how to go on or leave."""
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
        mending: told when something has to be put right, and when all is right again.
    """

    def __init__(
        self, observer: GameObserver, carrier: Carrier, asker: Asker, record: GameRecord, ui: UserInterface,
        clock: Clock, mending: Callable[[bool], None] = lambda _: None,
    ) -> None:  # fmt: skip
        self.observer = observer
        self._carrier, self._asker = carrier, asker
        self._record, self._ui, self._clock, self._mending = record, ui, clock, mending
        self._tried = Counter[str]()
        """How often a piece could not be stood up."""
        self._swung = Counter[str]()
        """How often one of these was pushed, so that it lies otherwise."""
        self._stood_up: set[str] = set()
        """Pieces that the arm has stood up since it began."""
        self._asked = 0
        """So often a person was, since it began."""
        self._straightened: set[str] = set()
        """Pieces out of play that it has put right where they stand."""
        self._clearing = Clearing(observer, carrier, record, ui, clock)
        self._loose: tuple[MisplacedPiece, ...] = ()
        """What the arm has to keep clear of in what it does next."""
        self._lost, self._attempts = LostPieces(), Attempts()

    @property
    def stale(self) -> bool:
        """Whether the board was looked at too long ago for the arm to rely on it: somebody may have touched it."""
        return self._clock.now() - self.observer.looked_at > FRESH

    def doubt(self, names: Iterable[str]) -> None:
        """Another program may have lost these pieces."""
        self._lost.doubt(names)

    def note_loss(self, failure: CarryFailed) -> None:
        """The arm has lost a piece, or not got it: that is in the record, whatever comes of it."""
        self._lost.note(failure)
        self.observer.note_not_there(failure.transfer.name)
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
        self._asked, self._attempts = 0, Attempts()
        self._stood_up.clear()
        self._straightened.clear()
        self._clearing.begin()
        self._tried.clear()
        self._swung.clear()
        try:
            return self._mend(stands, wanted, board, reply)
        finally:
            self._mending(False)

    def _mend(
        self, stands: Inventory, wanted: Inventory, board: chess.Board | None, reply: AwaitedReply | None
    ) -> RecoveryResult:
        attempts, duration = self._attempts, 0.0
        while True:
            for _ in range(LOOKS):  # one may miss what the arm can put right
                faults, step = self._decide(stands, wanted, board)
                if faults and not changed(stands, wanted) and reply is not None and self.observer.answered(reply):
                    return RecoveryResult(stands, attempts.rounds, duration, answered=True)
                if not isinstance(step, Ask | Leaning):
                    break
            if step is None:
                self._lost.all_right(stands)
                return RecoveryResult(stands, attempts.rounds, duration)
            self._mending(True)
            vain = attempts.in_vain(faults, stands.table)
            step = vain if vain is not None and isinstance(step, Repair) else step
            if isinstance(step, Fallen):
                stands, took, step = self._stand_up(step, stands, faults)
                duration += took
            elif isinstance(step, Leaning):
                self._loose = step.misplaced
                cleared = self._clearing.parted(step, stands)
                step = None if cleared is True else cleared or step.otherwise
            attempts.one_more(faults)
            counted = True
            while isinstance(step, Repair):
                if step.transfers:
                    if not counted:
                        attempts.one_more(faults)
                    before, counted = stands, False
                    known = with_missing(step.believed, before, wanted, {one.target for one in step.transfers})
                    stands, took, step = self._carry(step, faults, known)
                    stands, duration = with_missing(stands, before, wanted), duration + took
                else:  # it has come to stand where it shall
                    stands, step = with_missing(step.believed, stands, wanted), step.rest
            if step is not None:
                self._ask(step, faults, stands)
                stands = wanted

    def _decide(
        self, stands: Inventory, wanted: Inventory, board: chess.Board | None
    ) -> tuple[tuple[Fault, ...], Repair | Ask | Fallen | Leaning | None]:
        """What is wrong, and what to do about it; None: nothing, the board shows what is wanted."""
        self._carrier.be_ready(stands)
        found = self.observer.verify(stands, self._stood_up)
        if found.faults:  # one frame may be wrong
            found = self.observer.verify(stands, self._stood_up)
        self._lost.look_into_boxes(wanted, self.observer.has_fallen_in)
        # a hand may have exchanged pieces that look alike, or moved some in the trays; the arm may have mistaken one
        handled = self._stood_up | self._clearing.pushed.keys()
        # what was let go over a box may have bounced out, and lie where nobody looks for it
        dropped = self._lost.dropped(stands)
        strange = self._lost.unknown(self.observer.strange(stands)) if dropped else ()
        look_closer = bool(found.faults or handled or self._lost.names or strange) or board is not None
        seen = self.observer.whereabouts(stands) if look_closer else None
        # a second's search: once a look, and only where it is needed
        foreign = any(fault.kind is FaultKind.FOREIGN for fault in found.faults)
        out = boxed(stands) if (foreign or strange) and self.observer.deep else []
        missing = {square_place(fault.square) for fault in found.faults if fault.kind in _GONE}
        freed = self._clearing.freed(missing)
        misplaced = cache(lambda: with_freed(self.observer.misplaced(stands, out, seen), freed))
        sighted = None if seen is None else self._by_sight(seen, stands, wanted, found)
        # what lies against something else may be no thing of its own to depth
        if sighted is not None and not (freed or (isinstance(sighted, Ask) and any(one.lies for one in misplaced()))):
            return found.faults, sighted
        missing |= {place for name in self._lost.names | handled if (place := stands.find(name).place).in_tray}
        missing |= {piece.place for piece in out} | (set() if seen is None else seen.fallen_beside(stands))
        alone = unaided(missing, stands, wanted, misplaced, handled, people=board is not None)
        self._loose = alone.misplaced if isinstance(alone, Fallen) else () if alone is None else tuple(misplaced())
        if not found.faults:
            if strange and alone is None:
                return (), bounced_out(strange, dropped, tuple(misplaced()), stands)
            gone = self._lost.not_in_trays(stands, seen, misplaced)
            return (), alone or continued(stands, wanted, gone, self._lost.astray(stands))
        step = mend(stands, found, board)
        if isinstance(alone, Fallen) or isinstance(step, Ask):  # fingers must not take what lies for what stands
            if not self.observer.deep:  # what looks fallen to colours alone may well stand
                return found.faults, alone or step
            return found.faults, alone or leaning(found.faults, seen, misplaced, stands, step)
        return found.faults, self._as_believed(found, step, stands, wanted, misplaced)

    def _as_believed(
        self,
        found: BoardObservation,
        step: Repair,
        stands: Inventory,
        wanted: Inventory,
        misplaced: Callable[[], list[MisplacedPiece]],
    ) -> Repair | Ask:
        """What the arm carries where squares alone tell what stands where, as far as its place is known."""
        self._loose = ()
        places = {**found.places, **self._places(stands, step.believed, misplaced)}
        lost = [name for name, place in changed(stands, step.believed).items() if place.index not in places]
        if lost:  # the fingers would run into it
            return Ask(f"{sentence_of(found.faults)}: put it right", squares_of(found.faults))
        towards = repair_towards(step.believed, wanted, replace(found, places=places))
        if isinstance(towards, Repair) and not (towards.transfers or towards.rest or changed(stands, towards.believed)):
            return Ask(f"{sentence_of(found.faults)}: put it right", squares_of(found.faults))
        return towards

    def _by_sight(
        self, seen: Whereabouts, stands: Inventory, wanted: Inventory, found: BoardObservation
    ) -> Repair | Ask | None:
        """What to do where depth shows for sure what stands where, and something was carried; None: nothing was.

        What was nudged in a tray is put right once: how exactly it stands at a picture's edge, nobody can tell.
        """
        self._loose = ()
        boxed = self._lost.in_boxes(seen, stands, wanted, found.faults)
        missing = tuple(dict.fromkeys((*seen.missing, *boxed)))
        seen = replace(seen, nudged=seen.nudged - self._straightened, missing=missing)
        if seen.lying or not (seen.moved or seen.missing or seen.nudged):
            return None
        self._straightened |= seen.nudged
        return repair_by_sight(stands, wanted, seen, found.places, {piece.name for piece in boxed})

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
        now, refusals = self._clock.now(), list[tuple[str, PlanRefused]]()
        for one in (stray for stray in in_order(step.misplaced) if stray.lies):
            sentence = f"the {one.piece.colour} {one.piece.kind} of {one.target} lies on the board"
            if self._tried[one.piece.name] >= MOST_TRIES:
                refusals.append((one.piece.name, PlanRefused(f"it could not be stood up in {MOST_TRIES} attempts")))
                continue
            if away := self._eased(one, step.misplaced, stands):
                return stands, 0.0, None if away is True else away
            self._ui.say(f"{sentence}: the arm stands it up")
            self._record.found(stands, sentence, now)
            self.observer.forget_likeness()
            try:
                took = self._carrier.stand_up(one, step.misplaced, stands, self.observer.seen)
            except BoardTouched:
                return stands, 0.0, None
            except PlanRefused as refused:
                refusals.append((one.piece.name, refused))
                continue
            if took is None:
                self._tried[one.piece.name] += 1
                return stands, 0.0, None
            self._stood_up.add(one.piece.name)
            self._record.trouble(FaultKind.FALLEN.value, (str(one.target),), sentence, "arm", now)
            return stands, took, None
        cleared = self._clearing.way(refusals, step.misplaced, stands)
        if cleared is True:
            return stands, 0.0, None
        (name, why), table = refusals[0], stands.table
        one = next(one for one in step.misplaced if one.piece.name == name)
        where = whereabout((one.pose.x, one.pose.y), table)
        lies = f"the {one.piece.colour} {one.piece.kind} of {one.target} lies {where}"
        back = "put it back into its box" if one.target.in_box else f"stand it on {one.target}"
        return stands, 0.0, cleared or Ask(f"{lies}, and {why}: {back}", squares_of(faults))

    def _eased(self, one: MisplacedPiece, misplaced: Sequence[MisplacedPiece], stands: Inventory) -> Repair | bool:
        """What helps a piece that did not come up: what it leans on goes first, or it is pushed, and lies otherwise.

        Returns:
            What the arm is to carry; True: the board wants another look; False: nothing, it is tried as it lies.
        """
        name = one.piece.name
        if not self._tried[name]:
            return False
        away = self._clearing.prop(one, misplaced, stands)
        if away or self._tried[name] // SWUNG_AFTER <= self._swung[name]:
            return away
        self._swung[name] += 1
        return self._clearing.swing(one, misplaced, stands)

    def _carry(
        self, step: Repair, faults: Sequence[Fault], known: Inventory
    ) -> tuple[Inventory, float, Repair | Ask | None]:
        """One round: recorded, carried; what stands where then, how long it took [s], and what has to be done
        before it could be, or, by a person, afterwards.
        """
        label, now = "put the board right", self._clock.now()
        self._note(faults, "arm", now)
        self._ui.say(f"{sentence_of(faults)}: {step.sentence}" if faults else step.sentence)
        self._record.found(known, sentence_of(faults) or "not everything is carried yet", now)
        self._record.task(Purpose.REPAIR, label, step.transfers, now)
        self.observer.forget_likeness()
        try:
            job = Job(label, step.transfers, misplaced=self._loose)
            carried = self._carrier.carry(job, step.believed, seen=self.observer.seen)
        except BoardTouched:
            return step.believed, 0.0, None
        except CarryFailed as failure:
            self._lost.forget(transfer.name for transfer in step.transfers[: failure.done])
            self.note_loss(failure)
            return failure.inventory, 0.0, None
        except PlanRefused as refused:
            if not self._carrier.untouched:
                raise
            return step.believed, 0.0, self._around(refused, step, faults)  # the fingers do not get at it
        self._lost.forget(transfer.name for transfer in step.transfers)
        self._attempts.set_down(step.transfers)
        # what a person would be asked for may be in sight now
        rest = None if isinstance(step.rest, Ask) else step.rest
        return step.believed.after_all(step.transfers), carried.done.duration, rest

    def _around(self, refused: PlanRefused, step: Repair, faults: Sequence[Fault]) -> Repair | Ask | None:
        """What makes room for a carry that was refused; None: the board wants another look."""
        self._loose = tuple(self.observer.misplaced(step.believed))
        cleared = self._clearing.around(refused, step, self._loose)
        return None if cleared is True else cleared or Ask(str(refused), squares_of(faults))

    def _ask(self, step: Ask, faults: Sequence[Fault], stands: Inventory) -> None:
        astray = [piece for piece in self._lost.astray(stands) if piece.name not in step.names]
        besides = f"; and {missing_ask(astray).sentence}" if astray else ""
        squares = tuple(str(square_place(square)) for square in step.squares)
        sentence, seen = step.sentence + besides, sentence_of(faults)
        if self._asked >= FRUITLESS and seen:
            sentence = (
                f"I have looked {self._asked} times since then, and still see that {seen}: {sentence}. Or say 'keep', "
                "and we continue with the board as it stands; 'quit', and 'touchmove resume' continues once "
                "everything is right; or 'new', and the arm sets up another game"
            )
        self._asked += 1
        told = self._asker.mend(sentence, squares, stands)
        self.observer.forget_likeness()
        self.observer.tell(told)
        self._lost.told((*step.names, *(piece.name for piece in astray)), stands)
        self._tried.clear()
        self._swung.clear()
        self._note(faults, "person", self._clock.now())

    def _note(self, faults: Iterable[Fault], by: RepairedBy, now: float) -> None:
        for fault in faults:
            self._record.trouble(fault.kind.value, (str(square_place(fault.square)),), fault.sentence, by, now)
