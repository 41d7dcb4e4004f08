"""What the law follows: at rest, along a motion's samples, or through a controlled stop."""

from __future__ import annotations

import struct
from typing import Final

import numpy as np
from numpy.typing import NDArray

from controller.loop.motion import MotionBuffer
from controller.loop.playback import Playback, blend
from controller.loop.stopping import StopPath, plan_stop
from controller.model.state import REFERENCE_SIZE
from controller.protection.reference_check import DAMPING, GUARD, GUARD_LEVEL, POSITION, STIFFNESS
from controller.settings import ControllerSettings

_RATES = slice(3, 9)
_BYTES: Final = 8 * REFERENCE_SIZE
_TAIL: Final = struct.Struct("=3d")
"""Of a sample behind the reference: velocity of the fingers, guard, its level."""


class Reference:
    """Position, velocity, acceleration and gains of one tick, and the velocity of the fingers.

    Attributes:
        row: shape (16,), as ``TaskSpaceController.torque`` takes it; rewritten every tick.
        finger_velocity: of each finger, positive opening [m/s].
    """

    def __init__(self, settings: ControllerSettings, period: float) -> None:
        self.row = np.zeros(REFERENCE_SIZE)
        self._bytes = self.row.data.cast("B")
        self.finger_velocity = 0.0
        self._settings = settings
        self._period = period
        self._tick = 0
        self._stop: StopPath | None = None
        self._stop_tick = 0

    @property
    def position(self) -> NDArray[np.float64]:
        """Shape (3,), base frame, a view [m]."""
        return self.row[POSITION]

    @property
    def stopping(self) -> bool:
        """Whether a controlled stop is under way."""
        return self._stop is not None

    def hold_at(self, position: NDArray[np.float64]) -> None:
        """Rest at a position (3,) [m] with the gains of the settings."""
        self.row[:] = 0.0
        self.row[POSITION] = position
        self.row[STIFFNESS] = self._settings.hold_stiffness
        self.row[DAMPING] = self._settings.hold_damping

    def follow(self, playback: Playback, samples: MotionBuffer) -> tuple[float, float]:
        """Take a motion's sample over, or what lies between two; returns its guard and the guard's level [N]."""
        index = int(playback.at)
        if playback.as_planned:
            sample = samples.sample(index)
            self._bytes[:] = sample[:_BYTES]
            self.finger_velocity, guard, level = _TAIL.unpack_from(sample, _BYTES)
            return guard, level
        before = samples.row(index)
        after = samples.row(index + 1) if playback.at > index else before
        share, period = playback.at - index, self._period
        self.finger_velocity = blend(before, after, share, period, playback.rate, playback.slope, self.row)
        return float(before[GUARD]), float(before[GUARD_LEVEL])

    def rest(self) -> None:
        """Rest where it is; gains and fingers stay, so that a grip persists."""
        self.row[_RATES] = 0.0

    def mark(self, tick: int) -> None:
        """Remember that this is the reference of a tick."""
        self._tick = tick

    def relax(self) -> None:
        """Gains firm enough to rest without a client; fingers may go on closing, not opening."""
        np.maximum(self.row[STIFFNESS], self._settings.stop_stiffness, out=self.row[STIFFNESS])
        np.maximum(self.row[DAMPING], self._settings.stop_damping, out=self.row[DAMPING])
        self.finger_velocity = min(0.0, self.finger_velocity)

    def comply_at(self, position: list[float]) -> None:
        """No stiffness and no tactile feedback: gravity and damping only; the fingers as in `relax`."""
        self.row[:] = 0.0
        self.row[POSITION] = position
        self.row[DAMPING] = self._settings.compliant_damping
        self.finger_velocity = min(0.0, self.finger_velocity)
        self._stop = None

    def rest_softly(self, position: list[float]) -> None:
        """Rest at a position [m] with the gains of a controlled stop, which a person can push aside."""
        self.row[:] = 0.0
        self.row[POSITION] = position
        self.row[STIFFNESS] = self._settings.stop_stiffness
        self.row[DAMPING] = self._settings.stop_damping

    def begin_stop(self) -> None:
        """Plan a controlled stop from the last marked tick on, unless one is under way."""
        if self._stop is None:
            r, settings = self.row, self._settings
            self._stop_tick = self._tick
            self._stop = plan_stop(r[0:3], r[3:6], r[6:9], settings.stop_acceleration, settings.stop_jerk)

    def slow_down(self, tick: int) -> bool:
        """The controlled stop's reference at a tick; true once it is over."""
        stop = self._stop
        assert stop is not None
        time = (tick - self._stop_tick) * self._period
        self.row[0:3], self.row[3:6], self.row[6:9] = stop.at(time)
        if time < stop.duration:
            return False
        self._stop = None
        return True

    def abandon(self) -> None:
        """Brakes close: no stop any more; the fingers as in ``relax``."""
        self._stop = None
        self.finger_velocity = min(0.0, self.finger_velocity)
