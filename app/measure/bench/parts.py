"""The parts of a tick, each alone in a compiled loop over recorded ticks: what they cost without Python's calls.

Every loop returns a sum of what it computed, so that nothing of it can be left out by the compiler.
"""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter_ns
from typing import NamedTuple

import numpy as np

from controller.model.compiled import STATUS, TABLE, VECTOR, FloatArray, Vector, compiled, compiled_as, direct
from controller.model.constants import COULOMB, VISCOUS, DeltaModel
from controller.model.dynamics import gravity_torque, joint_inertia, shaft_friction
from controller.model.kinematics import Triad, control_jacobian, elbows, tool_point_near

BATCH = 100
"""Ticks of one timed loop; its duration divided by this is one value of a part."""
FRICTION_SPEED = 0.05

Part = Callable[[slice], float]


class Poses(NamedTuple):
    """Recorded ticks as arrays, one row each."""

    angle: FloatArray
    """y, shape (n, 3) [rad]."""
    velocity: FloatArray
    """ẏ, shape (n, 3) [rad/s]."""
    near: FloatArray
    """z from which Newton starts, shape (n, 3) [m]."""
    rods: FloatArray
    """d_1, d_2, d_3, shape (n, 3, 3)."""
    elbows: FloatArray
    """e_1, e_2, e_3, shape (n, 3, 3)."""
    jacobian: FloatArray
    """J_c, shape (n, 3, 3) [m/rad]."""


@compiled_as(STATUS(TABLE, VECTOR, VECTOR))
def idle(state: FloatArray, angle: Vector, velocity: Vector) -> int:
    """Takes what the estimator takes and does nothing."""
    return 0


nothing = direct(idle)
"""The price of a call from Python."""


@compiled
def _triad(rows: FloatArray) -> Triad:
    return (
        (rows[0, 0], rows[0, 1], rows[0, 2]),
        (rows[1, 0], rows[1, 1], rows[1, 2]),
        (rows[2, 0], rows[2, 1], rows[2, 2]),
    )


@compiled
def _newton(constants: FloatArray, angle: FloatArray, near: FloatArray) -> float:
    total = 0.0
    for k in range(angle.shape[0]):
        centres, _ = elbows(constants, angle[k])
        _, steps, z, _ = tool_point_near(constants, centres, (near[k, 0], near[k, 1], near[k, 2]))
        total += steps + z[2]
    return total


@compiled
def _jacobian(constants: FloatArray, rods: FloatArray, elbows: FloatArray, room: FloatArray) -> float:
    total = 0.0
    for k in range(rods.shape[0]):
        total += control_jacobian(constants, _triad(rods[k]), _triad(elbows[k]), room[:3], room[3:])[1]
    return total


@compiled
def _inertia(constants: FloatArray, elbows: FloatArray, jacobian: FloatArray, room: FloatArray) -> float:
    total = 0.0
    for k in range(elbows.shape[0]):
        joint_inertia(constants, _triad(elbows[k]), jacobian[k], room[:3])
        total += room[0, 0]
    return total


@compiled
def _gravity(constants: FloatArray, elbows: FloatArray, jacobian: FloatArray, room: FloatArray) -> float:
    total = 0.0
    for k in range(elbows.shape[0]):
        gravity_torque(constants, _triad(elbows[k]), jacobian[k], room[0])
        total += room[0, 0]
    return total


@compiled
def _friction(constants: FloatArray, velocity: FloatArray, viscous: float, coulomb: float, speed: float) -> float:
    total = 0.0
    for k in range(velocity.shape[0]):
        for i in range(3):
            total += shaft_friction(velocity[k, i], viscous, coulomb, speed)
    return total


def parts(model: DeltaModel, poses: Poses) -> dict[str, Part]:
    """The parts by name; each runs over a slice of the recorded ticks."""
    c, p, room = model.constants, poses, np.zeros((6, 3))
    viscous, coulomb = float(c[VISCOUS]), float(c[COULOMB])
    return {
        "newton": lambda s: _newton(c, p.angle[s], p.near[s]),
        "jacobian": lambda s: _jacobian(c, p.rods[s], p.elbows[s], room),
        "inertia": lambda s: _inertia(c, p.elbows[s], p.jacobian[s], room),
        "gravity": lambda s: _gravity(c, p.elbows[s], p.jacobian[s], room),
        "friction": lambda s: _friction(c, p.velocity[s], viscous, coulomb, FRICTION_SPEED),
    }


def time_parts(model: DeltaModel, poses: Poses) -> dict[str, list[float]]:
    """Duration of each part for one tick [µs]: one value for each batch of ticks."""
    slices = [slice(k, k + BATCH) for k in range(0, len(poses.angle), BATCH)]
    found = {}
    for name, part in parts(model, poses).items():
        part(slices[0])  # compiles, or loads what was compiled
        found[name] = [_duration(part, which) / BATCH for which in slices]
    return found


def _duration(part: Part, which: slice) -> float:
    start = perf_counter_ns()
    part(which)
    return (perf_counter_ns() - start) / 1e3
