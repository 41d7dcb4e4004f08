"""Protection of the reference: whether a motion's samples lie within the limits and form one smooth path."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.causes import Cause
from controller.protocol.layout import Guard
from controller.safety import Limits, Violation

POSITION = slice(0, 3)
VELOCITY = slice(3, 6)
ACCELERATION = slice(6, 9)
STIFFNESS = slice(9, 12)
DAMPING = slice(12, 15)
TACTILE_GAIN = 15
FINGER_VELOCITY = 16
GUARD = 17
GUARD_LEVEL = 18
COLUMNS = 19
"""Columns of a sample as a row of float64, in the order of the wire."""


class SampleCheck:
    """Checks rows of samples against the limits.

    Args:
        limits: what to check against.
        period: length of one tick [s].
    """

    def __init__(self, limits: Limits, period: float) -> None:
        self.limits = limits
        self._period = period
        self._middle, self._range = _ranges(limits)
        self._half = self._range
        self._reference = np.zeros(3)
        self._norm_bounds = np.array([limits.reach, limits.speed, limits.acceleration])
        self._down_bound = np.array([limits.downward_speed])
        self._step_bounds = np.repeat([limits.position_step, limits.velocity_step], 3)

    def begin(self, reference: NDArray[np.float64]) -> None:
        """A new motion starts at this reference, shape (3,) [m].

        If a stop or a hand left the arm outside the box, the motion may be as far outside on its way back.
        """
        self._reference = reference.copy()
        self._half = self._range.copy()
        outside = np.abs(reference - self._middle[POSITION]) + self.limits.start_position
        np.maximum(self._half[POSITION], outside, out=self._half[POSITION])
        axis_distance = math.hypot(reference[0], reference[1]) + self.limits.start_position
        self._norm_bounds[0] = max(self.limits.reach, axis_distance)

    def rows(self, rows: NDArray[np.float64], previous: NDArray[np.float64] | None) -> Violation | None:
        """The first violation in consecutive rows (n, 19), or ``None``.

        Args:
            rows: samples as float64, columns as on the wire.
            previous: the row (19,) before them, ``None`` at the start of a motion.
        """
        # one comparison covers every column with a range; NaN fails it too
        within = np.abs(rows - self._middle) <= self._half
        if np.count_nonzero(within) < within.size:  # a fifth of the price of all()
            return self._out_of_range(rows)
        return self._norms(rows) or self._steps(rows, previous)

    def start(self, row: NDArray[np.float64]) -> Violation | None:
        """Whether a motion's first row (19,) continues the reference at rest."""
        limits = self.limits
        for cause, vector, limit in (
            (Cause.START_POSITION, row[POSITION] - self._reference, limits.start_position),
            (Cause.START_VELOCITY, row[VELOCITY], limits.start_velocity),
            (Cause.START_ACCELERATION, row[ACCELERATION], limits.start_acceleration),
        ):
            length = math.sqrt(float(vector @ vector))
            if not length <= limit:
                return Violation(cause, length, limit)
        return None

    def end(self, row: NDArray[np.float64]) -> Violation | None:
        """Whether a motion's last row (19,) is at rest."""
        speed = math.sqrt(float(row[VELOCITY] @ row[VELOCITY]))
        return (
            Violation(Cause.ENDS_MOVING, speed, self.limits.end_velocity) if speed > self.limits.end_velocity else None
        )

    def _out_of_range(self, rows: NDArray[np.float64]) -> Violation:
        outside = ~(np.abs(rows - self._middle) <= self._half)
        offset = int(np.argmax(outside.any(axis=1)))
        row, column = rows[offset], int(np.argmax(outside[offset]))
        if not np.isfinite(row).all():
            return Violation(Cause.NOT_FINITE, float(offset), 0.0, offset)
        if column < VELOCITY.start:
            away = abs(float(row[column]) - float(self._middle[column]))
            return Violation(Cause.WORKSPACE, away, float(self._half[column]), offset)
        return Violation(
            _COLUMN_CAUSE[column], float(row[column]), float(self._middle[column] + self._half[column]), offset
        )

    def _norms(self, rows: NDArray[np.float64]) -> Violation | None:
        """Lengths of vectors: from the base's axis, of velocity, of acceleration, and downward speed near the board."""
        lengths = np.sqrt((rows[:, :9] * rows[:, :9]) @ _GROUPS)
        found = _first(lengths, self._norm_bounds, (Cause.REACH, Cause.SPEED, Cause.ACCELERATION))
        if found is not None:
            return found
        down = rows[:, 5] * (rows[:, 2] >= self.limits.near_depth)
        return _first(down[:, None], self._down_bound, (Cause.DOWNWARD_SPEED,))

    def _steps(self, rows: NDArray[np.float64], previous: NDArray[np.float64] | None) -> Violation | None:
        """Whether positions follow from velocities and velocities from accelerations (trapezoidal rule)."""
        motion = rows[:, :9] if previous is None else np.concatenate((previous[None, :9], rows[:, :9]))
        before, after = motion[:-1], motion[1:]
        excess = np.abs(after[:, :6] - before[:, :6] - 0.5 * self._period * (after[:, 3:] + before[:, 3:]))
        found = _first(excess, self._step_bounds, _STEP_CAUSES)
        if found is None or previous is not None:
            return found
        return found._replace(offset=found.offset + 1)


