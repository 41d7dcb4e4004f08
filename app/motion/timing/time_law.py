"""When the tool is where on its path: near-minimum-time laws within bounds on speed, acceleration and jerk.

A single line is Ruckig's. Along a path with corners Ruckig can take each line from one corner's speed to the next, and
corners at a constant speed, as fast as curvature and its rate admit (`Law.RUCKIG`). That obeys all bounds but loses
time, since it may not accelerate in corners: on transfers of chess pieces it takes a fifth longer than the optimum.
So there the law is refined, and takes about one percent longer than that (``touchmove bench motion``). Where corners
are so gentle that Ruckig's is hardly slower, it is refined, too. What is found is never slower than it.

To refine is to find how fast the parameter u of a way s(u), cubic between nodes, runs: u̇² = b(u). `limits` says what
the bounds are for b, `interior_point` finds the quickest. Every result obeys the bounds at the nodes, however early it
stops; by what they are exceeded between them, some tenths of a percent, `excess` finds.

Acceleration and jerk are bounded along each axis of the base frame; speed as the length of its vector, and downwards.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import ruckig

from app.motion.curves import begins, trace
from app.motion.path import Path, Vector
from app.motion.settings import Law
from app.motion.timing.grid import divided, grid
from app.motion.timing.interior_point import minimise
from app.motion.timing.limits import LOOKS, excess, gather, limits, speeds

GAP: Final = 0.003
"""How far from the optimum the refinement may stop, as a share of the duration."""
_SPARE: Final = 0.8
"""The refinement begins so much slower than the bounds admit."""
_FIRST_LOOKS: Final = 2
"""Parts of an interval at whose ends the bounds are looked at in the beginning."""
_CORNER_PARTS: Final = 8
"""Intervals of each half of a corner that is passed at a constant speed."""
_BETWEEN: Final = 1.0002
"""So much may be exceeded between the points at which a law is looked at; it is stretched by that."""
_HARDLY: Final = 0.9
"""Ruckig's law is refined, too, if it is not slower than the refined one by more than this …"""
_LONGEST: Final = 0.006
"""… in intervals of at most so much of its time [s]."""
_SLOWER: Final = np.array([_SPARE, _SPARE**2, _SPARE**3, _SPARE])
"""Bounds of what is slowed down by as much."""
_SAME_SPEED: Final = 1e-6
"""[m/s]"""
_ROUNDING: Final = 1e-9
_QUINTIC_PARTS: Final = 400
"""Cubic pieces of the quintic law."""


@dataclass(frozen=True, slots=True)
class Bounds:
    """Largest speed [m/s], and largest acceleration [m/s²] and jerk [m/s³] along each axis of the base frame.

    ``downward`` bounds the speed towards +z3 [m/s].
    """

    speed: float
    acceleration: float
    jerk: float
    downward: float = math.inf

    def scaled(self, factor: float) -> Bounds:
        """Accelerations and jerks times a factor; speeds stay."""
        return Bounds(self.speed, self.acceleration * factor, self.jerk * factor, self.downward)


class Traced:
    """Where the tool is at many times, one row each, of a table (m, 12) as of `curves.TRACED`.

    ``motion`` has position, velocity and acceleration, (m, 9), each also by itself in the base frame, (m, 3) [m, m/s,
    m/s²]; ``way`` and ``speed`` are along the path, (m,) [m, m/s], and ``piece`` is of the path, (m,).
    """

    def __init__(self, table: Vector) -> None:
        self.motion = table[:, 0:9]
        self.position, self.velocity, self.acceleration = table[:, 0:3], table[:, 3:6], table[:, 6:9]
        self.way, self.speed = table[:, 9], table[:, 10]
        self.piece = table[:, 11].astype(np.int64)


@dataclass(frozen=True, slots=True)
class TimeParameterisation:
    """Waypoints along the path by time, in intervals of a parameter u: the way is cubic in u, and u̇² quadratic."""

    begins: Vector
    """Of the intervals, and the end of the last one, (n + 1,) [s], before stretching."""
    rows: Vector
    """Of each interval the way along the piece and its three rates by u at its begin, the piece, the length in u, and
    the coefficients of u̇² by the way into it, (n, 9), before stretching."""
    factor: float = 1.0
    """Everything takes so many times the time."""

    @property
    def duration(self) -> float:
        """Of the whole [s]."""
        return self.factor * float(self.begins[-1])

    def trace(self, path: Path, time: Vector) -> Traced:
        """Along its path, at rising times (m,) [s]."""
        return Traced(trace(time, self.factor, self.begins, self.rows, path.table))

    def stretched(self, factor: float) -> TimeParameterisation:
        """The same way in so many times the time."""
        return TimeParameterisation(self.begins, self.rows, self.factor * factor)


def time_law(
    path: Path, bounds: Sequence[Bounds], law: Law = Law.TIME_OPTIMAL, end_speed: float = 0.0
) -> TimeParameterisation:
    """The law along a smooth path, from rest to rest or to a speed at which the path goes on straight.

    It obeys the bounds of each line of the path's polygon everywhere; a corner obeys those of both its lines.
    ``end_speed`` is reached without acceleration [m/s]; not with the quintic law.
    """
    table = _of_pieces(path, bounds)
    if law is Law.MINIMUM_JERK:
        rows = _quintic(path)
        return _law(rows, excess(path.table, table, rows, LOOKS) * _BETWEEN)
    if len(path.table) == 1:
        rows = _by_ruckig(path, table, end_speed)
        factor = excess(path.table, table, rows, LOOKS)
        return _law(rows, factor if factor > 1.0 + _ROUNDING else 1.0)
    if law is Law.RUCKIG:
        rows = _by_ruckig(path, table, end_speed)
        return _law(rows, excess(path.table, table, rows, LOOKS) * _BETWEEN)
    rows = grid(path.table, end_speed)
    refined = _law(rows, _quickest(path.table, table, rows, end_speed) * _BETWEEN)
    return min((refined, *_by_time(path, table, end_speed, refined.duration)), key=lambda one: one.duration)


