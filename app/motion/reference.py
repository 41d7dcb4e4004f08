"""Timed references: straight rest-to-rest lines under a jerk bound, sampled at the tick.

Time along a line is one-dimensional and from Ruckig; with the line's direction as the only axis, the tool's velocity,
acceleration and jerk are bounded as vectors, and the line is exactly straight.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import ruckig
from numpy.typing import NDArray

from controller.protocol import SAMPLE

Vector = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Bounds:
    """Largest speed [m/s], acceleration [m/s²] and jerk [m/s³] along a path."""

    speed: float
    acceleration: float
    jerk: float


@dataclass(frozen=True, slots=True)
class Segment:
    """Positions, velocities, accelerations, each (n, 3) in the base frame, one row a tick after the segment's start."""

    position: Vector
    velocity: Vector
    acceleration: Vector

    def __len__(self) -> int:
        return len(self.position)


def line(start: Vector, end: Vector, bounds: Bounds, tick: float) -> Segment:
    """From rest to rest along a straight line, as quickly as the bounds allow.

    Args:
        start: point (3,) [m].
        end: point (3,) [m].
        bounds: along the line.
        tick: sampling period [s].

    Returns:
        Samples at tick, 2·tick, …; the last one is at rest exactly at ``end``. Empty when start and end coincide.
    """
    way = np.asarray(end, dtype=float) - start
    length = float(np.linalg.norm(way))
    if length < 1e-9:
        return dwell(np.asarray(end, dtype=float), 0)
    trajectory = _rest_to_rest(length, bounds)
    ticks = int(np.ceil(trajectory.duration / tick - 1e-9))
    times = np.minimum(np.arange(1, ticks + 1) * tick, trajectory.duration)
    states = np.array([trajectory.at_time(float(t)) for t in times])[:, :, 0]
    states[-1] = length, 0.0, 0.0
    direction = way / length
    position = start + states[:, :1] * direction
    position[-1] = end
    return Segment(position, states[:, 1:2] * direction, states[:, 2:3] * direction)


def _rest_to_rest(length: float, bounds: Bounds) -> ruckig.Trajectory:
    parameters = ruckig.InputParameter(1)
    parameters.target_position = [length]
    parameters.max_velocity = [bounds.speed]
    parameters.max_acceleration = [bounds.acceleration]
    parameters.max_jerk = [bounds.jerk]
    trajectory = ruckig.Trajectory(1)
    result = ruckig.Ruckig(1).calculate(parameters, trajectory)
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise RuntimeError(f"Ruckig failed with {result} on {length} m within {bounds}")
    return trajectory


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
