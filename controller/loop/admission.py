"""Which motions are admitted, when a motion under way has met its guard, and how the last one ended."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.loop.motion import MotionBuffer
from controller.loop.playback import Playback
from controller.protection.limits import Limits, Violation
from controller.protection.reference_check import SampleCheck
from controller.protocol.causes import Cause
from controller.protocol.layout import Guard, Result
from controller.protocol.messages import Announce
from controller.protocol.states import State
from controller.settings import ControllerSettings
from hardware.interfaces import Measurement, Triple

NOTHING = Violation(Cause.NONE, 0.0, 0.0)
PRESSED = Violation(Cause.STOP_PRESSED, 0.0, 0.0)
_LOOSE_TICKS = 5
"""A piece that swings in the fingers may leave a pad for less: 4.4 ms."""


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
        peak_torque: largest torque commanded in the present, else the last motion [N m].
        peak_tactile: largest tactile force in the present, else the last motion [N].
    """

    def __init__(self, settings: ControllerSettings, limits: Limits, period: float) -> None:
        self.motion = MotionBuffer(settings.capacity, SampleCheck(limits, period))
        self.playback = Playback(limits, period)
        self.last_motion = 0
        self.ended = Ended()
        self.admitting, self.awaiting, self.latch = True, False, Latch()
        self.peak_torque = self.peak_tactile = 0.0
        self._settings = settings
        self._guarding, self._loose = False, 0
        self._untouched = 0.0

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
        self._guarding, self._loose = False, 0
        self.peak_torque = self.peak_tactile = 0.0

    def note_peaks(self, torque: Triple, tactile: tuple[float, float]) -> None:
        """Torques [N m] and tactile forces [N] of a tick in which the arm moves."""
        (a, b, c), (right, left), most = torque, tactile, self.peak_torque
        if not (-most <= a <= most and -most <= b <= most and -most <= c <= most):
            self.peak_torque = max(most, a, -a, b, -b, c, -c)
        if right > self.peak_tactile or left > self.peak_tactile:
            self.peak_tactile = max(right, left)

    def met(self, guard: float, level: float, tactile: tuple[float, float], lift: float) -> Result | Violation | None:
        """What a sample's guard says: how the motion has succeeded, why it has to stop, or nothing.

        Args:
            guard: of ``Guard``, as the sample has it.
            level: its force [N].
            tactile: what both pads feel [N].
            lift: force on the tool along z3 [N].
        """
        right, left = tactile
        if guard == Guard.GRIP and right >= level and left >= level:
            return Result.GRIPPED
        if guard == Guard.TOUCH and self._touches(level, lift):
            return Result.TOUCHED
        if guard == Guard.HELD and self._loses(min(right, left), level):
            return Violation(Cause.GRIP_LOST, min(right, left), level)
        return None

    def _touches(self, level: float, lift: float) -> bool:
        """Whether the table pushes the tool up (to -z3) by so much more than when the guard began [N]."""
        if not self._guarding:
            self._guarding, self._untouched = True, lift
        return self._untouched - lift >= level

    def _loses(self, felt: float, level: float) -> bool:
        """Whether a pad has felt less than this for so long that nothing is held any more [N]."""
        self._loose = self._loose + 1 if felt < level else 0
        return self._loose >= _LOOSE_TICKS

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
