"""How fast a motion is played: as planned where it was seen that nobody is near, else no faster than near people.

Speed and separation monitoring, ISO/TS 15066 5.5.4. A motion is planned for its fastest speeds. Someone who watches the
table admits them again and again, each time in a part of space and for a short while; outside of it, and as soon as
nobody has admitted anything in time, the tool goes at most at the speed that is safe to meet. Only time is stretched:
the tool stays on its path, and

    r = X(s),   r' = X'(s) σ,   r'' = X''(s) σ² + X'(s) dσ/dt,   σ = ds/dt = min(1, v / |X'(s)|),

with v, the speed that is admitted at present, changed at a bounded rate. Who falls silent, is blind or late thus slows
the arm down, by doing nothing.
"""

from __future__ import annotations

import math
from typing import Final

from controller.loop.motion import MotionBuffer
from controller.model.compiled import ROW, SCALAR, FloatArray, compiled_as
from controller.protection.limits import Limits
from controller.protocol.messages import AdmitSpeed, Announce

CHANGE: Final = 25.0
"""So quickly the admitted speed falls and rises [m/s²]: as the fastest profile brakes along each axis."""
LONGEST: Final = 0.25
"""Nobody admits a speed for longer than this [s]."""
NOTHING_ADMITTED: Final = AdmitSpeed(0.0, 0, (0.0,) * 16)


class Playback:
    """Time along the samples of the motion under way.

    Args:
        limits: of the protection.
        period: of a tick [s].

    Attributes:
        at: where in the motion the reference is [samples]; negative before it has begun.
        rate: σ of the last tick, 1 as planned.
        slope: dσ/dt of the last tick [1/s].
    """

    def __init__(self, limits: Limits, period: float) -> None:
        self.at, self.rate, self.slope = -1.0, 1.0, 0.0
        self._shared, self._always = limits.shared_speed, limits.shared_speed >= limits.speed
        self._period = period
        self._speed, self._played = limits.shared_speed, 0.0
        self._admitted = NOTHING_ADMITTED
        self._tick = 0

    @property
    def as_planned(self) -> bool:
        """Whether the reference is exactly a sample."""
        return self.rate == 1.0 and self.slope == 0.0 and self.at == int(self.at)

    def begin(self) -> None:
        """A new motion, from rest."""
        self.at, self.rate, self.slope, self._speed = -1.0, 1.0, 0.0, self._shared

    def admit(self, admitted: AdmitSpeed, tick: int) -> None:
        """From now on this counts, and no longer what was admitted before; for a short while at most."""
        until = min(admitted.until, tick + round(LONGEST / self._period))
        self._admitted = admitted._replace(until=until)

    def last_needed(self, motion: Announce, tick: int) -> int:
        """Index of the last sample that a tick needs, if it is the next one; negative before the motion begins."""
        at = tick - motion.first_tick if self.at < 0.0 else math.ceil(self.at + (tick - self._tick))
        return min(at, motion.length - 1)

    def advance(self, tick: int, point: FloatArray, samples: MotionBuffer) -> None:
        """Go on to a tick whose samples are there, and count them as executed.

        Args:
            tick: of the motion, at or after its first one.
            point: where the reference was, base frame (3,) or longer [m].
            samples: of the motion.
        """
        motion = samples.announced
        assert motion is not None
        elapsed, self._tick = tick - self._tick, tick
        last = motion.length - 1
        if self.at < 0.0:
            self.at = float(min(tick - motion.first_tick, last))
        elif self._always:
            self.at = min(self.at + elapsed, float(last))
        else:
            self._go_on(elapsed, point, samples, last)
        samples.executed = int(self.at) + 1

    def _go_on(self, elapsed: int, point: FloatArray, samples: MotionBuffer, last: int) -> None:
        before, time = self.rate, elapsed * self._period
        self._change_speed(time, point)
        asked = _speed_at(min(self.at + elapsed * before, float(last)), samples)
        rate = min(1.0, self._speed / asked) if asked > 0.0 else 1.0
        self.at = min(self.at + elapsed * rate, float(last))
        asked = _speed_at(self.at, samples)  # not quite where it was expected: a rate that has changed has that effect
        self.rate = min(rate, self._speed / asked) if asked > 0.0 else rate
        self.slope, self._played = (self.rate - before) / time, asked * self.rate

    def _change_speed(self, time: float, point: FloatArray) -> None:
        """The admitted speed after so much more time [s], with the reference at a point (3,) or longer [m]."""
        speed, until, borders = self._admitted
        free = self._tick <= until and _is_between(borders, *point[:3].tolist())
        goal = max(self._shared, speed) if free else self._shared
        if goal < self._speed:
            self._speed = max(goal, min(self._speed, self._played) - CHANGE * time)
        else:
            self._speed = min(goal, self._speed + CHANGE * time)


def _is_between(borders: tuple[float, ...], x: float, y: float, z: float) -> bool:
    return all(borders[i] * x + borders[i + 1] * y + borders[i + 2] * z + borders[i + 3] >= 0.0 for i in (0, 4, 8, 12))


def _speed_at(at: float, samples: MotionBuffer) -> float:
    """Of the tool as planned, between two samples [m/s]."""
    index = int(at)
    share, before = at - index, samples.row(index)
    after = samples.row(index + 1) if share > 0.0 else before
    x, y, z = before[3:6] + share * (after[3:6] - before[3:6])
    return math.sqrt(x * x + y * y + z * z)


@compiled_as(SCALAR(ROW, ROW, SCALAR, SCALAR, SCALAR, SCALAR, ROW))
def blend(
    before: FloatArray, after: FloatArray, share: float, period: float, rate: float, slope: float, out: FloatArray
) -> float:
    """The reference between two samples, played at another rate.

    Args:
        before: sample as a row, shape (19,).
        after: the next one.
        share: of the way from one to the other, 0 to 1.
        period: between them as planned [s].
        rate: σ.
        slope: dσ/dt [1/s].
        out: position, velocity, acceleration and gains go here, shape (16,).

    Returns:
        Velocity of the fingers [m/s]: they open in the time of the motion; what they hold they go on pressing.
    """
    rest = 1.0 - share
    for i in range(3):
        p, q, v, w = before[i], after[i], before[3 + i] * period, after[3 + i] * period
        # the cubic through both positions and velocities
        out[i] = p + share * (v + share * (3.0 * (q - p) - 2.0 * v - w + share * (2.0 * (p - q) + v + w)))
        velocity = rest * before[3 + i] + share * after[3 + i]
        acceleration = rest * before[6 + i] + share * after[6 + i]
        out[3 + i] = velocity * rate
        out[6 + i] = acceleration * rate * rate + velocity * slope
    for i in range(9, 16):
        out[i] = rest * before[i] + share * after[i]
    finger: float = before[16]
    return finger * rate if finger > 0.0 else finger
