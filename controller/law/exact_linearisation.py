"""Exact feedback linearisation: (20) in joint space, and (23) in task space with what the paper leaves out of it.

Pure functions of an estimated state, see `controller.law.task_space.estimate`, and a reference, see
`controller.law.task_space`; compiled when first called. Gravity (15) and the friction D are part of every torque.
"""

from __future__ import annotations

from controller.model.compiled import FloatArray, Vector, compiled
from controller.model.kinematics import arm_directions
from controller.model.second_order import tool_drift, velocity_torque
from controller.model.state import (
    ANGLE,
    FRICTION,
    GRAVITY_TORQUE,
    INERTIA,
    INVERSE,
    JACOBIAN,
    POSITION,
    RATE,
    REFERENCE_SIZE,
    VELOCITY,
    constants_of,
)
from controller.model.vectors import combine, common_point, minus, times


@compiled
def _wanted(reference: FloatArray, position: FloatArray, velocity: FloatArray) -> Vector:
    """The accelerations v of (21)."""
    if reference.size < REFERENCE_SIZE:
        raise ValueError("a reference has 16 numbers, see REFERENCE_SIZE")
    return (
        reference[9] * (reference[0] - position[0]) + reference[12] * (reference[3] - velocity[0]) + reference[6],
        reference[10] * (reference[1] - position[1]) + reference[13] * (reference[4] - velocity[1]) + reference[7],
        reference[11] * (reference[2] - position[2]) + reference[14] * (reference[5] - velocity[2]) + reference[8],
    )


@compiled
def _velocity_terms(state: FloatArray) -> tuple[Vector, Vector]:
    """J̇_c ẏ [m/s²] and a [N m] of an estimated state."""
    constants = constants_of(state)
    y, rate, jacobian = state[ANGLE], state[RATE], state[JACOBIAN : JACOBIAN + 3]
    d, e = arm_directions(constants, y, (state[POSITION, 0], state[POSITION, 1], state[POSITION, 2]))
    drift = tool_drift(constants, y, rate, d, e, jacobian)
    return drift, velocity_torque(constants, y, rate, e, jacobian, drift)


@compiled
def _joint_torque(state: FloatArray, acceleration: Vector, velocity_torque: Vector) -> Vector:
    """M_y ÿ + a + D + τ_g [N m]."""
    u = combine(times(state[INERTIA : INERTIA + 3], acceleration), 1.0, velocity_torque)
    f, g = state[FRICTION], state[GRAVITY_TORQUE]
    return u[0] + f[0] + g[0], u[1] + f[1] + g[1], u[2] + f[2] + g[2]


@compiled
def exact_joint_law(state: FloatArray, reference: FloatArray) -> Vector:
    """(20) with (21): exact feedback linearisation in joint space, projected, with the term a complete.

        u = M_y v + D + a + τ_g,      v = k_p (r - y) + k_v (ṙ - ẏ) + r̈

    In closed loop each servomotor follows (22), ë + k_v ė + k_p e = 0 with e = y - r, whatever the others do.

    Args:
        state: shape (27, 3), as `estimate` left it; not changed.
        reference: as for `task_space_law`, but of the servomotors: r [rad], ṙ [rad/s], r̈ [rad/s²]; k* is not read.

    Returns:
        u [N m], not limited.
    """
    _, a = _velocity_terms(state)
    return _joint_torque(state, _wanted(reference, state[ANGLE], state[RATE]), a)


@compiled
def exact_task_law(state: FloatArray, reference: FloatArray, tactile: tuple[float, float]) -> Vector:
    """(23) with what it leaves out, J̇_c ẏ and a: the tool follows ë + k_v ė + k_p e = 0 exactly.

        u = M_y J_c⁻¹ (v - J̇_c ẏ) + D + a + τ_g

    Args:
        state: shape (27, 3), as `estimate` left it; not changed.
        reference: as for `task_space_law`.
        tactile: forces on the right (+z1) and left (-z1) pad, pressing positive [N].

    Returns:
        u [N m], not limited.
    """
    drift, a = _velocity_terms(state)
    v = _wanted(reference, state[POSITION], state[VELOCITY])
    v = combine(v, reference[15] * (tactile[0] - tactile[1]), (1.0, 0.0, 0.0))
    return _joint_torque(state, times(state[INVERSE : INVERSE + 3], minus(v, drift)), a)


@compiled
def neglected_acceleration(state: FloatArray) -> Vector:
    """The residual of (23): the tool gets v plus this, J̇_c ẏ - J_c M_y⁻¹ a [m/s²].

    Args:
        state: shape (27, 3), as `estimate` left it; not changed.
    """
    drift, a = _velocity_terms(state)
    m = state[INERTIA : INERTIA + 3]
    rows = (m[0, 0], m[0, 1], m[0, 2]), (m[1, 0], m[1, 1], m[1, 2]), (m[2, 0], m[2, 1], m[2, 2])
    _, braked = common_point(rows[0], rows[1], rows[2], a)
    return minus(drift, times(state[JACOBIAN : JACOBIAN + 3], braked))
