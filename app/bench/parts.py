"""The parts of a tick, each alone in a compiled loop over recorded ticks: what they cost without Python's calls."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter_ns
from typing import NamedTuple

import numpy as np

from controller.law import estimate, task_space_law
from controller.model.compiled import FloatArray, compiled
from controller.model.constants import DeltaModel
from controller.model.dynamics import gravity_torque, joint_inertia, shaft_friction, task_inertia
from controller.model.kinematics import arm_directions, control_jacobian, forward_kinematics, newton_step

BATCH = 100
"""Ticks of one timed call; its duration divided by this is one value of a part."""


class Poses(NamedTuple):
    """Recorded ticks as arrays, one row each: y and ẏ (n, 3), x before and after Newton (n, 6), z (n, 3), J_c and its
    inverse (n, 3, 3)."""

    angle: FloatArray
    velocity: FloatArray
    warm: FloatArray
    unmeasured: FloatArray
    position: FloatArray
    jacobian: FloatArray
    inverse: FloatArray


@compiled
def residuals(constants: FloatArray, angle: FloatArray, unmeasured: FloatArray, out: FloatArray) -> None:
    """|h| of (3) [m] that each solution x (n, 6) at angles y (n, 3) leaves; ``out`` (n,)."""
    for k in range(angle.shape[0]):
        out[k] = newton_step(constants, angle[k], unmeasured[k].copy())[1]


@compiled
def _newton(constants: FloatArray, p: Poses, first: int, last: int, out: FloatArray) -> float:
    x = out[0, :6]
    total = 0.0
    for k in range(first, last):
        for i in range(6):
            x[i] = p.warm[k, i]
        total += forward_kinematics(constants, p.angle[k], x)[1]
    return total


@compiled
def _jacobian(constants: FloatArray, p: Poses, first: int, last: int, out: FloatArray) -> float:
    total = 0.0
    for k in range(first, last):
        d, e = arm_directions(constants, p.angle[k], (p.position[k, 0], p.position[k, 1], p.position[k, 2]))
        total += control_jacobian(constants, d, e, out[:3, :3], out[3:6, :3])[1]
    return total


@compiled
def _directions(constants: FloatArray, p: Poses, first: int, last: int, out: FloatArray) -> float:
    total = 0.0
    for k in range(first, last):
        d, e = arm_directions(constants, p.angle[k], (p.position[k, 0], p.position[k, 1], p.position[k, 2]))
        total += d[0][0] + d[1][1] + d[2][2] + e[0][2] + e[1][2] + e[2][2]
    return total


@compiled
def _inertia(constants: FloatArray, p: Poses, first: int, last: int, out: FloatArray) -> float:
    total = 0.0
    for k in range(first, last):
        _, e = arm_directions(constants, p.angle[k], (p.position[k, 0], p.position[k, 1], p.position[k, 2]))
        joint_inertia(constants, e, p.jacobian[k], out[:3, :3].copy())
        task_inertia(constants, e, p.inverse[k], out[3:6, :3].copy())
        total += e[0][2]
    return total


@compiled
def _gravity(constants: FloatArray, p: Poses, first: int, last: int, out: FloatArray) -> float:
    total = 0.0
    for k in range(first, last):
        _, e = arm_directions(constants, p.angle[k], (p.position[k, 0], p.position[k, 1], p.position[k, 2]))
        gravity_torque(constants, e, p.jacobian[k], out[0, :3])
        total += out[0, 0]
    return total


@compiled
def _friction(constants: FloatArray, p: Poses, first: int, last: int, out: FloatArray) -> float:
    total = 0.0
    for k in range(first, last):
        for i in range(3):
            total += shaft_friction(p.velocity[k, i], 0.004, 0.02, 0.05)
    return total
