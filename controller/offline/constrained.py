"""The paper's own formulation (2) in nine coordinates, plainly in NumPy: a reference, not for the loop.

q = (q_11, q_12, q_13, q_21, …, q_33), shape (9,) [rad]; v = q̇ [rad/s]. `MEASURED` and `UNMEASURED` pick y and x.
"""

from typing import NamedTuple

import numpy as np

from controller.model.compiled import FloatArray
from controller.model.constants import COULOMB, DISTAL, PROXIMAL, VISCOUS, DeltaModel
from controller.model.dynamics import arm_coriolis, arm_gravity, arm_inertia, shaft_friction
from controller.model.kinematics import arm_tool_point, elbow, triad
from controller.model.second_order import arm_drift

MEASURED = np.array([0, 3, 6])
UNMEASURED = np.array([1, 2, 4, 5, 7, 8])

_SIGNS = ((1.0, 1.0), (-1.0, 0.0), (0.0, -1.0))
"""Of psi_1, psi_2, psi_3 in the two rows of (3)."""


def coordinates(y: FloatArray, x: FloatArray) -> FloatArray:
    """q, shape (9,), from y, shape (3,), and x, shape (6,) [rad]; rates alike."""
    q = np.empty(9)
    q[MEASURED], q[UNMEASURED] = y, x
    return q


