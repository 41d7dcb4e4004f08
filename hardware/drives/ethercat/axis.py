"""One servomotor's drive: from process data to a joint's angle and velocity, and from a torque to process data.

What its data say is watched here, too: an encoder that jumps, and a torque that is not followed.
"""

import math
from typing import Final, NamedTuple

from hardware.drives.ethercat.cia402 import MODE_TORQUE, DriveState, Wanted, control_word, limited, reset_word, state_of
from hardware.drives.ethercat.presets import DRIVE_INPUTS, TORQUE_OUTPUTS
from hardware.drives.faults import Finding
from hardware.drives.joint import JointScale
from hardware.drives.rating import TorqueRating
from hardware.drives.settings import JointSettings, VelocitySource
from hardware.drives.velocity import estimate_of
from hardware.interfaces import DriveTrouble
from hardware.parameters import Drive

JUMP: Final = 0.005
"""An encoder that is so far from where its velocity leads [rad]: 1 mm at the tool …"""
JERKIEST: Final = 500.0
"""… and what the peak torque could make of it in the time between two readings [rad/s²]."""
UNFOLLOWED: Final = 0.15
"""A torque that is missing or too much, as a share of the rated one …"""
PATIENCE: Final = 0.020
"""… for so long [s] is not followed."""
_DELAY: Final = 3
"""Cycles within which a drive gives a torque and says so."""
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
        self._scale = JointScale.of(settings)
        self._rad_per_count = math.tau / facts.counts
        self._velocity_step = facts.velocity_step
        self._rated = facts.rated_torque
        self._thousandths = 1000.0 / facts.rated_torque
        self._fastest = 2.0 * drive.max_speed
        self._rating = TorqueRating(settings, drive)
        self._estimate = estimate_of(settings) if settings.velocity is VelocitySource.POSITION else None
        self._pack, self._unpack = TORQUE_OUTPUTS.packed.pack, DRIVE_INPUTS.packed.unpack
        self.state = DriveState.NOT_READY
        self.angle = self.velocity = 0.0
        self.error, self.cut = 0, False
        self._control = 0
        self._asked: list[float] = [0.0] * _DELAY
        self._missing = 0.0
        self._began = False

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
        del self._asked[0]
        self._asked.append(motor if self.state is DriveState.ENABLED and wanted is Wanted.RUN else 0.0)
        counts = max(-32768, min(32767, round(motor * self._thousandths)))
        return self._pack(self._control, counts, MODE_TORQUE)

    def take(self, inputs: bytes, elapsed: float) -> Finding | None:
        """Process data as they came so long after the ones before [s]; what they tell that is wrong."""
        status, position, velocity, torque, self.error = self._unpack(inputs)
        ran, self.state = self.state is DriveState.ENABLED, state_of(status)
        self.cut = self.cut or limited(status)
        motor, speed = position * self._rad_per_count, velocity * self._velocity_step
        angle, said = self._scale.angle(motor), self._scale.velocity(speed)
        trouble = self._watch_encoder(angle, said, elapsed)
        if self._estimate is not None:
            said = self._estimate.take(angle, elapsed)
        self.angle, self.velocity, self._began = angle, said, True
        if ran and self.state is DriveState.ENABLED:
            trouble = trouble or self._watch_torque(torque / self._thousandths, elapsed)
        else:
            self._missing = 0.0
        return trouble

    def _watch_encoder(self, angle: float, velocity: float, elapsed: float) -> Finding | None:
        if not self._began or elapsed <= 0.0:
            return None
        led = 0.5 * (velocity + self.velocity) * elapsed
        off = abs(angle - self.angle - led) if self._estimate is None else 0.0
        most = JUMP + JERKIEST * elapsed * elapsed
        moved = abs(angle - self.angle)
        farthest = JUMP + self._fastest * elapsed
        if off <= most and moved <= farthest:
            return None
        seen, limit = (off, most) if off > most else (moved, farthest)
        return Finding(
            DriveTrouble.ENCODER_JUMPED,
            f"by {seen:.4f} rad within {elapsed * 1e3:.1f} ms, at most {limit:.4f} rad is possible",
        )

    def _watch_torque(self, given: float, elapsed: float) -> Finding | None:
        off = min(abs(given - asked) for asked in self._asked)
        if off <= UNFOLLOWED * self._rated:
            self._missing = 0.0
            return None
        self._missing += elapsed
        if self._missing < PATIENCE:
            return None
        return Finding(
            DriveTrouble.TORQUE_NOT_FOLLOWED,
            f"asked for {self._asked[-1]:.2f} N m at the motor, it says {given:.2f} N m, "
            f"for {self._missing * 1e3:.0f} ms",
        )

    def begin_anew(self) -> None:
        """What was seen before does not count: nobody has looked for a while."""
        self._began, self._missing = False, 0.0
