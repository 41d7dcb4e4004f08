"""Second derivatives: of psi and h, what they make of the rates, and the term a of (18), compiled.

With p_i = R_i (0, cos q1, sin q1) along the proximal link, so that ∂e_i/∂q1 = -p_i:

    ∂²psi/∂q1² = -l1 p,            ∂²psi/∂q2² = -l2 d,
    ∂²psi/∂q2∂q3 = l2 cos q2 n,    ∂²psi/∂q3² = -l2 sin q2 (sin q2 d + cos q2 a),

and no others: psi is a part in q1 plus a part in (q2, q3), which is why (17) needs no mixed term.

The closed chain needs none of these in the loop. Differentiate |z - elbow_i|² = l2² twice: with ÿ = 0 the tool's
acceleration J̇_c ẏ follows from d_i·z̈ = -l1 ẏ_i² d_i·p_i - |ż - l1 e_i ẏ_i|² / l2, and *a* from the rods' ends alone.
"""

import math

from controller.model.compiled import FloatArray, Vector, compiled
from controller.model.constants import DISTAL, DISTAL_MASS, PROXIMAL
from controller.model.dynamics import moving_mass
from controller.model.kinematics import Triad, triad
from controller.model.vectors import combine, dot, times, turn


@compiled
def proximal_direction(arm: int, q1: float) -> Vector:
    """p_i, the unit vector along the proximal link, base frame; ∂e_i/∂q1 = -p_i."""
    return turn(arm, (0.0, math.cos(q1), math.sin(q1)))


@compiled
def arm_drift(constants: FloatArray, arm: int, q: Vector, v: Vector) -> Vector:
    """ψ̈_i where q̈_i = 0: the quadratic form of ∂²psi_i/∂q² in the rates v [rad/s] at angles q [rad] [m/s²]."""
    l1, l2 = constants[PROXIMAL], constants[DISTAL]
    d, a, n = triad(arm, q[1], q[2])
    s2, c2 = math.sin(q[1]), math.cos(q[1])
    square = v[2] * v[2]
    w = combine((0.0, 0.0, 0.0), -l1 * v[0] * v[0], proximal_direction(arm, q[0]))
    w = combine(w, -l2 * (v[1] * v[1] + s2 * s2 * square), d)
    return combine(combine(w, -l2 * s2 * c2 * square, a), 2.0 * l2 * c2 * v[1] * v[2], n)


@compiled
def tool_drift(
    constants: FloatArray, y: FloatArray, rate: FloatArray, d: Triad, e: Triad, jacobian: FloatArray
) -> Vector:
    """J̇_c ẏ: the tool's acceleration z̈ where ÿ = 0 [m/s²], base frame, without solving.

    For servomotor angles y [rad] and rates ẏ [rad/s], shape (3,) each; d are unit vectors along the distal links, e
    those in which the elbows move, and J_c has shape (3, 3) [m/rad].
    """
    l1, l2 = constants[PROXIMAL], constants[DISTAL]
    velocity = times(jacobian, (rate[0], rate[1], rate[2]))
    drift = (0.0, 0.0, 0.0)
    for i in range(3):
        turning = combine(velocity, -l1 * rate[i], e[i])
        away = l1 * rate[i] * rate[i] * dot(d[i], proximal_direction(i, y[i])) + dot(turning, turning) / l2
        column = (jacobian[0, i], jacobian[1, i], jacobian[2, i])
        drift = combine(drift, -away / (l1 * dot(d[i], e[i])), column)
    return drift


@compiled
def velocity_torque(
    constants: FloatArray, y: FloatArray, rate: FloatArray, e: Triad, jacobian: FloatArray, drift: Vector
) -> Vector:
    """The term a of (18), complete: Tᵀ (C + M (0, ẍ at ÿ = 0)), without the unmeasured angles [N m].

    A uniform rod of mass m whose ends accelerate with v̇ and ẇ takes the forces m (2 v̇ + ẇ) / 6 and m (v̇ + 2 ẇ) / 6
    at them. Where ÿ = 0 the ends of rod i have -l1 ẏ_i² p_i and J̇_c ẏ, and e_i·p_i = 0:

        a = J_cᵀ ((mp + Σ m2k / 3) J̇_c ẏ - (l1 / 6) Σ m2k ẏ_k² p_k) + (l1 / 6) (m2i e_i·J̇_c ẏ)_i.

    Arguments are those of `tool_drift`, and ``drift`` is what it gives [m/s²].
    """
    sixth, first = constants[PROXIMAL] / 6.0, DISTAL_MASS
    a, b, c = sixth * constants[first], sixth * constants[first + 1], sixth * constants[first + 2]
    force = combine((0.0, 0.0, 0.0), moving_mass(constants), drift)
    for k in range(3):
        force = combine(force, -sixth * constants[first + k] * rate[k] * rate[k], proximal_direction(k, y[k]))
    return (
        jacobian[0, 0] * force[0] + jacobian[1, 0] * force[1] + jacobian[2, 0] * force[2] + a * dot(e[0], drift),
        jacobian[0, 1] * force[0] + jacobian[1, 1] * force[1] + jacobian[2, 1] * force[2] + b * dot(e[1], drift),
        jacobian[0, 2] * force[0] + jacobian[1, 2] * force[1] + jacobian[2, 2] * force[2] + c * dot(e[2], drift),
    )
