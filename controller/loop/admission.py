"""Which motions are admitted, when a motion under way has met its guard, and how the last one ended."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.loop.memory import TickMemory
from controller.loop.motion import MotionBuffer
from controller.loop.playback import Playback
from controller.model.compiled import PAIR, ROW, STATUS, VECTOR, FloatArray, Vector, compiled_as, direct
from controller.protection.grip_and_touch import meets
from controller.protection.limits import Limits, Violation
from controller.protection.reference_check import SampleCheck
from controller.protocol.causes import Cause
from controller.protocol.datagram_fields import Guard, Result
from controller.protocol.messages import Announce
from controller.protocol.states import State
from controller.settings import ControllerSettings
from hardware.interfaces import Measurement, Triple

NOTHING = Violation(Cause.NONE, 0.0, 0.0)
PRESSED = Violation(Cause.STOP_PRESSED, 0.0, 0.0)


@compiled_as(STATUS(ROW, VECTOR, PAIR))
def note_peaks(peaks: FloatArray, torque: Vector, tactile: tuple[float, float]) -> int:
    """Torques [N m] and tactile forces [N] of a tick in which the arm moves; peaks of both, shape (2,)."""
    peaks[0] = max(peaks[0], abs(torque[0]), abs(torque[1]), abs(torque[2]))
    peaks[1] = max(peaks[1], tactile[0], tactile[1])
    return 0


_meets: Final = direct(meets)
_note_peaks: Final = direct(note_peaks)


class Latch:
    """What STOP closes, whoever has pressed it, and the client's RELEASE alone opens.

    Attributes:
        closed: no motion is admitted.
        presses: how often STOP was carried out since the start.
    """

    def __init__(self) -> None:
        self.closed, self.presses = False, 0

    def press(self) -> None:
        """STOP; pressing it again counts, and changes nothing else."""
        self.closed, self.presses = True, self.presses + 1

    def release(self, presses: int) -> None:
        """Open again, for a client that knows of so many presses: one that came since keeps it closed.

        So a RELEASE that is repeated, or late on its way, lifts no STOP that nobody has looked into.
        """
        self.closed = self.closed and presses != self.presses


class Ended(NamedTuple):
    """How the last motion ended; ticks, measured tool point [m] and finger position [m] at the end."""

    motion: int = 0
    result: Result = Result.NONE
    reason: Violation = NOTHING
    first_tick: int = 0
    end_tick: int = 0
    position: Triple = (0.0, 0.0, 0.0)
    finger_position: float = 0.0


class Admission:
    """Motions, from their announcement to their end.

    Attributes:
        motion: the announced motion and its samples.
        playback: how fast it is played.
        last_motion: highest motion id seen.
        ended: how the last motion ended.
        admitting: no hold is in force.
        latch: of STOP.
        awaiting: a FOLLOWED motion succeeded and the next one is not announced yet.
    """

    def __init__(
        self, settings: ControllerSettings, limits: Limits, period: float, memory: TickMemory | None = None
    ) -> None:
        memory = memory or TickMemory()
        self.motion = MotionBuffer(settings.capacity, SampleCheck(limits, period), memory)
        self.playback = Playback(limits, period, memory.playback)
        self.last_motion = 0
        self.ended = Ended()
        self.admitting, self.awaiting, self.latch = True, False, Latch()
        self._settings = settings
        self._guarding, self._peaks = memory.guarding, memory.peaks

    @property
    def peak_torque(self) -> float:
        """Largest torque commanded in the present, else the last motion [N m]."""
        return float(self._peaks[0])

    @property
    def peak_tactile(self) -> float:
        """Largest tactile force in the present, else the last motion [N]."""
        return float(self._peaks[1])

    def may_exchange(self, tick: int) -> bool:
        """False while a sample that the tick after this one needs, or the motion after a FOLLOWED one, is missing."""
        motion = self.motion.announced
        if motion is not None:
            return self.playback.last_needed(motion, tick + 1) < self.motion.received
        return not self.awaiting

    def refusal(self, motion: Announce, state: State, tick: int, *, retiring: bool) -> Violation | None:
        """The first reason against a motion, if any."""
        current, settings = self.motion.announced, self._settings
        lead = motion.first_tick - tick
        reasons = (
            (retiring, Cause.SHUTDOWN, 0, 0),
            (self.latch.closed, Cause.STOP_PRESSED, 0, 0),
            (current is not None, Cause.OCCUPIED, current.motion if current else 0, 0),
            (state is not State.HOLD, Cause.NOT_HOLDING, state, 0),
            (not self.admitting, Cause.NOT_ADMITTED, 0, 0),
            (not 1 <= motion.length <= settings.max_length, Cause.LENGTH, motion.length, settings.max_length),
            (lead <= 0, Cause.LATE, motion.first_tick, tick),
            (lead > settings.max_lead, Cause.TOO_EARLY, lead, settings.max_lead),
        )
        for holds, cause, value, limit in reasons:
            if holds:
                return Violation(cause, float(value), float(limit))
        return None

    def admit(self, motion: Announce, position: NDArray[np.float64]) -> None:
        """Take a motion on that begins at a reference, shape (3,) [m]."""
        self.motion.announce(motion, position)
        self.playback.begin()
        self._guarding[:] = self._peaks[:] = 0.0

    def note_peaks(self, torque: Triple, tactile: tuple[float, float]) -> None:
        """Torques [N m] and tactile forces [N] of a tick in which the arm moves."""
        _note_peaks(self._peaks, torque, tactile)

    def met(self, guard: float, level: float, tactile: tuple[float, float], lift: float) -> Result | Violation | None:
        """What a sample's guard says: how the motion has succeeded, why it has to stop, or nothing; see `meets`."""
        if not _meets(self._guarding, guard, level, tactile, lift):
            return None
        if guard == Guard.HELD:
            return Violation(Cause.GRIP_LOST, min(tactile), level)
        return Result.GRIPPED if guard == Guard.GRIP else Result.TOUCHED

    def end(self, result: Result, reason: Violation, measurement: Measurement, position: NDArray[np.float64]) -> bool:
        """The announced motion is over.

        Args:
            result: how.
            reason: why, where it did not succeed.
            measurement: of the tick in which it ended.
            position: of the tool then, measured, base frame (3,) [m].

        Returns:
            Whether another motion belongs to it.
        """
        motion = self.motion.announced
        assert motion is not None
        self.record(motion, result, reason, measurement, position)
        self.motion.clear()
        return motion.followed

    def record(
        self,
        motion: Announce,
        result: Result,
        reason: Violation,
        measurement: Measurement,
        position: NDArray[np.float64],
    ) -> None:
        """How a motion ended that need not have begun; as of ``end``."""
        x, y, z = position.tolist()
        self.ended = Ended(
            motion.motion, result, reason, motion.first_tick, measurement.tick, (x, y, z), measurement.finger_position
        )
