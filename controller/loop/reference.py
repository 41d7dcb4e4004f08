"""What the law follows: at rest, along a motion's samples, or through a controlled stop."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from controller.loop.memory import MARKED, TickMemory
from controller.protection.reference_check import DAMPING, POSITION, STIFFNESS
from controller.protection.stopping import StopPath, plan_stop
from controller.settings import ControllerSettings

_RATES = slice(3, 9)


class Reference:
    """Position, velocity, acceleration and gains of one tick, and the velocity of the fingers.

    Attributes:
        row: shape (16,), as ``TaskSpaceController.torque`` takes it; rewritten every tick.
        tail: velocity of each finger [m/s], guard and its level [N], as the last sample had them, shape (3,).
    """

    def __init__(self, settings: ControllerSettings, period: float, memory: TickMemory) -> None:
        self.row, self.tail = memory.reference, memory.tail
        self._block = memory.block
        self._settings = settings
        self._period = period
        self._stop: StopPath | None = None
        self._stop_tick = 0

    @property
    def finger_velocity(self) -> float:
        """Of each finger, positive opening [m/s]."""
        return float(self.tail[0])

    @finger_velocity.setter
    def finger_velocity(self, velocity: float) -> None:
        self.tail[0] = velocity

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

    def rest(self) -> None:
        """Rest where it is; gains and fingers stay, so that a grip persists."""
        self.row[_RATES] = 0.0

    def mark(self, tick: int) -> None:
        """Remember that this is the reference of a tick."""
        self._block[MARKED] = tick

    def relax(self) -> None:
        """Gains firm enough to rest without a client; fingers may go on closing, not opening."""
        np.maximum(self.row[STIFFNESS], self._settings.stop_stiffness, out=self.row[STIFFNESS])
        np.maximum(self.row[DAMPING], self._settings.stop_damping, out=self.row[DAMPING])
        self.finger_velocity = min(0.0, self.finger_velocity)

    def comply_at(self, position: list[float], fence: list[float]) -> None:
        """No stiffness and no tactile feedback: gravity and damping only; the fingers as in `relax`.

        Beyond the fence a spring of limited force, critically damped, pulls the tool back: who pushes it on shall not
        come to a pose in which the arm cannot be controlled.

        Args:
            position: of the tool [m].
            fence: the nearest point where no spring acts [m].
        """
        settings = self._settings
        off = math.dist(position, fence)
        share = min(1.0, settings.fence_stretch / off) if off > 0.0 else 0.0
        self.row[:] = 0.0
        self.row[POSITION] = [at + share * (to - at) for at, to in zip(position, fence, strict=True)]
        self.row[STIFFNESS] = settings.fence_stiffness if off > 0.0 else 0.0
        self.row[DAMPING] = 2.0 * math.sqrt(settings.fence_stiffness) if off > 0.0 else settings.compliant_damping
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
            self._stop_tick = int(self._block[MARKED])
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
