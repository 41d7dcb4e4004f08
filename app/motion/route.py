"""A route is all that a motion's samples follow from, so that it can be timed again from another start.

A guard ends a set-down wherever the board is. What follows begins there, not where it was planned: its route is timed
again from the arm's present reference, which takes a few milliseconds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.motion.gain_schedule import Softness, progress, scheduled
from app.motion.path import STRAIGHT, Path, Vector, blend, turns
from app.motion.settings import Law, MotionSettings
from app.motion.timing.reference import Segment, along, dwell, glide, join, to_samples
from app.motion.timing.time_law import Bounds, time_law
from controller.protocol import Guard
from hardware.table import TableSettings

NEAR = 1e-7
"""Points closer than this are one [m]."""


@dataclass(frozen=True, slots=True)
class Route:
    """Where a motion goes and how; points in the base frame [m]."""

    points: Vector
    """Corners of the way, (n, 3); one point: the arm stays."""
    tangents: Vector
    """How far before each inner point its corner begins, (n - 2,) [m]; 0: the arm stops there."""
    bounds: tuple[Bounds, ...]
    """Of each line, n - 1."""
    contact: tuple[float, float]
    """Height of the tool over the board at which something touches, at the start and at the end [m]."""
    finger: float
    """Position of a finger at the start [m]."""
    wait: float = 0.0
    """Before the arm moves [s]."""
    opens: float | None = None
    """The fingers open to this during the wait and after [m]; None: they go on pressing."""
    then: float | None = None
    """Finger position for what comes next, from the highest point on [m]; None: as it is."""
    closes: float | None = None
    """At the very end of the way, as far as time allows, the fingers close to this [m]; None: they do not."""
    soft_start: Softness = Softness.STIFF
    """z1 yields at the start: it has, or begins to."""
    touches: bool = False
    """The way goes straight on below its end, slowly, until the tool touches."""
    grips: float | None = None
    """The fingers close until they grip, which from so much later on may be believed [s]; None: they grip nothing."""
    holds: bool = False
    """A piece is in the fingers; the arm stops where it gets lost before the tool goes down to touch."""

    def from_point(self, start: Vector) -> Route:
        """The same from another start (3,) [m]; the first line changes."""
        points = np.array(self.points)
        points[0] = start
        return replace(self, points=points)


@dataclass(frozen=True, slots=True)
class Timed:
    """Samples of a route, and where they go; the paths between stops; how long all should take [s]."""

    samples: NDArray[Any]
    motion: Segment
    paths: tuple[Path, ...]
    expected: float
    finger: float
    """Where the fingers are in the end [m]."""


def timed(route: Route, settings: MotionSettings, table: TableSettings, tick: float) -> Timed:
    """Time a route: path, law, fingers, gains, guard."""
    ticks = math.ceil(route.wait / tick - 1e-9)
    segments, paths = [dwell(route.points[0], 1 + ticks)], list[Path]()
    for start, end in _sections(route):
        speed = settings.touch_speed if route.touches and end == len(route.points) - 1 else 0.0
        path, segment = _section(route, start, end, speed, settings, tick)
        paths.append(path)
        segments.append(segment)
    moved = sum(map(len, segments))
    expected = (moved - 1) * tick
    if route.touches:
        descent = _descent(segments[-1], route.bounds[-1], settings, tick)
        segments.append(descent)
        expected += settings.touch_height / settings.touch_speed + settings.touch_delay
    whole = join(segments)
    finger_velocity, finger = _fingers(route, whole, ticks, settings, tick)
    samples = to_samples(whole, _gains(route, whole, settings, table, tick), finger_velocity)
    if route.holds:
        samples["guard"], samples["guard_level"] = Guard.HELD, settings.grip.held_force
    if route.touches:
        samples["guard"][moved:], samples["guard_level"][moved:] = Guard.TOUCH, settings.touch_force
    if route.grips is not None:
        sure = samples[math.floor(route.grips / tick) :]
        sure["guard"], sure["guard_level"] = Guard.GRIP, settings.grip.guard_force
    if route.soft_start is not Softness.STIFF:
        samples["tactile_gain"] = settings.gains.tactile_gain * (samples["stiffness"][:, 0] < 1.0)
    samples.flags.writeable = False
    return Timed(samples, whole, tuple(paths), expected, finger)


def _sections(route: Route) -> list[tuple[int, int]]:
    """From stop to stop, as first and last point."""
    if len(route.points) < 2:
        return []
    turn = turns(route.points) if len(route.points) > 2 else np.zeros(0)
    stops = [i + 1 for i in range(len(turn)) if turn[i] > STRAIGHT and route.tangents[i] <= 0.0]
    ends = [0, *stops, len(route.points) - 1]
    return list(pairwise(ends))


def _section(
    route: Route, start: int, end: int, speed: float, settings: MotionSettings, tick: float
) -> tuple[Path, Segment]:
    points = route.points[start : end + 1]
    path = blend(points, _fitted(points, route.tangents[start : end - 1]))
    bounds = route.bounds[start:end]
    if speed > 0.0 and settings.law is Law.MINIMUM_JERK:
        segment = along(path, time_law(path, bounds, settings.law), tick)
        return path, segment
    return path, along(path, time_law(path, bounds, settings.law, speed), tick)


def _fitted(points: Vector, tangents: Vector) -> Vector:
    """Corners as asked, smaller where a line has become too short for them."""
    fitted = tangents.tolist()
    for i, (start, end) in enumerate(pairwise(points.tolist())):
        length = math.dist(start, end)
        room = (fitted[i - 1] if i > 0 else 0.0) + (fitted[i] if i < len(fitted) else 0.0)
        if room > 0.98 * length:
            for k in {i - 1, i} & set(range(len(fitted))):
                fitted[k] *= 0.98 * length / room
    return np.array(fitted, dtype=float)


def _descent(before: Segment, last: Bounds, settings: MotionSettings, tick: float) -> Segment:
    """Straight on and down from where the way ends, to far below where the board should be."""
    velocity = before.velocity[-1]
    way = settings.touch_height + settings.touch_depth
    bounds = Bounds(settings.touch_speed, last.acceleration, last.jerk)
    if np.linalg.norm(velocity) > 0.0:
        return glide(before.position[-1], velocity, way, bounds, tick)
    down = np.array([0.0, 0.0, way])
    path = blend(np.array([before.position[-1], before.position[-1] + down]), np.zeros(0))
    return along(path, time_law(path, [bounds]), tick)


def _fingers(route: Route, whole: Segment, wait: int, settings: MotionSettings, tick: float) -> tuple[Vector, float]:
    """Velocity of a finger at each sample, and where it is in the end [m]."""
    grip = settings.grip
    velocity = np.zeros(len(whole))
    if route.opens is None:
        velocity[:] = -grip.closing_speed
        return velocity, route.finger
    begin = min(wait, math.ceil(settings.release_wait / tick)) if wait else 0
    velocity[:begin] = -grip.closing_speed
    position = _move_fingers(velocity, begin, route.finger, route.opens, grip.opening_speed, tick)
    if route.then is not None:
        begin = max(int(np.argmin(whole.position[:, 2])), np.flatnonzero(velocity)[-1] + 1 if velocity.any() else 0)
        position = _move_fingers(velocity, begin, position, route.then, grip.opening_speed, tick)
    if route.closes is not None:
        needed = math.ceil((position - route.closes) / (grip.opening_speed * tick))
        low = np.flatnonzero(whole.position[:, 2] < whole.position[-1, 2] - grip.beside_way)
        begin = max(len(velocity) - max(needed, 0), low[-1] + 1 if low.size else 0)
        if not velocity[begin:].any():
            position = _move_fingers(velocity, begin, position, route.closes, grip.opening_speed, tick)
        # the last one lasts until the next motion begins, in which they close
        position -= (grip.closing_speed + velocity[-1]) * tick
        velocity[-1] = -grip.closing_speed
    return velocity, position


def _move_fingers(velocity: Vector, begin: int, position: float, target: float, speed: float, tick: float) -> float:
    way = target - position
    ticks = min(len(velocity) - begin, math.ceil(abs(way) / (speed * tick) - 1e-9))
    if ticks > 0:
        rate = min(speed, abs(way) / (ticks * tick))
        velocity[begin : begin + ticks] = math.copysign(rate, way)
        position += math.copysign(rate, way) * ticks * tick
    return position


def _gains(route: Route, whole: Segment, settings: MotionSettings, table: TableSettings, tick: float) -> Vector:
    share = progress(whole.table)
    contact = route.contact[0] + share * (route.contact[1] - route.contact[0])
    height = table.centre_in_base[2] - whole.position[:, 2] - contact
    begun = tick * np.arange(float(len(whole)))
    return scheduled(height, share, begun - route.wait, begun, route.soft_start, settings.gains)
