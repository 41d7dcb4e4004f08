"""When the tool is where on its path: near-minimum-time laws within bounds on speed, acceleration and jerk.

A single line is Ruckig's. Along a path with corners Ruckig can take each line from one corner's speed to the next, and
corners at a constant speed, as fast as curvature and its rate admit (`Law.RUCKIG`). That obeys all bounds but loses
time, since it may not accelerate in corners: on transfers of chess pieces it takes a fifth longer than the optimum.
So there `app.motion.refine` finds the law, which takes about two percent longer (``touchmove bench motion``).

Acceleration and jerk are bounded along each axis of the base frame; speed as the length of its vector, and downwards.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import Final

import numpy as np
import ruckig

from app.motion.path import Path, Vector
from app.motion.refine import constant_speed, excess, quickest
from app.motion.sampling import interval_times, trace

GAP: Final = 0.003
"""How far from the optimum the refinement may stop, as a share of the duration."""
_CORNER_PARTS: Final = 8
"""Intervals of each half of a corner."""
_RAMP: Final = 0.004
"""Over so much of u the way begins to run as u does, from rest [m]."""
_RAMP_PARTS: Final = 3
"""Intervals of each half of it."""
_FINEST: Final = 0.0012
"""First interval at either end of a line [m] …"""
_SLOWEST: Final = 0.0002
"""… where the tool is slow at the end of it [m] …"""
_COARSEST: Final = 0.006
"""… and the longest [m] …"""
_GROWTH: Final = 1.3
"""… and how they grow."""
_BETWEEN: Final = 1.0002
"""So much may be exceeded between the points at which a law is looked at; it is stretched by that."""
_ROUNDING: Final = 1e-9
_QUINTIC_PARTS: Final = 400
"""Cubic pieces of the quintic law."""
_SPARE: Final = 0.8
"""The refinement begins so much slower than the bounds admit."""


class Law(StrEnum):
    """How time runs along a path."""

    TIME_OPTIMAL = "time-optimal"
    RUCKIG = "ruckig"
    """Without the refinement."""
    MINIMUM_JERK = "minimum-jerk"
    """The quintic law, whose mean squared jerk is the least: from rest to rest as quickly as the bounds admit."""


@dataclass(frozen=True, slots=True)
class Bounds:
    """Largest speed [m/s], and largest acceleration [m/s²] and jerk [m/s³] along each axis of the base frame.

    ``downward`` bounds the speed towards +z3 [m/s].
    """

    speed: float
    acceleration: float
    jerk: float
    downward: float = math.inf

    def least(self, other: Bounds) -> Bounds:
        """The tighter of each bound."""
        return Bounds(
            min(self.speed, other.speed), min(self.acceleration, other.acceleration), min(self.jerk, other.jerk),
            min(self.downward, other.downward),
        )  # fmt: skip

    def scaled(self, factor: float) -> Bounds:
        """Accelerations and jerks times a factor; speeds stay."""
        return Bounds(self.speed, self.acceleration * factor, self.jerk * factor, self.downward)


class Traced:
    """Where the tool is at many times, one row each.

    Attributes:
        position: base frame, (m, 3) [m].
        velocity: (m, 3) [m/s].
        acceleration: (m, 3) [m/s²].
        way: along the path, (m,) [m].
        speed: along the path, (m,) [m/s].
        piece: of the path, (m,).
    """

    def __init__(self, table: Vector) -> None:
        self.position, self.velocity, self.acceleration = table[:, 0:3], table[:, 3:6], table[:, 6:9]
        self.way, self.speed = table[:, 9], table[:, 10]
        self.piece = table[:, 12].astype(np.int64)


@dataclass(frozen=True, slots=True)
class TimeLaw:
    """Way along the path by time, in intervals of a parameter u: the way is cubic in u, and u̇² quadratic.

    Attributes:
        time: when each interval begins, and the last one ends, (n + 1,) [s].
        way: along the path, and its three rates by u, at the begin of each interval, (n, 4) [m].
        warp: coefficients of u̇² by the way into the interval, (n, 3).
        piece: of the path, (n,).
    """

    time: Vector
    way: Vector
    warp: Vector
    piece: Vector

    @property
    def duration(self) -> float:
        """Of the whole [s]."""
        return float(self.time[-1])

    def trace(self, path: Path, time: Vector) -> Traced:
        """Along its path, at rising times (m,) [s]."""
        return Traced(trace(time, self.time, self.way, self.warp, self.piece, path.table))

    def stretched(self, factor: float) -> TimeLaw:
        """The same way in so many times the time."""
        return TimeLaw(self.time * factor, self.way, self.warp / factor**2, self.piece)


def time_law(path: Path, bounds: Sequence[Bounds], law: Law = Law.TIME_OPTIMAL, end_speed: float = 0.0) -> TimeLaw:
    """The law along a smooth path, from rest to rest or to a speed at which the path goes on straight.

    Args:
        path: smooth.
        bounds: of each line of its polygon; a corner obeys those of both its lines.
        law: which.
        end_speed: reached without acceleration at the path's end [m/s]; not with the quintic law.

    Returns:
        A law that obeys all bounds everywhere.
    """
    each = bounds_of_pieces(path, bounds)
    table = np.array([[b.speed, b.acceleration, b.jerk, b.downward] for b in each])
    if law is Law.MINIMUM_JERK:
        return _within(path, table, _quintic(path), _BETWEEN)
    if law is Law.RUCKIG or len(path.length) == 1:
        return _within(path, table, _by_ruckig(path, each, end_speed), _BETWEEN if len(path.length) > 1 else 1.0)
    return _within(path, table, _refined(path, table, end_speed), _BETWEEN)


def line_law(path: Path, bounds: Bounds, start_speed: float) -> TimeLaw:
    """Along one line, by Ruckig, from a speed without acceleration to rest."""
    table = np.array([(*phase[:4], 0.0, phase[4]) for phase in _line(path.total, start_speed, 0.0, bounds)])
    warp = np.tile([1.0, 0.0, 0.0], (len(table), 1))
    return _Intervals(table[:, :5], np.ascontiguousarray(table[:, 5])).with_warp(path, warp)


def bounds_of_pieces(path: Path, bounds: Sequence[Bounds]) -> list[Bounds]:
    """Of each piece of a path: those of its line; of a corner the tighter ones of both its lines."""
    each = [bounds[line] for line in path.line]
    for i in np.flatnonzero(path.sharpness > 0.0):
        each[i] = each[i].least(bounds[path.line[i + 1 if path.sign[i] > 0.0 else i - 1]])
    return each


@dataclass(frozen=True, slots=True)
class _Intervals:
    """Columns as of ``refine.LAW``, and the lengths in u."""

    law: Vector
    step: Vector

    def with_warp(self, path: Path, warp: Vector) -> TimeLaw:
        piece = np.ascontiguousarray(self.law[:, 4])
        way = np.array(self.law[:, :4])
        way[:, 0] += path.begins[piece.astype(np.int64)]
        return TimeLaw(interval_times(self.step, warp), way, warp, piece)


def _within(path: Path, table: Vector, found: tuple[_Intervals, Vector], spare: float) -> TimeLaw:
    """Stretched, or shrunk, to where the bounds just hold; a law of Ruckig's is as it must be already."""
    intervals, warp = found
    factor = excess(path.table, table, intervals.law, intervals.step, warp) * spare
    law = intervals.with_warp(path, warp)
    return law if spare == 1.0 and factor < 1.0 + _ROUNDING else law.stretched(factor)


