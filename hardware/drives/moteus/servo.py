"""One servomotor behind its controller: what it is told in an exchange, and what its answers make of the joint."""

import math
from enum import Enum, auto, unique
from typing import Final

from hardware.drives.faults import DriveFinding
from hardware.drives.joint import JointScale
from hardware.drives.moteus.cycle import Controller, Told
from hardware.drives.moteus.registers import Mode, fault_words
from hardware.drives.rating import TorqueRating
from hardware.drives.settings import JointSettings, VelocitySource
from hardware.drives.velocity import estimate_of
from hardware.drives.watches import EncoderReading, EncoderWatch, TorqueWatch
from hardware.interfaces import DriveTrouble
from hardware.parameters import Drive

_LATE: Final = 1.5
"""A watchdog that has not bitten after its time-out, and half of it for what USB and CAN may add, does not bite."""

_FASTER, _FASTER_BY = 1.2, 0.5
"""A joint that is held only gets slower; one that is so many times as fast as at the start, and by so much on top
[rad/s], runs away from its place: encoder and torque have opposite signs."""


@unique
class ServoAction(Enum):
    """What a servomotor is to do."""

    OFF = auto()
    """Nothing; this clears its faults."""
    SHORT = auto()
    """Its phases are shorted, which damps."""
    HOLD = auto()
    """Stay where it is, by its own position loop."""
    RUN = auto()
    """Give the torque that it is asked for."""


class ServoJoint:
    """A joint behind its controller.

    Attributes:
        told: its last answer; None before the first.
        angle, velocity: of the joint [rad, rad/s]; the angle is no number before the first answer.
        cut: the last torque was cut.
    """

    def __init__(self, controller: Controller, settings: JointSettings, drive: Drive, watchdog: float) -> None:
        self.told: Told | None = None
        self.angle, self.velocity, self.cut = math.nan, 0.0, False
        self._controller, self._watchdog = controller, watchdog
        self._scale = scale = JointScale.of(settings)
        self._rating = TorqueRating(settings, drive)
        self._estimate = estimate_of(settings) if settings.velocity is VelocitySource.POSITION else None
        self._encoder = EncoderWatch(settings, drive)
        self._followed = TorqueWatch(settings, abs(scale.motor_torque(settings.rms(drive))))
        self._held = self._fastest = math.nan
        self._unread = 0.0

    @property
    def mode(self) -> int:
        """As it said last; stopped if it never did."""
        return Mode.STOPPED if self.told is None else self.told.mode

    def frame(self, wanted: ServoAction, torque: float, elapsed: float, pump: int) -> bytes:
        """The line that tells it, so long after the one before [s]; ``pump``: state of its digital outputs."""
        if wanted is not ServoAction.HOLD:
            self._held = math.nan
        elif self._runs_away():
            wanted = ServoAction.SHORT
        if wanted is ServoAction.RUN:
            temperature = math.nan if self.told is None else self.told.temperature
            rated = self._rating.rate(torque, temperature, elapsed)
            self.cut, motor = rated.cut, self._scale.motor_torque(rated.torque)
            self._followed.ask(motor)
            return self._controller.torque(motor, pump)
        self._rating.rest(elapsed)
        self._followed.ask(None)
        self.cut = wanted is ServoAction.HOLD and abs(torque) > self._rating.peak
        if wanted is ServoAction.HOLD and self.told is not None:
            if math.isnan(self._held):
                self._held, self._fastest = self.told.angle, _FASTER * abs(self.velocity) + _FASTER_BY
            return self._controller.hold(self._held, pump)
        return self._controller.mode(Mode.BRAKE if wanted is ServoAction.SHORT else Mode.STOPPED, pump)

    def _runs_away(self) -> bool:
        """While it is held: faster than it can be, and from then on. Shorted phases damp in any case."""
        if math.isnan(self._held) or abs(self.velocity) <= self._fastest:
            return False
        self._fastest = -1.0
        return True

    def coast(self, elapsed: float) -> None:
        """It has not answered: it is taken to have moved on as it did."""
        self._unread += elapsed
        self.angle += self.velocity * elapsed

    def lose(self, elapsed: float) -> None:
        """It does not answer, and that is a fault: how fast it turns nobody knows, and it is not said to turn [s]."""
        self._unread += elapsed
        self.velocity = 0.0

    def take(self, told: Told, sent: float, answered: float, elapsed: float) -> DriveFinding | None:
        """Its answer, which came between two moments, so long after the exchange before [s]; what is wrong with it."""
        before, self.told = self.mode, told
        angle, velocity = self._scale.angle(told.angle), self._scale.velocity(told.velocity)
        jumped = self._encoder.see(EncoderReading(angle, velocity, sent, answered))
        unread, self._unread = self._unread + elapsed, 0.0
        if self._estimate is not None:
            velocity = self._estimate.take(angle, unread)
        self.angle, self.velocity = angle, velocity
        return self._asleep(before, elapsed) or jumped or self._follows(told, unread)

    def _asleep(self, before: int, elapsed: float) -> DriveFinding | None:
        if elapsed <= _LATE * self._watchdog or not before == self.mode == Mode.POSITION:
            return None
        seen = f"{elapsed * 1e3:.0f} ms without a command, limit {self._watchdog * 1e3:.0f} ms"
        return DriveFinding(DriveTrouble.WATCHDOG_DEAD, seen)

    def _follows(self, told: Told, elapsed: float) -> DriveFinding | None:
        if told.mode != Mode.POSITION:
            self._followed.begin_anew()
            return None
        return self._followed.see(told.torque, elapsed, fault_words(told.code) if told.code else "")
