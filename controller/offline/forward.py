"""Forward dynamics of (2), compiled: the constraint forces from one 6x6 system, arm by arm otherwise.

M is block diagonal, so M⁻¹ is three closed-form inverses. Eliminate v̇ from (2b) and put it into (2c):

    (H M⁻¹ Hᵀ) λ = -(H M⁻¹ τ + Ḣ v + α₁ H v + α₀ h),     v̇ = M⁻¹ (τ + Hᵀ λ),

where τ is all torque but the constraint's. With A_i = J_i M_i⁻¹ J_iᵀ the matrix is [[A1 + A2, A1], [A1, A1 + A3]]:
symmetric, and positive definite at the kinematic singularities of arms and chain too. What stays singular is
sin q2 = 0, where the universal joint's angles do not tell the rod's direction.
"""

import math

import numpy as np

from controller.model.compiled import (
    FROZEN,
    PAIR,
    PLACED,
    ROW,
    SCALAR,
    STATUS,
    VECTOR,
    FloatArray,
    Vector,
    compiled,
    compiled_as,
)
from controller.model.constants import COULOMB, DISTAL, PROXIMAL, VISCOUS
from controller.model.dynamics import arm_coriolis, arm_energy, arm_gravity, arm_inertia, shaft_friction
from controller.model.kinematics import MIN_SINE, OK, SINGULAR, Triad, elbow, triad
from controller.model.second_order import arm_drift
from controller.model.vectors import combine, dot, minus


@compiled
def arm_columns(constants: FloatArray, arm: int, q: Vector) -> tuple[Vector, Triad]:
    """psi_i and the columns of ∂psi_i/∂q_i: l1 e_i, l2 a_i, l2 sin q2 n_i [m, m/rad]."""
    zero = (0.0, 0.0, 0.0)
    centre, e = elbow(constants, arm, q[0])
    d, a, n = triad(arm, q[1], q[2])
    l2 = constants[DISTAL]
    columns = combine(zero, constants[PROXIMAL], e), combine(zero, l2, a), combine(zero, l2 * math.sin(q[1]), n)
    return combine(centre, l2, d), columns


@compiled
def solve_arm(inertia: tuple[float, float, float, float, float], torque: Vector) -> Vector:
    """M_i⁻¹ τ_i, from the entries 11, 12, 13, 22, 33 of M_i [rad/s²]."""
    m11, m12, m13, m22, m33 = inertia
    first = (torque[0] - m12 * torque[1] / m22 - m13 * torque[2] / m33) / (m11 - m12 * m12 / m22 - m13 * m13 / m33)
    return first, (torque[1] - m12 * first) / m22, (torque[2] - m13 * first) / m33


@compiled
def cholesky_solve(matrix: FloatArray, right: FloatArray) -> bool:
    """Solve a symmetric positive definite system in place; ``right`` becomes the solution. False: not definite."""
    size = right.shape[0]
    for i in range(size):
        for j in range(i + 1):
            value = matrix[i, j]
            for k in range(j):
                value -= matrix[i, k] * matrix[j, k]
            if i == j:
                if not value > 0.0:
                    return False
                matrix[i, i] = math.sqrt(value)
            else:
                matrix[i, j] = value / matrix[j, j]
    for i in range(size):
        for k in range(i):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            right[i] -= matrix[k, i] * right[k]
        right[i] /= matrix[i, i]
    return True


@compiled
def _close(blocks: FloatArray, right: FloatArray, multiplier: FloatArray) -> bool:
    """λ from [[A1 + A2, A1], [A1, A1 + A3]] λ = -(r1 - r2, r1 - r3)."""
    matrix = np.empty((6, 6))
    for m in range(3):
        multiplier[m] = right[1, m] - right[0, m]
        multiplier[3 + m] = right[2, m] - right[0, m]
        for n in range(3):
            first = blocks[0, m, n]
            matrix[m, n] = first + blocks[1, m, n]
            matrix[m, 3 + n] = first
            matrix[3 + m, n] = first
            matrix[3 + m, 3 + n] = first + blocks[2, m, n]
    return cholesky_solve(matrix, multiplier)


@compiled
def _tip_force(arm: int, multiplier: FloatArray) -> Vector:
    """What λ does at the tip of one arm, Hᵀ λ = J_iᵀ (this) [N]."""
    if arm == 0:
        return multiplier[0] + multiplier[3], multiplier[1] + multiplier[4], multiplier[2] + multiplier[5]
    k = 3 * (arm - 1)
    return -multiplier[k], -multiplier[k + 1], -multiplier[k + 2]


@compiled
def _free_arm(
    constants: FloatArray, arm: int, q: Vector, v: Vector, torque: Vector, alpha: tuple[float, float]
) -> tuple[Vector, Vector]:
    """One arm by itself: M_i⁻¹ (τ_i - C_i - G_i) [rad/s²], and what (2c) then leaves at its tip [m/s²]."""
    own = minus(minus(torque, arm_coriolis(constants, arm, q, v)), arm_gravity(constants, arm, q[0], q[1], q[2]))
    free = solve_arm(arm_inertia(constants, arm, q[0], q[1], q[2]), own)
    psi, columns = arm_columns(constants, arm, q)
    closing = combine(arm_drift(constants, arm, q, v), alpha[0], psi)
    for j in range(3):
        closing = combine(closing, free[j] + alpha[1] * v[j], columns[j])
    return free, closing