_GROUPS = np.zeros((9, 3))
"""Sums squares of columns: position across the axis, velocity, acceleration."""
_GROUPS[0:2, 0] = _GROUPS[3:6, 1] = _GROUPS[6:9, 2] = 1.0

_STEP_CAUSES = (Cause.POSITION_STEP,) * 3 + (Cause.VELOCITY_STEP,) * 3


def _first(values: NDArray[np.float64], bounds: NDArray[np.float64], causes: Sequence[Cause]) -> Violation | None:
    """The first row of ``values`` (n, m) beyond one of its ``bounds`` (m,), if any."""
    beyond = values > bounds
    if np.count_nonzero(beyond) == 0:
        return None
    offset = int(np.argmax(beyond.any(axis=1)))
    column = int(np.argmax(beyond[offset]))
    return Violation(causes[column], float(values[offset, column]), float(bounds[column]), offset)


_COLUMN_CAUSE: dict[int, Cause] = {
    **dict.fromkeys(range(3, 6), Cause.SPEED),
    **dict.fromkeys(range(6, 9), Cause.ACCELERATION),
    **dict.fromkeys(range(9, 12), Cause.STIFFNESS),
    **dict.fromkeys(range(12, 15), Cause.DAMPING),
    TACTILE_GAIN: Cause.TACTILE_GAIN,
    FINGER_VELOCITY: Cause.FINGER_SPEED,
    GUARD: Cause.GUARD,
    GUARD_LEVEL: Cause.GUARD,
}


def _ranges(limits: Limits) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Middle and half width of the permitted range of each column, shapes (19,)."""
    low, high = np.zeros(COLUMNS), np.zeros(COLUMNS)
    low[POSITION] = np.subtract(limits.centre, limits.half_size)
    high[POSITION] = np.add(limits.centre, limits.half_size)
    low[VELOCITY], high[VELOCITY] = -limits.speed, limits.speed
    low[ACCELERATION], high[ACCELERATION] = -limits.acceleration, limits.acceleration
    high[STIFFNESS] = limits.stiffness
    high[DAMPING] = limits.damping
    high[TACTILE_GAIN] = limits.tactile_gain
    # the wire carries single precision: let a value equal to its limit pass
    low[FINGER_VELOCITY], high[FINGER_VELOCITY] = -1.000001 * limits.finger_speed, 1.000001 * limits.finger_speed
    high[GUARD] = float(max(Guard))
    high[GUARD_LEVEL] = 1000.0
    return (low + high) / 2.0, (high - low) / 2.0


def rows_from_samples(samples: NDArray[Any]) -> NDArray[np.float64]:
    """Samples (n,) of the wire as float64 rows (n, 19) in the same order of columns."""
    rows = np.empty((len(samples), COLUMNS))
    rows[:, POSITION] = samples["position"]
    rows[:, VELOCITY] = samples["velocity"]
    rows[:, ACCELERATION] = samples["acceleration"]
    rows[:, STIFFNESS] = samples["stiffness"]
    rows[:, DAMPING] = samples["damping"]
    rows[:, TACTILE_GAIN] = samples["tactile_gain"]
    rows[:, FINGER_VELOCITY] = samples["finger_velocity"]
    rows[:, GUARD] = samples["guard"]
    rows[:, GUARD_LEVEL] = samples["guard_level"]
    return rows
