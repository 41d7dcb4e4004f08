"""The look after each job, and mending what is not as it should be: by the arm where it can, else by a person.

Each round looks at the board, finds out what stands where, and lets the arm carry what stands wrong; the next round
looks again. Every round is in the record before the arm moves, so that a program that goes on with the game knows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol

from app import UserError
from app.faces import Face
from app.game.carrier import Carrier, CarryFailed
from app.game.eyes import Eyes
from app.game.state import Job, moved_all
from app.manipulation import Inventory, Transfer
from app.rearrange import rearrange
from app.records import GameRecord
from app.records.events import Purpose
from hardware.interfaces import Clock
from hardware.table import Place, square_place
from vision.verify import Fault, FaultKind

MOST_ROUNDS: Final = 6
"""Of mending by the arm; what is not right then, it will not get right."""


class Asker(Protocol):
    """A person who can put the board right by hand."""

    def mend(self, sentence: str, squares: tuple[str, ...]) -> None:
        """Ask for it; returns when they say that it is done.

        Raises:
            UserError: nobody is there.
        """


@dataclass(frozen=True, slots=True)
class Mended:
    """What mending came to.

    Attributes:
        inventory: what stands where now.
        jobs: rounds in which something had to be moved, by the arm or by a person.
        duration: of what the arm did [s].
    """

    inventory: Inventory
    jobs: int
    duration: float


class Mender:
    """Looks, and puts right.

    Args:
        eyes: look.
        carrier: carries.
        asker: asks a person.
        record: of the game.
        face: shown what happens.
        clock: of the plant.
    """

    def __init__(
        self, eyes: Eyes, carrier: Carrier, asker: Asker, record: GameRecord, face: Face, clock: Clock
    ) -> None:
        self.eyes = eyes
        self._carrier, self._asker = carrier, asker
        self._record, self._face, self._clock = record, face, clock

    def note_loss(self, failure: CarryFailed) -> None:
        """The arm has lost a piece, or not got it: that is in the record, whatever comes of it."""
        self._face.phase(str(failure))
        squares = (str(failure.transfer.source), str(failure.transfer.target))
        self._record.trouble(failure.loss.value, squares, str(failure), None, self._clock.now())

    def mend(self, recorded: Inventory, stands: Inventory, wanted: Inventory) -> Mended:
        """Until the board shows what is wanted.

        Args:
            recorded: what stands where by the record.
            stands: what should stand where now, as far as is known.
            wanted: what shall stand where.

        Raises:
            UserError: a person is needed, and nobody is there; or it cannot be mended.
        """
        rounds, duration = 0, 0.0
        while True:
            faults = self.eyes.faults(stands)
            transfers = self._to_do(faults, stands, wanted)
            if transfers == ():
                return Mended(stands, rounds, duration)
            rounds += 1
            if rounds > MOST_ROUNDS:
                raise UserError(
                    f"the board is still not right after {MOST_ROUNDS} attempts ({_sentence(faults)}): put it right by "
                    "hand, then go on with 'touchmove resume'"
                )
            if transfers is None:
                self._ask(faults)
                stands = wanted
                continue
            stands, took = self._carry(recorded, stands, transfers, faults)
            duration += took

    def _to_do(self, faults: Sequence[Fault], stands: Inventory, wanted: Inventory) -> tuple[Transfer, ...] | None:
        """What the arm can do now towards what is wanted; None: nothing, a person has to help."""
        seen: dict[str, tuple[float, float]] = {}
        for fault in faults:
            piece = stands.at(square_place(fault.square))
            if fault.kind is not FaultKind.OFF_CENTRE or piece is None or fault.place is None:
                return None
            seen[piece.name] = fault.place
        return rearrange(stands, wanted, seen=seen)

    def _carry(
        self, recorded: Inventory, stands: Inventory, transfers: tuple[Transfer, ...], faults: Sequence[Fault]
    ) -> tuple[Inventory, float]:
        """One round: recorded, carried; what stands where then, and how long it took [s]."""
        label = "put the board right"
        now = self._clock.now()
        for fault in faults:
            self._record.trouble(fault.kind.value, (str(square_place(fault.square)),), fault.sentence, "arm", now)
        self._face.phase(f"{label}: {_sentence(faults)}" if faults else label)
        self._record.found(changed(recorded, stands), _sentence(faults) or "a piece was not carried", now)
        self._record.task(Purpose.REPAIR, label, transfers, now)
        try:
            carried = self._carrier.carry(Job(label, transfers), stands)
        except CarryFailed as failure:
            self.note_loss(failure)
            return failure.inventory, 0.0
        return moved_all(stands, transfers), carried.done.duration

    def _ask(self, faults: Sequence[Fault]) -> None:
        squares = tuple(str(square_place(fault.square)) for fault in faults)
        sentence = _sentence(faults)
        self._asker.mend(sentence, squares)
        for fault in faults:
            place = (str(square_place(fault.square)),)
            self._record.trouble(fault.kind.value, place, fault.sentence, "person", self._clock.now())


def _sentence(faults: Sequence[Fault]) -> str:
    return "; ".join(fault.sentence for fault in faults)


def changed(before: Inventory, after: Inventory) -> dict[str, Place]:
    """Where the pieces stand that stand elsewhere, by name."""
    places = {piece.name: piece.place for piece in before}
    return {piece.name: piece.place for piece in after if places[piece.name] != piece.place}