@compiled
def _tip_mobility(constants: FloatArray, arm: int, q: Vector, block: FloatArray) -> None:
    """A_i = J_i M_i⁻¹ J_iᵀ into ``block``, shape (3, 3) [1/kg]: how the tip answers a force."""
    _, columns = arm_columns(constants, arm, q)
    inertia = arm_inertia(constants, arm, q[0], q[1], q[2])
    for m in range(3):
        answer = solve_arm(inertia, (columns[0][m], columns[1][m], columns[2][m]))
        for n in range(3):
            block[n, m] = columns[0][n] * answer[0] + columns[1][n] * answer[1] + columns[2][n] * answer[2]


@compiled_as(STATUS(FROZEN, ROW, ROW, ROW, PAIR, ROW, ROW))
def constrained_acceleration(
    constants: FloatArray,
    q: FloatArray,
    v: FloatArray,
    applied: FloatArray,
    alpha: tuple[float, float],
    acceleration: FloatArray,
    multiplier: FloatArray,
) -> int:
    """v̇ and λ of (2b) with (2c); status SINGULAR where a sin q2 vanishes or the constraints depend on each other.

    Args:
        constants: of the model.
        q: shape (9,) [rad].
        v: shape (9,) [rad/s].
        applied: shape (9,), all torques that are not in M, C, G: B u + J_vᵀ f - D [N m].
        alpha: Baumgarte's α₀ [1/s²] and α₁ [1/s].
        acceleration: shape (9,), out: v̇ [rad/s²].
        multiplier: shape (6,), out: λ [N], the forces that close the chain at arms 1-2 and 1-3.
    """
    blocks, right = np.empty((3, 3, 3)), np.empty((3, 3))
    for arm in range(3):
        k = 3 * arm
        if abs(math.sin(q[k + 1])) < MIN_SINE:
            return SINGULAR
        q_i, torque = (q[k], q[k + 1], q[k + 2]), (applied[k], applied[k + 1], applied[k + 2])
        free, closing = _free_arm(constants, arm, q_i, (v[k], v[k + 1], v[k + 2]), torque, alpha)
        _tip_mobility(constants, arm, q_i, blocks[arm])
        for j in range(3):
            acceleration[k + j] = free[j]
            right[arm, j] = closing[j]
    if not _close(blocks, right, multiplier):
        return SINGULAR
    for arm in range(3):
        k = 3 * arm
        q_i, force = (q[k], q[k + 1], q[k + 2]), _tip_force(arm, multiplier)
        _, columns = arm_columns(constants, arm, q_i)
        torque = dot(columns[0], force), dot(columns[1], force), dot(columns[2], force)
        change = solve_arm(arm_inertia(constants, arm, q_i[0], q_i[1], q_i[2]), torque)
        for j in range(3):
            acceleration[k + j] += change[j]
    return OK


@compiled_as(STATUS(FROZEN, ROW, ROW, VECTOR, VECTOR, SCALAR, ROW))
def applied_torque(
    constants: FloatArray,
    q: FloatArray,
    v: FloatArray,
    torque: Vector,
    force: Vector,
    speed: float,
    applied: FloatArray,
) -> int:
    """B u + J_vᵀ f - D(v): servomotors u [N m], a force f on the tool, base frame [N], by (10), friction in the shafts.

    ``q`` and ``v`` have shape (9,) [rad, rad/s], and so has ``applied``, out [N m]. The Coulomb term's sign is smoothed
    over a speed [rad/s]. Returns OK.
    """
    for arm in range(3):
        k = 3 * arm
        _, columns = arm_columns(constants, arm, (q[k], q[k + 1], q[k + 2]))
        for j in range(3):
            applied[k + j] = dot(columns[j], force) / 3.0
        applied[k] += torque[arm] - shaft_friction(v[k], constants[VISCOUS + arm], constants[COULOMB + arm], speed)
    return OK


@compiled_as(PLACED(FROZEN, ROW, ROW))
def tool_motion(constants: FloatArray, q: FloatArray, v: FloatArray) -> tuple[Vector, Vector]:
    """The tool point (8) and J_v v: the mean of the three tips and of their velocities [m, m/s], base frame."""
    position, velocity = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for arm in range(3):
        k = 3 * arm
        psi, columns = arm_columns(constants, arm, (q[k], q[k + 1], q[k + 2]))
        position = combine(position, 1.0 / 3.0, psi)
        for j in range(3):
            velocity = combine(velocity, v[k + j] / 3.0, columns[j])
    return position, velocity


@compiled_as(PAIR(FROZEN, ROW, ROW))
def total_energy(constants: FloatArray, q: FloatArray, v: FloatArray) -> tuple[float, float]:
    """Kinetic and potential energy of the robot [J]."""
    kinetic, potential = 0.0, 0.0
    for arm in range(3):
        k = 3 * arm
        one = arm_energy(constants, arm, (q[k], q[k + 1], q[k + 2]), (v[k], v[k + 1], v[k + 2]))
        kinetic += one[0]
        potential += one[1]
    return kinetic, potential