def inertia_matrix(model: DeltaModel, q: FloatArray) -> FloatArray:
    """M(q), shape (9, 9), block diagonal [kg m²]."""
    matrix = np.zeros((9, 9))
    for k in (0, 3, 6):
        m11, m12, m13, m22, m33 = arm_inertia(model.constants, k // 3, *q[k : k + 3])
        matrix[k : k + 3, k : k + 3] = [[m11, m12, m13], [m12, m22, 0.0], [m13, 0.0, m33]]
    return matrix


def coriolis_torque(model: DeltaModel, q: FloatArray, v: FloatArray) -> FloatArray:
    """C(q, v), shape (9,) [N m]."""
    arms = ((k // 3, _triple(q, k), _triple(v, k)) for k in (0, 3, 6))
    return np.concatenate([arm_coriolis(model.constants, *arm) for arm in arms])


def gravity_torque(model: DeltaModel, q: FloatArray) -> FloatArray:
    """G(q), shape (9,) [N m]."""
    return np.concatenate([arm_gravity(model.constants, k // 3, *_triple(q, k)) for k in (0, 3, 6)])


def friction_torque(model: DeltaModel, v: FloatArray, speed: float) -> FloatArray:
    """D(v), shape (9,): shafts only, Coulomb's sign smoothed over ``speed`` [rad/s] [N m]."""
    torque = np.zeros(9)
    for arm, k in enumerate(MEASURED):
        viscous, coulomb = model.constants[VISCOUS + arm], model.constants[COULOMB + arm]
        torque[k] = shaft_friction(float(v[k]), viscous, coulomb, speed)
    return torque


def input_matrix() -> FloatArray:
    """B, shape (9, 3): the servomotors act on q_i1."""
    matrix = np.zeros((9, 3))
    matrix[MEASURED, [0, 1, 2]] = 1.0
    return matrix


def tool_points(model: DeltaModel, q: FloatArray) -> FloatArray:
    """psi_1, psi_2, psi_3 of (1), shape (3, 3), one row for each arm [m]."""
    return np.array([arm_tool_point(model.constants, arm, *_triple(q, 3 * arm)) for arm in range(3)])


def constraint(model: DeltaModel, q: FloatArray) -> FloatArray:
    """h(q) of (3), shape (6,) [m]."""
    psi = tool_points(model, q)
    return np.concatenate([psi[0] - psi[1], psi[0] - psi[2]])


def arm_jacobian(model: DeltaModel, arm: int, q: FloatArray) -> FloatArray:
    """∂psi_i/∂q_i, shape (3, 3), of arm 0, 1 or 2 with angles q, shape (3,) [m/rad]."""
    e = np.array(elbow(model.constants, arm, float(q[0]))[1])
    _, a, n = (np.array(w) for w in triad(arm, float(q[1]), float(q[2])))
    l1, l2 = model.constants[PROXIMAL], model.constants[DISTAL]
    return np.stack([l1 * e, l2 * a, l2 * np.sin(q[1]) * n], axis=1)


def constraint_jacobian(model: DeltaModel, q: FloatArray) -> FloatArray:
    """H(q) = ∂h/∂q, shape (6, 9) [m/rad]."""
    blocks = [arm_jacobian(model, arm, q[3 * arm : 3 * arm + 3]) for arm in range(3)]
    return np.block([[_SIGNS[arm][row] * blocks[arm] for arm in range(3)] for row in range(2)])


def constraint_drift(model: DeltaModel, q: FloatArray, v: FloatArray) -> FloatArray:
    """Ḣ v, shape (6,): the constraint's acceleration where q̈ = 0 [m/s²]."""
    psi = [np.array(arm_drift(model.constants, arm, _triple(q, 3 * arm), _triple(v, 3 * arm))) for arm in range(3)]
    return np.concatenate([psi[0] - psi[1], psi[0] - psi[2]])


def virtual_jacobian(model: DeltaModel, q: FloatArray) -> FloatArray:
    """J_v(q) of (9), shape (3, 9): a force f at the tool gives the virtual torques J_vᵀ f of (10) [m/rad]."""
    return np.hstack([arm_jacobian(model, arm, q[3 * arm : 3 * arm + 3]) for arm in range(3)]) / 3.0


def acceleration(
    model: DeltaModel, q: FloatArray, v: FloatArray, applied: FloatArray, alpha: tuple[float, float]
) -> FloatArray:
    """v̇ of (2b) with (2c), shape (9,) [rad/s²]: the constrained robot with Baumgarte's stabilisation.

    ``applied`` are all torques that are not in the model, B u + J_vᵀ f - D, shape (9,) [N m]; ``alpha`` is Baumgarte's
    α₀ [1/s²] and α₁ [1/s].
    """
    h_q = constraint_jacobian(model, q)
    matrix = np.block([[inertia_matrix(model, q), -h_q.T], [h_q, np.zeros((6, 6))]])
    torque = applied - coriolis_torque(model, q, v) - gravity_torque(model, q)
    closing = -constraint_drift(model, q, v) - alpha[1] * (h_q @ v) - alpha[0] * constraint(model, q)
    return _solve(matrix, np.concatenate([torque, closing]))[:9]


class Torques(NamedTuple):
    """What a motion takes: u, shape (3,), of the servomotors [N m], and λ, shape (6,) [N]."""

    torque: FloatArray
    multiplier: FloatArray


def inverse_dynamics(
    model: DeltaModel, q: FloatArray, v: FloatArray, acceleration: FloatArray, outside: FloatArray
) -> Torques:
    """Servomotor torques and λ of (2b) for a motion v̇, shape (9,) [rad/s²], that keeps the chain closed: by [B Hᵀ] of
    (15).

    ``outside`` are torques that are neither in the model nor of the servomotors, J_vᵀ f - D, shape (9,) [N m].
    """
    needed = inertia_matrix(model, q) @ acceleration + coriolis_torque(model, q, v) + gravity_torque(model, q) - outside
    solution = _solve(np.hstack([input_matrix(), constraint_jacobian(model, q).T]), needed)
    return Torques(solution[:3], solution[3:])


def gravity_compensation(model: DeltaModel, q: FloatArray) -> FloatArray:
    """τ_u of (15), shape (3,), by the paper's system [B Hᵀ], which is 9x9 [N m]."""
    still = np.zeros(9)
    return inverse_dynamics(model, q, still, still, still).torque


def tangent(model: DeltaModel, q: FloatArray) -> FloatArray:
    """T = [I; g_y] in the order of q, shape (9, 3), by (14) as printed: v = T ẏ keeps the chain closed."""
    h_q = constraint_jacobian(model, q)
    matrix = np.zeros((9, 3))
    matrix[MEASURED] = np.eye(3)
    matrix[UNMEASURED] = -_solve(h_q[:, UNMEASURED], h_q[:, MEASURED])
    return matrix


def acceleration_at(model: DeltaModel, q: FloatArray, v: FloatArray, joint_acceleration: FloatArray) -> FloatArray:
    """v̇, shape (9,), of a closed chain whose servomotors have ÿ, shape (3,) [rad/s²], by (17)."""
    h_q = constraint_jacobian(model, q)
    known = h_q[:, MEASURED] @ joint_acceleration + constraint_drift(model, q, v)
    return coordinates(joint_acceleration, -_solve(h_q[:, UNMEASURED], known))


def velocity_torque(model: DeltaModel, q: FloatArray, v: FloatArray) -> FloatArray:
    """The term a of (18), shape (3,), projected: Tᵀ (C + M (0, ẍ at ÿ = 0)) [N m]."""
    drift = acceleration_at(model, q, v, np.zeros(3))
    projected = tangent(model, q).T @ (coriolis_torque(model, q, v) + inertia_matrix(model, q) @ drift)
    return np.asarray(projected, dtype=np.float64)


def _solve(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """The solution of a general linear system."""
    return np.asarray(np.linalg.solve(matrix, right), dtype=np.float64)


def _triple(values: FloatArray, start: int) -> tuple[float, float, float]:
    """Three neighbouring entries as Python floats."""
    a, b, c = values[start : start + 3].tolist()
    return a, b, c
