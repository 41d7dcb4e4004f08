"""Protection of the reference: whether a motion's samples lie within the limits and form one smooth path."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from controller.model.compiled import FINDING, ROW, TABLE, TRUTH, FloatArray, compiled, compiled_as
from controller.protection.limits import Limits, Violation
from controller.protocol.causes import Cause
from controller.protocol.datagram_fields import Guard

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
        self._middle, self._range = _ranges(limits)
        self._half = self._range
        self._reference = np.zeros(3)
        self._bounds = np.array(
            [
                limits.reach, limits.speed, limits.acceleration, limits.downward_speed, limits.position_step,
                limits.velocity_step, limits.near_depth, 0.5 * period,
            ]
        )  # fmt: skip

    def begin(self, reference: NDArray[np.float64]) -> None:
        """A new motion starts at this reference, shape (3,) [m].

        If a stop or a hand left the arm outside the box, the motion may be as far outside on its way back.
        """
        self._reference = reference.copy()
        self._half = self._range.copy()
        outside = np.abs(reference - self._middle[POSITION]) + self.limits.start_position
        np.maximum(self._half[POSITION], outside, out=self._half[POSITION])
        axis_distance = math.hypot(reference[0], reference[1]) + self.limits.start_position
        self._bounds[_REACH] = max(self.limits.reach, axis_distance)

    def rows(self, rows: NDArray[np.float64], previous: NDArray[np.float64] | None) -> Violation | None:
        """The first violation in consecutive rows (n, 19), or ``None``.

        Args:
            rows: samples as float64, columns as on the wire.
            previous: the row (19,) before them, ``None`` at the start of a motion.
        """
        first = previous is None
        found, offset, column, value = _first_violation(
            rows, rows[0] if previous is None else previous, first, self._middle, self._half, self._bounds
        )
        if found == _FINE:
            return None
        if found == _RANGE:
            return self._out_of_range(rows[offset], offset, column)
        cause, bound = _BOUND_CAUSE[found], float(self._bounds[found])
        return Violation(cause, value, bound, offset)

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

    def _out_of_range(self, row: NDArray[np.float64], offset: int, column: int) -> Violation:
        if not np.isfinite(row).all():
            return Violation(Cause.NOT_FINITE, float(offset), 0.0, offset)
        if column < VELOCITY.start:
            away = abs(float(row[column]) - float(self._middle[column]))
            return Violation(Cause.WORKSPACE, away, float(self._half[column]), offset)
        bound = float(self._middle[column] + self._half[column])
        return Violation(_COLUMN_CAUSE[column], float(row[column]), bound, offset)


_REACH, _SPEED, _ACCELERATION, _DOWN, _POSITION_STEP, _VELOCITY_STEP, _NEAR, _HALF_PERIOD = range(8)
"""Places in the array of bounds; the last two are no bounds, but what they need."""
_RANGE, _FINE = 8, 9
_BOUND_CAUSE: Final = (
    Cause.REACH, Cause.SPEED, Cause.ACCELERATION, Cause.DOWNWARD_SPEED, Cause.POSITION_STEP, Cause.VELOCITY_STEP,
)  # fmt: skip


@compiled
def _too_large(row: FloatArray, bounds: FloatArray) -> tuple[int, float]:
    """Which length of a row's vectors exceeds its bound, and the length."""
    aside = math.sqrt(row[0] * row[0] + row[1] * row[1])
    speed = math.sqrt(row[3] * row[3] + row[4] * row[4] + row[5] * row[5])
    acceleration = math.sqrt(row[6] * row[6] + row[7] * row[7] + row[8] * row[8])
    found = _FINE, 0.0
    if row[2] >= bounds[_NEAR] and not row[5] <= bounds[_DOWN]:
        found = _DOWN, row[5]
    if not acceleration <= bounds[_ACCELERATION]:
        found = _ACCELERATION, acceleration
    if not speed <= bounds[_SPEED]:
        found = _SPEED, speed
    if not aside <= bounds[_REACH]:
        found = _REACH, aside
    return found


@compiled_as(FINDING(TABLE, ROW, TRUTH, ROW, ROW, ROW))
def _first_violation(
    rows: FloatArray, previous: FloatArray, first: bool, middle: FloatArray, half: FloatArray, bounds: FloatArray
) -> tuple[int, int, int, float]:
    """What is wrong with the first bad row: which bound, offset of the row, column, value.

    Compiled, as a datagram of samples is checked within a tick: ranges of all columns, lengths of vectors, and whether
    positions follow from velocities and velocities from accelerations by the trapezoidal rule. Comparisons are written
    so that what is no number fails them.
    """
    for k in range(rows.shape[0]):
        row, before = rows[k], rows[k - 1] if k > 0 else previous
        for column in range(rows.shape[1]):
            if not abs(row[column] - middle[column]) <= half[column]:
                return _RANGE, k, column, row[column]
        which, length = _too_large(row, bounds)
        if which != _FINE:
            return which, k, 0, length
        if k == 0 and first:
            continue
        for column in range(6):
            step = row[column] - before[column] - bounds[_HALF_PERIOD] * (row[column + 3] + before[column + 3])
            which = _POSITION_STEP if column < 3 else _VELOCITY_STEP
            if not abs(step) <= bounds[which]:
                return which, k, column, abs(step)
    return _FINE, 0, 0, 0.0


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


_COARSE: Final = np.dtype([("doubles", "<f8", (9,)), ("floats", "<f4", (8,)), ("guard", "u1"), ("level", "<f4")])
"""The wire's sample again, neighbours of one type taken together."""


def rows_from_samples(samples: NDArray[Any]) -> NDArray[np.float64]:
    """Samples (n,) of the wire as float64 rows (n, 19) in the same order of columns."""
    rows, coarse = np.empty((len(samples), COLUMNS)), samples.view(_COARSE)
    rows[:, :9] = coarse["doubles"]
    rows[:, 9:GUARD] = coarse["floats"]
    rows[:, GUARD] = coarse["guard"]
    rows[:, GUARD_LEVEL] = coarse["level"]
    return rows