def _refined(path: Path, table: Vector, end_speed: float) -> tuple[_Intervals, Vector]:
    intervals = _grid(path, end_speed)
    count = len(intervals.step)
    near_rest = np.zeros(count)
    near_rest[: 2 * _RAMP_PARTS + 2] = 1.0
    near_rest[-2 * _RAMP_PARTS - 2 :] = float(end_speed == 0.0)
    slow = end_speed
    if end_speed == 0.0:
        at_once = np.ones((count, 3)) * (1.0, 0.0, 0.0)
        slow = _SPARE / excess(path.table, table, intervals.law, intervals.step, at_once)
    warp = quickest(path.table, table, intervals.law, intervals.step, near_rest, slow, float(end_speed > 0.0), GAP)
    return intervals, warp


def _grid(path: Path, end_speed: float) -> _Intervals:
    """Intervals for the refinement: u is the way itself, but for ramps where the path begins and ends at rest."""
    rows: list[tuple[float, ...]] = []
    last = len(path.length) - 1
    for i, length in enumerate(path.length.tolist()):
        if path.sharpness[i] > 0.0:
            part = length / _CORNER_PARTS
            rows += [(m * part, 1.0, 0.0, 0.0, i, part) for m in range(_CORNER_PARTS)]
            continue
        ramp = min(_RAMP, length if last == 0 else 1.9 * length)
        before = ramp / 2.0 if i == 0 else 0.0
        after = ramp / 2.0 if i == last and end_speed == 0.0 else 0.0
        if before > 0.0:
            rows += _ramp(ramp, i)
        slow = _SLOWEST if i == last and end_speed > 0.0 else _FINEST
        rows += [(way, 1.0, 0.0, 0.0, i, part) for way, part in _graded(before, length - after, slow)]
        if after > 0.0:
            rows += _mirrored(_ramp(ramp, i), length)
    table = np.array(rows)
    return _Intervals(np.ascontiguousarray(table[:, :5]), np.ascontiguousarray(table[:, 5]))


