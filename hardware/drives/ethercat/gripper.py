"""The gripper's drive in cyclic synchronous velocity, and the fingers' forces from an analog terminal."""

import math

from hardware.drives.ethercat.axis import Facts
from hardware.drives.ethercat.cia402 import MODE_VELOCITY, DriveState, Wanted, control_word, reset_word, state_of
from hardware.drives.ethercat.presets import (
    DRIVE_INPUTS,
    TERMINAL_ERROR,
    TERMINAL_INPUTS,
    TERMINAL_VOLT,
    VELOCITY_OUTPUTS,
)
from hardware.drives.joint import FingerScale
from hardware.drives.settings import FingerSettings, ForceSettings

_RANGE = 0x0003
"""Under or over its range, in the status of a channel."""


class GripperAxis:
    """The fingers behind their drive.

    Attributes:
        state: of the drive, as it said last.
        position: z4 [m].
        error: the drive's error code.
    """

    def __init__(self, settings: FingerSettings, facts: Facts) -> None:
        self._scale = FingerScale.of(settings)
        self._rad_per_count, self._step = math.tau / facts.counts, facts.velocity_step
        self._pack, self._unpack = VELOCITY_OUTPUTS.packed.pack, DRIVE_INPUTS.packed.unpack
        self.state = DriveState.NOT_READY
        self.position, self.error = 0.0, 0
        self._control = 0

    def outputs(self, velocity: float, wanted: Wanted, *, reset: bool) -> bytes:
        """Process data for a velocity of each finger [m/s]."""
        if reset and self.state is DriveState.FAULT:
            self._control = reset_word(self._control)
        else:
            self._control = control_word(self.state, wanted)
        counts = round(self._scale.motor_velocity(velocity) / self._step)
        return self._pack(self._control, max(-(1 << 31), min((1 << 31) - 1, counts)), MODE_VELOCITY)

    def take(self, inputs: bytes) -> None:
        """Process data as they came."""
        status, position, _, _, self.error = self._unpack(inputs)
        self.state = state_of(status)
        self.position = self._scale.position(position * self._rad_per_count)


def forces_of(inputs: bytes, settings: tuple[ForceSettings, ForceSettings]) -> tuple[float, float]:
    """Forces on the right and the left pad [N] from a terminal's process data."""
    _, right, _, left = TERMINAL_INPUTS.packed.unpack(inputs)
    return settings[0].force(right / TERMINAL_VOLT), settings[1].force(left / TERMINAL_VOLT)


def dead_channel(inputs: bytes) -> int:
    """Number of a channel whose value is not valid, 0 if both are; one beyond its range only presses hard."""
    first, _, second, _ = TERMINAL_INPUTS.packed.unpack(inputs)
    for number, status in enumerate((first, second), 1):
        if status & TERMINAL_ERROR and not status & _RANGE:
            return number
    return 0
