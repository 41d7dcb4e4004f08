"""Timed references: a path and its time law sampled at the tick, and what stands or glides straight on."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.motion.path import Path, Vector, blend
from app.motion.time_law import Bounds, TimeLaw, line_law, time_law
from controller.protocol import SAMPLE

__all__ = ["Bounds", "Segment", "Vector", "along", "dwell", "glide", "join", "line", "to_samples"]


@dataclass(frozen=True, slots=True)
class Segment:
    """Positions, velocities, accelerations, each (n, 3) in the base frame, one row a tick after the segment's start."""

    position: Vector
    velocity: Vector
    acceleration: Vector

    def __len__(self) -> int:
        return len(self.position)


def along(path: Path, law: TimeLaw, tick: float) -> Segment:
    """A path by its law, slowed down by less than a tick so that it ends with one.

    Returns:
        Samples at tick, 2·tick, …; the last one is exactly at the path's end.
    """
    ticks = max(1, math.ceil(law.duration / tick - 1e-9))
    law = law.stretched(ticks * tick / law.duration)
    at = law.trace(path, tick * np.arange(1.0, ticks + 1.0))
    at.position[-1] = path.position(np.array([path.total]))[0]
    if at.speed[-1] < 1e-4:  # at rest, but for rounding
        at.velocity[-1] = at.acceleration[-1] = 0.0
    return Segment(at.position, at.velocity, at.acceleration)


def line(start: Vector, end: Vector, bounds: Bounds, tick: float) -> Segment:
    """From rest to rest along a straight line, as quickly as the bounds allow.

    Args:
        start: point (3,) [m].
        end: point (3,) [m].
        bounds: speed along the line, acceleration and jerk of each axis.
        tick: sampling period [s].

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
    still = np.zeros((ticks, 3))
    return Segment(np.tile(point, (ticks, 1)), still, still)


def join(segments: list[Segment]) -> Segment:
    """Segments one after the other; each must start where the one before ends."""
    return Segment(
        np.concatenate([s.position for s in segments]),
        np.concatenate([s.velocity for s in segments]),
        np.concatenate([s.acceleration for s in segments]),
    )


def to_samples(path: Segment, stiffness: Vector, damping: Vector, finger_velocity: Vector) -> NDArray[Any]:
    """Samples for the wire.

    Args:
        path: n rows.
        stiffness: k_p (n, 3) [1/s²].
        damping: k_v (n, 3) [1/s].
        finger_velocity: (n,), positive opening [m/s].
    """
    samples = np.zeros(len(path), dtype=SAMPLE)
    samples["position"], samples["velocity"], samples["acceleration"] = path.position, path.velocity, path.acceleration
    samples["stiffness"], samples["damping"] = stiffness, damping
    samples["finger_velocity"] = finger_velocity
    return samples