def _ramp(ramp: float, piece: int) -> list[tuple[float, ...]]:
    """From s' = 0 to s' = 1 with s''' constant on either half."""
    jerk, half = 4.0 / ramp**2, ramp / 2.0
    rows: list[tuple[float, ...]] = []
    for m in range(2 * _RAMP_PARTS):
        x = (m % _RAMP_PARTS) * half / _RAMP_PARTS
        s0, s1, s2, s3 = (0.0, 0.0, 0.0, jerk) if m < _RAMP_PARTS else (jerk * half**3 / 6.0, 0.5, jerk * half, -jerk)
        at = (s0 + x * (s1 + x * (s2 / 2.0 + x * s3 / 6.0)), s1 + x * (s2 + x * s3 / 2.0), s2 + x * s3, s3)
        rows.append((*at, piece, half / _RAMP_PARTS))
    return rows


def _mirrored(rows: list[tuple[float, ...]], end: float) -> list[tuple[float, ...]]:
    """The same backwards in time, to end at a way."""
    back: list[tuple[float, ...]] = []
    for s0, s1, s2, s3, piece, step in reversed(rows):
        way = s0 + step * (s1 + step * (s2 / 2.0 + step * s3 / 6.0))
        back.append((end - way, s1 + step * (s2 + step * s3 / 2.0), -(s2 + step * s3), s3, piece, step))
    return back


def _graded(start: float, end: float, last: float = _FINEST) -> list[tuple[float, float]]:
    """Parts of a line, fine at both ends, where the last one has a length: begin and length of each [m]."""
    half = (end - start) / 2.0
    sizes = _growing(half, _FINEST) + _growing(half, last)[::-1]
    begins = start + np.concatenate([[0.0], np.cumsum(sizes)[:-1]]) if sizes else np.zeros(0)
    return list(zip(begins.tolist(), sizes, strict=True))


def _growing(length: float, size: float) -> list[float]:
    sizes = list[float]()
    while length > 1e-9:
        part = size if length > 1.5 * size else length
        sizes.append(part)
        length -= part
        size = min(size * _GROWTH, _COARSEST)
    return sizes


def _quintic(path: Path) -> tuple[_Intervals, Vector]:
    """S = L (10 τ³ - 15 τ⁴ + 6 τ⁵), in cubic pieces that agree with it to the second derivative at their ends.

    In one second; `_within` stretches it to what the bounds admit.
    """
    at_ends = [_quintic_time(end / path.total) for end in path.ends[:-1].tolist()]
    time = np.unique(np.concatenate([np.linspace(0.0, 1.0, _QUINTIC_PARTS + 1), at_ends]))
    step = np.diff(time)
    acceleration = time * (60.0 + time * (-180.0 + time * 120.0))
    jerk = np.diff(acceleration) / step
    speed = np.concatenate([[0.0], np.cumsum(0.5 * step * (acceleration[:-1] + acceleration[1:]))])
    ways = step * (speed[:-1] + step * (acceleration[:-1] / 2.0 + step * jerk / 6.0))
    way = np.concatenate([[0.0], np.cumsum(ways)])
    scale = path.total / way[-1]
    piece = path.piece_at(scale * (way[:-1] + way[1:]) / 2.0)
    begins = (path.ends - path.length)[piece]
    rates = scale * np.column_stack([speed[:-1], acceleration[:-1], jerk])
    law = np.column_stack([scale * way[:-1] - begins, rates, piece.astype(float)])
    return _Intervals(law, step), np.tile([1.0, 0.0, 0.0], (len(step), 1))