def _by_time(path: Path, table: Vector, end_speed: float, refined: float) -> Iterator[TimeParameterisation]:
    """Ruckig's law, and where it takes hardly longer than the one refined by the way [s], that refined by its time."""
    rows = _by_ruckig(path, table, end_speed)
    # it is at the bound of jerk somewhere, so that it will not be shortened
    if not _reaches(rows, end_speed) or refined < _HARDLY * begins(rows)[-1]:
        return
    yield _law(rows, excess(path.table, table, rows, LOOKS) * _BETWEEN)
    # of slower bounds, which are all scaled alike: from rest to rest it is the same law, and all bounds have to spare
    rows = divided(_by_ruckig(path, table * _SLOWER, end_speed), _LONGEST)
    if _reaches(rows, end_speed):
        end_rate = 1.0 if end_speed > 0.0 else 0.0
        yield _law(rows, _quickest(path.table, table, rows, end_rate) * _BETWEEN)


def _quickest(path: Vector, bounds: Vector, rows: Vector, end_rate: float) -> float:
    """Write the quickest b(u) within the bounds at the nodes into a law's rows (`curves.ROWS`), and say its `excess`.

    ``end_rate`` is u̇ at the end, where there is no acceleration; it must be within all bounds everywhere. 0: at rest,
    whatever u does.
    """
    begin = end_rate or _SPARE / excess(path, bounds, rows, _FIRST_LOOKS)
    caps, where, table = np.empty((len(rows), 3)), np.empty((9 * len(rows), 2)), np.empty((9 * len(rows), 5))
    count = gather(path, bounds, rows, caps, where, table)
    minimise(rows, caps, where[:count], table[:count], begin * begin, GAP, end_rate > 0.0)
    return excess(path, bounds, rows, LOOKS)


def _reaches(rows: Vector, end_speed: float) -> bool:
    """Whether a law of which u is time ends at a speed [m/s]: its last line may be too short for that."""
    _, speed, acceleration, jerk, _, time, *_ = rows[-1].tolist()
    reached: float = speed + time * (acceleration + 0.5 * time * jerk)
    return abs(reached - end_speed) < _SAME_SPEED


def line_law(path: Path, bounds: Bounds, start_speed: float) -> TimeParameterisation:
    """Along one line, by Ruckig, from a speed without acceleration to rest."""
    return _law(_intervals([(*phase[:4], 0, phase[4]) for phase in _line(path.total, start_speed, 0.0, bounds)]), 1.0)


def _law(rows: Vector, factor: float) -> TimeParameterisation:
    """Of intervals, in so many times the time they take."""
    return TimeParameterisation(begins(rows), rows, factor)


def _intervals(parts: Sequence[tuple[float, ...]]) -> Vector:
    """Columns as of `curves.ROWS` from way, its three rates, piece and length in u, which is time, (n, 9)."""
    return np.array([(*part, 1.0, 0.0, 0.0) for part in parts])


def bounds_of_pieces(path: Path, bounds: Sequence[Bounds]) -> list[Bounds]:
    """Of each piece of a path: those of its line; of a corner the tighter ones of both its lines."""
    return [Bounds(*row) for row in _of_pieces(path, bounds).tolist()]


def _of_pieces(path: Path, bounds: Sequence[Bounds]) -> Vector:
    return limits(path.table, np.array([(b.speed, b.acceleration, b.jerk, b.downward) for b in bounds]))


def _quintic(path: Path) -> Vector:
    """S = L (10 τ³ - 15 τ⁴ + 6 τ⁵), in cubic pieces that agree with it to the second derivative at their ends.

    In one second, to be stretched to what the bounds admit.
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
    columns = [scale * way[:-1] - path.begins[piece], scale * speed[:-1], scale * acceleration[:-1], scale * jerk]
    return _intervals(np.column_stack([*columns, piece.astype(float), step]).tolist())


def _quintic_time(share: float) -> float:
    """When the quintic law has done a share of its way, by bisection; 0 to 1."""
    low, high = 0.0, 1.0
    while high - low > 1e-13:
        middle = 0.5 * (low + high)
        done = middle**3 * (10.0 + middle * (-15.0 + 6.0 * middle))
        low, high = (middle, high) if done < share else (low, middle)
    return low


def _by_ruckig(path: Path, table: Vector, end_speed: float) -> Vector:
    """Lines by Ruckig between corners at a constant speed; u is time; ``table`` as of `limits`."""
    rows: list[tuple[float, ...]] = []
    shares = np.abs(path.tangent).max(axis=1).tolist()  # of a line's acceleration that its strongest axis takes
    pieces = zip(
        path.table[:, 6:9].tolist(), speeds(path.table, table, end_speed).tolist(), table.tolist(), strict=True
    )
    for i, ((sharpness, _, length), (start, end, most), bound) in enumerate(pieces):
        if sharpness > 0.0:
            part = length / _CORNER_PARTS
            rows += [(m * part, start, 0.0, 0.0, i, part / start) for m in range(_CORNER_PARTS)]
        else:
            straight = Bounds(most, bound[1] / shares[i], bound[2] / shares[i])
            rows += [(*phase[:4], i, phase[4]) for phase in _line(length, start, end, straight)]
    return _intervals(rows)


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
