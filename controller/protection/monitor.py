"""Protection that looks at how the arm is doing, tick by tick, below the law and independent of it.

Pure checks of single numbers are in `controller.protection.limits`; here is what needs the ticks before: durations,
means over a window. Whatever is found names its cause; what follows from it is
`REACTIONS`. A quick look, `controller.protection.screening`, tells the ticks in which nothing is to be found.
"""

from __future__ import annotations

import math

import numpy as np

from controller.model.compiled import FloatArray
from controller.protection.encoders import Encoders
from controller.protection.limits import Limits, Violation, axis_beyond, check_joints, nearest_inside
from controller.protection.screening import Screen
from controller.protocol.causes import Cause
from hardware.interfaces import Measurement, Triple


class Overload:
    """Tells when something has been above its limit for longer than it may.

    Args:
        limit: what may be exceeded for a while only.
        ticks: how long [ticks].
    """

    def __init__(self, limit: float, ticks: int) -> None:
        self._limit, self._allowed, self._ticks = limit, ticks, 0

    def lasts(self, value: float) -> bool:
        """Take a tick's value in; true from the tick on in which it has lasted too long."""
        self._ticks = self._ticks + 1 if value > self._limit else 0
        return self._ticks > self._allowed

    @property
    def begun(self) -> bool:
        """It was above its limit in the last tick."""
        return self._ticks > 0

    def reset(self) -> None:
        """Forget."""
        self._ticks = 0


class MeanTorque:
    """Root of the mean square of each servomotor's torque, old ticks fading as the motor cools.

    Args:
        limit: what the servomotors are rated for [N m].
        window: time constant of the fading [s].
        period: of a tick [s].
        squares: where the mean squares are kept, shape (3,); by default an array of its own [N² m²].
    """

    def __init__(self, limit: float, window: float, period: float, squares: FloatArray | None = None) -> None:
        self._limit, self._share = limit, 1.0 - math.exp(-period / window)
        self.squares = np.zeros(3) if squares is None else squares
        """Mean squares [N² m²]."""

    def check(self, torque: Triple) -> Violation | None:
        """Take a tick's torque [N m] in."""
        squares, share = self.squares, self._share
        for i in (0, 1, 2):
            squares[i] += share * (torque[i] * torque[i] - squares[i])
        worst = float(squares.max())
        if worst <= self._limit * self._limit:
            return None
        return Violation(Cause.RMS_TORQUE, math.sqrt(worst), self._limit)


class Protection:
    """All checks that need the ticks before.

    Args:
        limits: of the protection.
        period: of a tick [s].
        screening: memory of the quick look, see `Screen`; by default an array of its own.
        encoders: that of the encoders, see `Encoders`; the same.
    """

    def __init__(
        self,
        limits: Limits,
        period: float,
        screening: FloatArray | None = None,
        encoders: FloatArray | None = None,
    ) -> None:
        self._limits = limits
        self._screen = Screen(limits, period, screening)
        self._encoders = Encoders(limits, period, encoders)
        self._mean = MeanTorque(limits.rms_torque, limits.rms_window, period, self._screen.squares)
        self._pressing = Overload(limits.press_force, limits.force_ticks)
        self._gripping = Overload(limits.grip_force, limits.force_ticks)

    def joints(self, measurement: Measurement, reference: Triple, rates: FloatArray) -> Violation | None:
        """What no law can be trusted with: encoders, speed and range of the servomotors; see `Encoders.check`."""
        return self._encoders.check(measurement, reference, rates) or check_joints(measurement, self._limits)

    def well(
        self, state: FloatArray, reference: FloatArray, force: Triple, tactile: tuple[float, float], torque: Triple
    ) -> bool:
        """Whether `tool`, `fingers`, `motors` and `check_tracking` have nothing to say of a tick; then it is taken in.

        Args:
            state: all that the law knows of the arm, shape (27, 3).
            reference: shape (16,) or longer.
            force: on the tool [N].
            tactile: forces on the pads [N].
            torque: of the last exchange [N m].
        """
        if not self._screen.arm(state, reference, force, tactile, torque):
            return False
        self.nothing_lasts()
        return True

    @property
    def heat(self) -> float:
        """Mean square of the torque of the warmest servomotor, as a share of what it is rated for."""
        return self._screen.heat

    @property
    def something_lasts(self) -> bool:
        """Whether a force has been above its limit in the last tick, though not yet for too long."""
        return self._pressing.begun or self._gripping.begun

    def nothing_lasts(self) -> None:
        """A tick in which no force was above its limit."""
        self._pressing.reset()
        self._gripping.reset()

    def tool(self, position: list[float], velocity: list[float], force: Triple) -> Violation | None:
        """Where the tool is [m], how fast it moves [m/s], and how it presses [N]."""
        limits = self._limits
        outside = axis_beyond(position, limits)
        if not outside <= limits.outside:
            return Violation(Cause.TOOL_OUTSIDE, outside, limits.outside)
        x, y, z = velocity
        speed = math.sqrt(x * x + y * y + z * z)
        if not speed <= limits.tool_speed:
            return Violation(Cause.TOOL_SPEED, speed, limits.tool_speed)
        a, b, c = force
        press = math.sqrt(a * a + b * b + c * c)
        if self._pressing.lasts(press):
            return Violation(Cause.PRESSING, press, limits.press_force)
        return None

    def nearest_inside(self, position: list[float]) -> Triple:
        """Where in the workspace a tool would be that is pushed out of it, (3,) [m]."""
        return nearest_inside(position, self._limits)

    def fingers(self, tactile: tuple[float, float]) -> Violation | None:
        """What the pads feel [N]: a grip is what both feel."""
        limits, largest, grip = self._limits, max(tactile), min(tactile)
        if largest > limits.tactile:
            return Violation(Cause.TACTILE_OVERLOAD, largest, limits.tactile)
        if self._gripping.lasts(grip):
            return Violation(Cause.GRIP_FORCE, grip, limits.grip_force)
        return None

    def motors(self, torque: Triple) -> Violation | None:
        """What the servomotors give on average [N m]."""
        return self._mean.check(torque)

    def reset(self) -> None:
        """The arm was on its brakes: forget durations and angles; the motors' warmth stays."""
        self._encoders.reset()
        self.nothing_lasts()
