"""Smooth strokes that servos follow, compiled: so that ticks go on without a line of Python while they move.

A stroke follows the minimum-jerk law (Flash and Hogan, J. Neuroscience 1985). Strokes add up, and one may begin before
another has ended (Flash and Henis, J. Cognitive Neuroscience 1991).
"""

from typing import Any, NamedTuple

import numba
import numpy as np
from numba import types
from numpy.typing import NDArray

from hardware.loading import spare_blas

spare_blas()

Array = NDArray[np.float64]
Wholes = NDArray[np.int64]


class ServoStrokes(NamedTuple):
    """What servos follow, each one of n channels; all arrays in one piece."""

    places: Wholes
    """Of each servo its control among MuJoCo's, and its channel, (s, 2); none where nothing moves."""
    lead: Array
    """What each servo is told ahead, so that it does not lag: times velocity [s] and acceleration [s²], (s, 2)."""
    start: Array
    """Of the channels, before all strokes, (n,)."""
    strokes: Array
    """Of each its begin, its duration, both counted from the start [s], and its change of the channels, (m, 2 + n)."""
    clock: Array
    """Last tick before the start, length of a tick [s], and the time up to which these strokes count [s], (3,)."""


NOTHING = ServoStrokes(np.zeros((0, 2), np.int64), np.zeros((0, 2)), np.zeros(0), np.zeros((0, 2)), np.zeros(3))
"""No servo is led."""

_FLOATS, _TABLE = types.float64[::1], types.float64[:, ::1]
SERVO_STROKES = types.NamedTuple((types.int64[:, ::1], _TABLE, _FLOATS, _TABLE, _FLOATS), ServoStrokes)  # type: ignore[no-untyped-call]


@numba.njit(types.void(_FLOATS, _TABLE, types.float64, _TABLE), cache=True)
def add_up(start: Array, strokes: Array, time: float, out: Array) -> None:
    """Position, velocity and acceleration of the channels at a time [s] go to ``out``, (3, n); see `ServoStrokes`."""
    channels = len(start)
    out[0], out[1], out[2] = start, 0.0, 0.0
    for k in range(len(strokes)):
        t = strokes[k, 1]
        s = (time - strokes[k, 0]) / t
        if s <= 0.0:
            continue
        change = strokes[k, 2:]
        if s >= 1.0:
            for i in range(channels):
                out[0, i] += change[i]
            continue
        rest = 1.0 - s
        place = s * s * s * (10.0 + s * (6.0 * s - 15.0))
        speed = 30.0 * s * s * rest * rest / t
        push = 60.0 * s * rest * (1.0 - 2.0 * s) / (t * t)
        for i in range(channels):
            out[0, i] += change[i] * place
            out[1, i] += change[i] * speed
            out[2, i] += change[i] * push


@numba.njit(types.float64(SERVO_STROKES, types.float64), cache=True)
def time_at(followed: ServoStrokes, tick: float) -> float:
    """Since the start, at the end of a tick that comes [s]."""
    clock = followed.clock
    elapsed: float = (tick - clock[0] + 1.0) * clock[1]
    return elapsed


@numba.njit(types.boolean(SERVO_STROKES, types.float64), cache=True)
def over(followed: ServoStrokes, tick: float) -> Any:
    """Whether something else is to be followed from a tick on."""
    return time_at(followed, tick) > followed.clock[2]


@numba.njit(types.void(SERVO_STROKES, types.float64, _FLOATS), cache=True)
def follow(followed: ServoStrokes, tick: float, controls: Array) -> None:
    """Set the servos for a tick that comes, in MuJoCo's controls."""
    told = np.empty((3, len(followed.start)))
    add_up(followed.start, followed.strokes, time_at(followed, tick), told)
    for k in range(len(followed.places)):
        i = followed.places[k, 1]
        ahead = followed.lead[k, 0] * told[1, i] + followed.lead[k, 1] * told[2, i]
        controls[followed.places[k, 0]] = told[0, i] + ahead
