"""How fast a motion is played: as planned where it was seen that nobody is near, else no faster than near people.

Speed and separation monitoring, ISO/TS 15066 5.5.4. A motion is planned for its fastest speeds. Someone who watches the
table admits them again and again, each time in a part of space and for a short while; outside of it, and as soon as
nobody has admitted anything in time, the tool goes at most at the speed that is safe to meet. Only time is stretched:
the tool stays on its path, and

    r = X(s),   r' = X'(s) σ,   r'' = X''(s) σ² + X'(s) dσ/dt,   σ = ds/dt = min(1, v / |X'(s)|),

with v, the speed that is admitted at present, changed at a bounded rate. Who falls silent, is blind or late thus slows
the arm down, by doing nothing.

Likewise no motion is planned for how warm the servomotors are by then. Near their rating σ falls, and with it the
torque for acceleration, by its square: a game in fast profile goes on somewhat slower, where it would be stopped.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from controller.model.compiled import ROW, SCALAR, STATUS, TABLE, FloatArray, compiled_as, direct
from controller.protection.limits import Limits
from controller.protection.warm_servomotors import warm_pace
from controller.protocol.messages import AdmitSpeed, Announce

CHANGE: Final = 25.0
"""So quickly the admitted speed falls and rises [m/s²]: along an axis it takes up to 8 N m, which the drives have."""
LONGEST: Final = 0.25
"""Nobody admits a speed for longer than this [s]."""
_AT, _RATE, _SLOPE, _TICK, _SPEED, _PLAYED = range(6)
"""Where in the motion the reference is [samples], σ, dσ/dt [1/s], tick of these, admitted and played speed [m/s]."""
_ADMITTED, _UNTIL, _BORDERS = 6, 7, 8
"""Of the last admission: speed [m/s], its last tick, and the planes of its space, (4, 4)."""
_SHARED, _ALWAYS, _PERIOD = 24, 25, 26
"""Speed that is safe to meet [m/s]; 1 where every motion may be as fast; length of a tick [s]."""
_PACE: Final = 27
"""σ that the servomotors' warmth admits; negative before the motion begins."""
PLAYBACK_SIZE: Final = 28
_GUARD: Final = 17
"""Of a sample as a row, 0 where there is none."""


@compiled_as(SCALAR(ROW, SCALAR, SCALAR, SCALAR))
def last_needed(memory: FloatArray, first: float, length: float, tick: float) -> float:
    """Index of the last sample that a tick needs, if it is the next one; negative before the motion begins.

    Args:
        memory: of the playback, shape (28,).
        first: tick of the motion's first sample.
        length: of the motion [samples].
        tick: a whole number, as the others are.
    """
    at = tick - first if memory[_AT] < 0.0 else math.ceil(memory[_AT] + (tick - memory[_TICK]))
    return min(at, length - 1.0)


@compiled_as(SCALAR(TABLE, SCALAR))
def _speed_at(samples: FloatArray, at: float) -> float:
    """Of the tool as planned, between two samples [m/s]."""
    index = int(at)
    share, before = at - index, samples[index % len(samples)]
    after = samples[(index + 1) % len(samples)] if share > 0.0 else before
    squared = 0.0
    for i in range(3, 6):
        speed = before[i] + share * (after[i] - before[i])
        squared += speed * speed
    return math.sqrt(squared)


@compiled_as(STATUS(ROW, SCALAR, SCALAR, ROW))
def _change_speed(memory: FloatArray, tick: float, time: float, point: FloatArray) -> int:
    """The admitted speed at a tick, so much time later [s], with the reference at a point (3,) or longer [m]."""
    free = tick <= memory[_UNTIL]
    for i in range(_BORDERS, _BORDERS + 16, 4):
        a, b, c, d = memory[i], memory[i + 1], memory[i + 2], memory[i + 3]
        free = free and a * point[0] + b * point[1] + c * point[2] + d >= 0.0
    goal = max(memory[_SHARED], memory[_ADMITTED]) if free else memory[_SHARED]
    if goal < memory[_SPEED]:
        memory[_SPEED] = max(goal, min(memory[_SPEED], memory[_PLAYED]) - CHANGE * time)
    else:
        memory[_SPEED] = min(goal, memory[_SPEED] + CHANGE * time)
    return 0