def _quintic_time(share: float) -> float:
    """When the quintic law has done a share of its way, by bisection; 0 to 1."""
    low, high = 0.0, 1.0
    while high - low > 1e-13:
        middle = 0.5 * (low + high)
        done = middle**3 * (10.0 + middle * (-15.0 + 6.0 * middle))
        low, high = (middle, high) if done < share else (low, middle)
    return low


def _by_ruckig(path: Path, each: Sequence[Bounds], end_speed: float) -> tuple[_Intervals, Vector]:
    """Lines by Ruckig between corners at a constant speed; u is time."""
    limit = [
        constant_speed(row, b.speed, b.acceleration, b.jerk, b.downward)
        for row, b in zip(path.table, each, strict=True)
    ]
    speeds, shares = _corner_speeds(path, each, limit, end_speed)
    rows: list[tuple[float, ...]] = []
    for i, (length, bounds) in enumerate(zip(path.length.tolist(), each, strict=True)):
        start, end = speeds[i], speeds[i + 1]
        if path.sharpness[i] > 0.0:
            part = length / _CORNER_PARTS
            rows += [(m * part, start, 0.0, 0.0, i, part / start) for m in range(_CORNER_PARTS)]
        else:
            limits = Bounds(limit[i], bounds.acceleration / shares[i], bounds.jerk / shares[i])
            rows += [(*phase[:4], i, phase[4]) for phase in _line(length, start, end, limits)]
    table = np.array(rows)
    warp = np.zeros((len(table), 3))
    warp[:, 0] = 1.0
    return _Intervals(np.ascontiguousarray(table[:, :5]), np.ascontiguousarray(table[:, 5])), warp


def _corner_speeds(
    path: Path, each: Sequence[Bounds], limit: Sequence[float], end_speed: float
) -> tuple[list[float], list[float]]:
    """Speeds between the pieces, and the share of a line's acceleration that its strongest axis takes."""
    count = len(path.length)
    speeds = [0.0, *(min(pair) for pair in pairwise(limit)), end_speed]
    shares = np.abs(path.tangent).max(axis=1).tolist()
    for order in (range(count), range(count - 1, -1, -1), range(count)):
        for i in order:
            low, high = (i, i + 1) if speeds[i] < speeds[i + 1] else (i + 1, i)
            if path.sharpness[i] > 0.0:
                speeds[high] = speeds[low]
            elif speeds[high] > speeds[low]:
                acceleration, jerk = each[i].acceleration / shares[i], each[i].jerk / shares[i]
                speeds[high] = reachable(speeds[low], speeds[high], float(path.length[i]), acceleration, jerk)
    return speeds, shares


def reachable(low: float, high: float, length: float, acceleration: float, jerk: float) -> float:
    """The largest speed up to ``high`` that a line is long enough for from ``low``, both without acceleration."""

    def way(speed: float) -> float:
        gain = speed - low
        soft = gain <= acceleration**2 / jerk
        return (
            0.5 * (low + speed) * (2.0 * math.sqrt(gain / jerk) if soft else gain / acceleration + acceleration / jerk)
        )

    if way(high) <= length:
        return high
    floor = low
    while high - floor > 1e-9:
        middle = 0.5 * (floor + high)
        floor, high = (middle, high) if way(middle) <= length else (floor, middle)
    return floor


def _line(length: float, start: float, end: float, bounds: Bounds) -> list[tuple[float, ...]]:
    """A line by Ruckig: way, speed, acceleration and jerk at the begin of each phase, and its duration."""
    problem = ruckig.InputParameter(1)
    problem.current_velocity, problem.target_velocity = [start], [end]
    problem.target_position = [length]
    problem.max_velocity = [max(bounds.speed, start, end)]
    problem.max_acceleration, problem.max_jerk = [bounds.acceleration], [bounds.jerk]
    trajectory = ruckig.Trajectory(1)
    result = ruckig.Ruckig(1).calculate(problem, trajectory)
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise RuntimeError(f"Ruckig failed with {result} on {length} m from {start} to {end} m/s within {bounds}")
    profile = trajectory.profiles[0][0]
    phases = zip(profile.p, profile.v, profile.a, profile.j, profile.t, strict=False)
    return [phase for phase in phases if phase[4] > 1e-9]
