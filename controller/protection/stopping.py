"""A controlled stop: from any reference state to rest under bounds on acceleration and jerk, in closed form.

Speed v and acceleration a of one axis are brought to zero in at most three phases: jerk ±j to a peak acceleration A,
a stretch of constant A, jerk back to zero. With s the sign that the peak must have and α = s·a,

    s·(0 - v) = (A² - α²)/(2j) + A·t + A²/(2j),      so without the middle phase  A = √(j·s·(0 - v) + α²/2).

In space the same is done along the direction of travel and, for the acceleration across it (a curved path), along that
normal. So neither position, velocity nor acceleration ever steps, and the arm leaves its path by little.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_TINY = 1e-12


class AxisState(NamedTuple):
    """Way from the start of the stop [m], velocity [m/s], acceleration [m/s²] along one axis."""

    way: float
    velocity: float
    acceleration: float


class _Phase(NamedTuple):
    duration: float
    jerk: float


@dataclass(frozen=True, slots=True)
class AxisStop:
    """Jerk-limited way of one axis to rest; made by ``plan_axis``."""

    start: AxisState
    phases: tuple[_Phase, ...]

    @property
    def duration(self) -> float:
        """Time to rest [s]."""
        return sum(phase.duration for phase in self.phases)

    def at(self, time: float) -> AxisState:
        """State at a time from the start of the stop [s]; at rest from ``duration`` on."""
        state, left, over = self.start, time, time >= self.duration
        for phase in self.phases:
            if left < phase.duration and not over:
                return _advance(state, left, phase.jerk)
            state = _advance(state, phase.duration, phase.jerk)
            left -= phase.duration
        return AxisState(state.way, 0.0, 0.0)


def plan_axis(velocity: float, acceleration: float, max_acceleration: float, max_jerk: float) -> AxisStop:
    """The shortest stop of one axis.

    Args:
        velocity: present velocity [m/s].
        acceleration: present acceleration [m/s²]; may exceed ``max_acceleration``, it is then lowered first.
        max_acceleration: bound while stopping [m/s²].
        max_jerk: bound on the jerk [m/s³].
    """
    # the speed that would be left if only the acceleration were brought to zero tells where the peak must lie
    coasting = velocity + acceleration * abs(acceleration) / (2.0 * max_jerk)
    sign = -1.0 if coasting > 0.0 else 1.0
    alpha, change = sign * acceleration, -sign * velocity
    peak = math.sqrt(max(0.0, max_jerk * change + 0.5 * alpha * alpha))
    constant = 0.0
    if peak > max_acceleration:
        peak = max_acceleration
        ramps = (peak * peak + (peak + alpha) * abs(peak - alpha)) / (2.0 * max_jerk)
        constant = max(0.0, (change - ramps) / peak)
    first = abs(peak - alpha) / max_jerk
    jerk = math.copysign(max_jerk, peak - alpha)
    phases = (_Phase(first, sign * jerk), _Phase(constant, 0.0), _Phase(peak / max_jerk, -sign * max_jerk))
    return AxisStop(AxisState(0.0, velocity, acceleration), phases)


@dataclass(frozen=True, slots=True)
class StopPath:
    """A stop in space; made by ``plan_stop``. Arrays (3,), base frame."""

    origin: NDArray[np.float64]
    tangent: NDArray[np.float64]
    normal: NDArray[np.float64]
    along: AxisStop
    across: AxisStop

    @property
    def duration(self) -> float:
        """Time to rest [s]."""
        return max(self.along.duration, self.across.duration)

    def at(self, time: float) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Position [m], velocity [m/s] and acceleration [m/s²] at a time from the start of the stop [s]."""
        t, n = self.along.at(time), self.across.at(time)
        return (
            self.origin + t.way * self.tangent + n.way * self.normal,
            t.velocity * self.tangent + n.velocity * self.normal,
            t.acceleration * self.tangent + n.acceleration * self.normal,
        )


def plan_stop(
    position: NDArray[np.float64],
    velocity: NDArray[np.float64],
    acceleration: NDArray[np.float64],
    max_acceleration: float,
    max_jerk: float,
) -> StopPath:
    """Bring a reference state to rest.

    Args:
        position: shape (3,) [m].
        velocity: shape (3,) [m/s]; its direction is the one stopped along.
        acceleration: shape (3,) [m/s²]; its part across the direction of travel is ended on its own.
        max_acceleration: bound along and across [m/s²].
        max_jerk: bound along and across [m/s³].
    """
    tangent = _direction(velocity, otherwise=_direction(acceleration, otherwise=np.array([0.0, 0.0, 1.0])))
    forward = float(acceleration @ tangent)
    sideways = acceleration - forward * tangent
    normal = _direction(sideways, otherwise=np.zeros(3))
    along = plan_axis(float(velocity @ tangent), forward, max_acceleration, max_jerk)
    across = plan_axis(0.0, float(sideways @ normal), max_acceleration, max_jerk)
    return StopPath(position.copy(), tangent, normal, along, across)


def _direction(vector: NDArray[np.float64], otherwise: NDArray[np.float64]) -> NDArray[np.float64]:
    length = math.sqrt(float(vector @ vector))
    return vector / length if length > _TINY else otherwise


def _advance(state: AxisState, time: float, jerk: float) -> AxisState:
    way, velocity, acceleration = state
    return AxisState(
        way + time * (velocity + time * (acceleration / 2.0 + time * jerk / 6.0)),
        velocity + time * (acceleration + time * jerk / 2.0),
        acceleration + time * jerk,
    )
