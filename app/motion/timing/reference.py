"""Timed references: a path and its time law sampled at the tick, and what stands or glides straight on."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from app.motion.path import Path, Vector, blend
from app.motion.timing.time_law import Bounds, TimeParameterisation, line_law, time_law
from controller.protocol import SAMPLE

__all__ = ["Bounds", "Segment", "Vector", "along", "dwell", "eased", "glide", "join", "line", "to_samples"]


@dataclass(frozen=True, slots=True)
class Segment:
    """Rows a tick apart, the first one a tick after the segment's start."""

    table: Vector
    """Position [m], velocity [m/s], acceleration [m/s²] in the base frame, (n, 9)."""

    @property
    def position(self) -> Vector:
        """(n, 3) [m]."""
        return self.table[:, 0:3]

    @property
    def velocity(self) -> Vector:
        """(n, 3) [m/s]."""
        return self.table[:, 3:6]

    @property
    def acceleration(self) -> Vector:
        """(n, 3) [m/s²]."""
        return self.table[:, 6:9]

    def __len__(self) -> int:
        return len(self.table)


def along(path: Path, law: TimeParameterisation, tick: float) -> Segment:
    """A path by its law, slowed down by less than a tick so that it ends with one: the last sample is its end."""
    ticks = max(1, math.ceil(law.duration / tick - 1e-9))
    law = law.stretched(ticks * tick / law.duration)
    at = law.trace(path, tick * np.arange(1.0, ticks + 1.0))
    at.position[-1] = path.end
    if at.speed[-1] < 1e-4:  # at rest, but for rounding
        at.velocity[-1] = at.acceleration[-1] = 0.0
    return Segment(at.motion)


def line(start: Vector, end: Vector, bounds: Bounds, tick: float) -> Segment:
    """From rest to rest along a straight line between two points (3,) [m], as quickly as the bounds of each axis allow.

    Returns:
        Samples at tick, 2·tick, …; the last one is at rest exactly at ``end``. Empty when start and end coincide.
    """
    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    if np.linalg.norm(end - start) < 1e-9:
        return dwell(end, 0)
    path = blend(np.array([start, end]), np.zeros(0))
    segment = along(path, time_law(path, [bounds]), tick)
    segment.position[-1] = end
    return segment


def glide(start: Vector, velocity: Vector, way: float, bounds: Bounds, tick: float) -> Segment:
    """Straight on at a velocity (3,) [m/s] for most of a way [m], then to rest."""
    speed = float(np.linalg.norm(velocity))
    path = blend(np.array([start, start + way * velocity / speed]), np.zeros(0))
    limits = Bounds(speed, bounds.acceleration, bounds.jerk)
    return along(path, line_law(path, limits, speed), tick)


def dwell(point: Vector, ticks: int) -> Segment:
    """Rest at a point (3,) for some ticks."""
    table = np.zeros((ticks, 9))
    table[:, 0:3] = point
    return Segment(table)


def join(segments: list[Segment]) -> Segment:
    """Segments one after the other; each must start where the one before ends."""
    return Segment(np.concatenate([segment.table for segment in segments]))


def eased(ticks: int, tick: float) -> Vector:
    """From 0 to 1 with rest at both ends, by a quintic: value, rate and its change at 1, 2, … ticks, (ticks, 3)."""
    t, duration = np.arange(1.0, ticks + 1.0) / ticks, ticks * tick
    return np.stack([
        t**3 * (10.0 - 15.0 * t + 6.0 * t**2), 30.0 * t**2 * (1.0 - t) ** 2 / duration,
        60.0 * t * (1.0 - t) * (1.0 - 2.0 * t) / duration**2,
    ], axis=1)  # fmt: skip


_FIELDS = cast("Mapping[str, Any]", SAMPLE.fields)
_GROUPS = np.dtype({
    "names": ["motion", "gains"], "formats": ["(9,)<f8", "(6,)<f4"], "itemsize": SAMPLE.itemsize,
    "offsets": [_FIELDS["position"][1], _FIELDS["stiffness"][1]],
})  # fmt: skip
"""A sample's fields that follow each other, as one: writing them costs per field."""


def to_samples(path: Segment, gains: Vector, finger_velocity: Vector) -> NDArray[Any]:
    """Samples for the wire: k_p [1/s²] and k_v [1/s] of each axis, (n, 6); fingers, opening positive, (n,) [m/s]."""
    samples = np.zeros(len(path), dtype=SAMPLE)
    groups = samples.view(_GROUPS)
    groups["motion"], groups["gains"] = path.table, gains
    samples["finger_velocity"] = finger_velocity
    return samples