@compiled_as(SCALAR(ROW, SCALAR, SCALAR, SCALAR, ROW, TABLE, SCALAR))
def advance(
    memory: FloatArray, first: float, length: float, tick: float, point: FloatArray, samples: FloatArray, heat: float
) -> float:
    """Go on to a tick whose samples are there.

    Args:
        memory: of the playback, shape (28,), in and out.
        first: tick of the motion's first sample.
        length: of the motion [samples].
        tick: at or after the first one.
        point: where the reference was, base frame (3,) or longer [m].
        samples: ring of the motion's, shape (capacity, 19).
        heat: mean square of the torque of the warmest servomotor, as a share of what it is rated for.

    Returns:
        How many samples count as executed.
    """
    elapsed, last = tick - memory[_TICK], length - 1.0
    memory[_TICK] = tick
    before, time = memory[_RATE], elapsed * memory[_PERIOD]
    pace = memory[_PACE] = warm_pace(memory[_PACE], time, heat)
    if memory[_AT] < 0.0:
        memory[_AT], memory[_RATE] = min(tick - first, last), pace
    elif memory[_ALWAYS] != 0.0:
        memory[_AT], memory[_RATE] = min(memory[_AT] + elapsed * pace, last), pace
        memory[_SLOPE] = (pace - before) / time
    else:
        _change_speed(memory, tick, time, point)
        asked = _speed_at(samples, min(memory[_AT] + elapsed * before, last))
        rate = min(pace, memory[_SPEED] / asked) if asked > 0.0 else pace
        memory[_AT] = min(memory[_AT] + elapsed * rate, last)
        # not quite where it was expected: a rate that has changed has that effect
        asked = _speed_at(samples, memory[_AT])
        memory[_RATE] = min(rate, memory[_SPEED] / asked) if asked > 0.0 else rate
        memory[_SLOPE], memory[_PLAYED] = (memory[_RATE] - before) / time, asked * memory[_RATE]
    executed: float = math.floor(memory[_AT]) + 1.0
    return executed


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
        Velocity of the fingers [m/s]: they open and close by a way in the time of the motion; what a guard says that
        they hold, or are to, they go on pressing.
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
    return finger * rate if finger > 0.0 or before[_GUARD] == 0.0 else finger


@compiled_as(STATUS(ROW, TABLE, ROW, ROW))
def follow(memory: FloatArray, samples: FloatArray, row: FloatArray, tail: FloatArray) -> int:
    """The reference of the tick that the playback has gone on to.

    Args:
        memory: of the playback, shape (28,).
        samples: ring of the motion's, shape (capacity, 19).
        row: position, velocity, acceleration and gains go here, shape (16,).
        tail: velocity of the fingers [m/s], guard, and its level [N] go here, shape (3,).
    """
    at = memory[_AT]
    index = int(at)
    before = samples[index % len(samples)]
    if memory[_RATE] == 1.0 and memory[_SLOPE] == 0.0 and at == index:
        for i in range(16):
            row[i] = before[i]
        tail[0] = before[16]
    else:
        after = samples[(index + 1) % len(samples)] if at > index else before
        tail[0] = blend(before, after, at - index, memory[_PERIOD], memory[_RATE], memory[_SLOPE], row)
    tail[1], tail[2] = before[17], before[18]
    return 0


_last_needed: Final = direct(last_needed)
_advance: Final = direct(advance)
_follow: Final = direct(follow)


class Playback:
    """Time along the samples of the motion under way.

    Args:
        limits: of the protection.
        period: of a tick [s].
        memory: shape (28,); by default an array of its own.
    """

    def __init__(self, limits: Limits, period: float, memory: FloatArray | None = None) -> None:
        self._memory = memory = np.zeros(PLAYBACK_SIZE) if memory is None else memory
        memory[_SHARED], memory[_ALWAYS] = limits.shared_speed, limits.shared_speed >= limits.speed
        memory[_PERIOD] = period
        self._period = period
        self.begin()

    @property
    def at(self) -> float:
        """Where in the motion the reference is [samples]; negative before it has begun."""
        return float(self._memory[_AT])

    @property
    def rate(self) -> float:
        """σ of the last tick, 1 as planned."""
        return float(self._memory[_RATE])

    @property
    def slope(self) -> float:
        """dσ/dt of the last tick [1/s]."""
        return float(self._memory[_SLOPE])

    def begin(self) -> None:
        """A new motion, from rest."""
        self._memory[:_TICK] = -1.0, 1.0, 0.0
        self._memory[_SPEED], self._memory[_PACE] = self._memory[_SHARED], -1.0

    def admit(self, admitted: AdmitSpeed, tick: int) -> None:
        """From now on this counts, and no longer what was admitted before; for a short while at most."""
        memory = self._memory
        memory[_ADMITTED], memory[_UNTIL] = admitted.speed, min(admitted.until, tick + round(LONGEST / self._period))
        memory[_BORDERS:_SHARED] = admitted.borders

    def last_needed(self, motion: Announce, tick: int) -> int:
        """Index of the last sample that a tick needs; see `last_needed`."""
        return int(_last_needed(self._memory, float(motion.first_tick), float(motion.length), float(tick)))

    def advance(self, motion: Announce, tick: int, point: FloatArray, samples: FloatArray, heat: float) -> int:
        """Go on to a tick of a motion, and how many samples count as executed; see `advance`."""
        first, length = float(motion.first_tick), float(motion.length)
        return int(_advance(self._memory, first, length, float(tick), point, samples, heat))

    def follow(self, samples: FloatArray, row: FloatArray, tail: FloatArray) -> None:
        """The reference of the tick gone on to; see `follow`."""
        _follow(self._memory, samples, row, tail)
