"""One servomotor's drive: from process data to a joint's angle and velocity, and from a torque to process data."""

import math
from typing import Final, NamedTuple

from hardware.drives.ethercat.cia402 import MODE_TORQUE, DriveState, Wanted, control_word, limited, reset_word, state_of
from hardware.drives.ethercat.presets import DRIVE_INPUTS, TORQUE_OUTPUTS
from hardware.drives.faults import DriveFinding
from hardware.drives.joint import JointScale
from hardware.drives.rating import TorqueRating
from hardware.drives.settings import JointSettings, VelocitySource
from hardware.drives.velocity import estimate_of
from hardware.drives.watches import EncoderReading, EncoderWatch, TorqueWatch
from hardware.parameters import Drive

_NO_TEMPERATURE: Final = math.nan
"""CiA 402 has no object for it: drives say by their error code that they are too hot."""


class Facts(NamedTuple):
    """What a drive says of itself at the start."""

    counts: int
    """Of the encoder for a turn of the motor."""
    rated_torque: float
    """At the motor's shaft [N m]."""
    velocity_step: float
    """Unit of its velocities [rad/s]."""


class ServoAxis:
    """A joint behind its drive.

    Attributes:
        state: of the drive, as it said last.
        angle, velocity: of the joint [rad, rad/s].
        error: the drive's error code.
        cut: torque was cut, here or in the drive.
    """

    def __init__(self, settings: JointSettings, drive: Drive, facts: Facts) -> None:
        self._scale, self._period = JointScale.of(settings), drive.tick
        self._rad_per_count = math.tau / facts.counts
        self._velocity_step = facts.velocity_step
        self._thousandths = 1000.0 / facts.rated_torque
        self._encoder = EncoderWatch(settings, drive)
        self._followed = TorqueWatch(settings, facts.rated_torque)
        self._rating = TorqueRating(settings, drive)
        self._estimate = estimate_of(settings) if settings.velocity is VelocitySource.POSITION else None
        self._pack, self._unpack = TORQUE_OUTPUTS.packed.pack, DRIVE_INPUTS.packed.unpack
        self.state = DriveState.NOT_READY
        self.angle = self.velocity = 0.0
        self.error, self.cut = 0, False
        self._control, self._unread = 0, 0.0

    def outputs(self, torque: float, wanted: Wanted, elapsed: float, *, reset: bool) -> bytes:
        """Process data for a joint's torque [N m]; ``reset``: a fault of the drive is to be reset."""
        if reset and self.state is DriveState.FAULT:
            self._control = reset_word(self._control)
        else:
            self._control = control_word(self.state, wanted)
        if wanted is Wanted.OFF:
            torque = 0.0
        rated = self._rating.rate(torque, _NO_TEMPERATURE, elapsed)
        self.cut = rated.cut
        motor = self._scale.motor_torque(rated.torque)
        self._followed.ask(motor if self.state is DriveState.ENABLED and wanted is Wanted.RUN else None)
        counts = max(-32768, min(32767, round(motor * self._thousandths)))
        return self._pack(self._control, counts, MODE_TORQUE)

    def angle_in(self, inputs: bytes) -> float:
        """The joint's angle in process data [rad]."""
        return self._scale.angle(self._unpack(inputs)[1] * self._rad_per_count)

    def take(self, inputs: bytes, sent: float, answered: float, elapsed: float) -> DriveFinding | None:
        """Process data that came between two moments, made so long after the ones before [s]; what is wrong with
        them.
        """
        status, position, velocity, torque, self.error = self._unpack(inputs)
        self.state = state_of(status)
        self.cut = self.cut or limited(status)
        motor, speed = position * self._rad_per_count, velocity * self._velocity_step
        angle, said = self._scale.angle(motor), self._scale.velocity(speed)
        # a drive latches its inputs once a period, so they may be that old when the frame takes them along
        wrong = self._encoder.see(EncoderReading(angle, said, sent - self._period, answered))
        unread, self._unread = self._unread + elapsed, 0.0
        if self._estimate is not None:
            said = self._estimate.take(angle, unread)
        self.angle, self.velocity = angle, said
        return wrong or self._followed.see(torque / self._thousandths, elapsed)

    def lose(self, elapsed: float) -> None:
        """It does not answer, and that is a fault: how fast it turns nobody knows, and it is not said to turn [s]."""
        self._unread += elapsed
        self.velocity = 0.0

    def begin_anew(self) -> None:
        """What was seen before does not count: nobody has looked for a while."""
        self._encoder.begin_anew()
        self._followed.begin_anew()
