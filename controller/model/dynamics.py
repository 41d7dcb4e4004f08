"""Dynamics of one arm in closed form, and the whole robot projected on the servomotor angles.

An arm with coordinates (q1, q2, q3) carries a third of the platform, mt = mp/3, at its tip. Its distal pair is lumped
into one uniform rod of the pair's mass: both rods move alike but for a constant offset, so nothing is lost. With d
along the rod and e the elbow's direction of motion

    T = ½ (I1 + (m2 + mt) l1²) q̇1² + ½ b |ḋ|² + c q̇1 e·ḋ,    b = (m2/3 + mt) l2²,   c = (m2/2 + mt) l1 l2,

where |ḋ|² = q̇2² + sin²q2 q̇3². The arms meet in (2) of the paper, which `controller.offline.constrained` writes out.

Projected with T = [I; ∂g/∂y] the same energy needs none of the unmeasured angles: the ends of rod i move with
l1 e_i ẏ_i and ż, and a uniform rod of mass m with ends at v and w has the energy (m/6) (v² + v·w + w²).
"""

import math

from controller.model.compiled import FloatArray, Vector, compiled
from controller.model.constants import (
    DISTAL,
    DISTAL_MASS,
    GRAVITY,
    HINGE_INERTIA,
    PLATFORM_MASS,
    PROXIMAL,
    PROXIMAL_MOMENT,
)
from controller.model.kinematics import Triad
from controller.model.vectors import dot


@compiled
def arm_inertia(
    constants: FloatArray, arm: int, q1: float, q2: float, q3: float
) -> tuple[float, float, float, float, float]:
    """M of one arm, 0 to 2: the entries 11, 12, 13, 22, 33 (23 is zero) [kg m²]."""
    l1, l2, m2, mt = (
        constants[PROXIMAL],
        constants[DISTAL],
        constants[DISTAL_MASS + arm],
        constants[PLATFORM_MASS] / 3.0,
    )
    b, c = (m2 / 3.0 + mt) * l2 * l2, (m2 / 2.0 + mt) * l1 * l2
    c1, s1, c2, s2, c3, s3 = math.cos(q1), math.sin(q1), math.cos(q2), math.sin(q2), math.cos(q3), math.sin(q3)
    hinge = constants[HINGE_INERTIA + arm] + (m2 + mt) * l1 * l1
    return hinge, c * (s1 * s2 + c1 * c2 * c3), -c * c1 * s2 * s3, b, b * s2 * s2


@compiled
def arm_coriolis(constants: FloatArray, arm: int, q: Vector, v: Vector) -> Vector:
    """C of one arm: Coriolis and centripetal torque for angles q [rad] and rates v [rad/s] [N m]."""
    l1, l2, m2, mt = (
        constants[PROXIMAL],
        constants[DISTAL],
        constants[DISTAL_MASS + arm],
        constants[PLATFORM_MASS] / 3.0,
    )
    b, c = (m2 / 3.0 + mt) * l2 * l2, (m2 / 2.0 + mt) * l1 * l2
    c1, s1, c2, s2 = math.cos(q[0]), math.sin(q[0]), math.cos(q[1]), math.sin(q[1])
    c3, s3 = math.cos(q[2]), math.sin(q[2])
    # d̈ without its part in q̈ is along·d + across·a + around·n
    along = -(v[1] * v[1] + s2 * s2 * v[2] * v[2])
    across, around = -s2 * c2 * v[2] * v[2], 2.0 * c2 * v[1] * v[2]
    ed, ea, en = c1 * s2 * c3 - s1 * c2, s1 * s2 + c1 * c2 * c3, -c1 * s3
    # ė = -p q̇1 with p = (0, cos q1, sin q1)
    pa, pn = s1 * c2 * c3 - c1 * s2, -s1 * s3
    square = v[0] * v[0]
    return (
        c * (along * ed + across * ea + around * en),
        b * across - c * square * pa,
        s2 * (b * around - c * square * pn),
    )


@compiled
def arm_gravity(constants: FloatArray, arm: int, q1: float, q2: float, q3: float) -> Vector:
    """G of one arm: gradient of the potential energy, gravity along +z3 [N m]."""
    l1, l2, m2, mt = (
        constants[PROXIMAL],
        constants[DISTAL],
        constants[DISTAL_MASS + arm],
        constants[PLATFORM_MASS] / 3.0,
    )
    upper = -constants[GRAVITY] * (constants[PROXIMAL_MOMENT + arm] + l1 * (m2 + mt))
    lower = -constants[GRAVITY] * l2 * (m2 / 2.0 + mt)
    return upper * math.cos(q1), lower * math.cos(q2) * math.cos(q3), -lower * math.sin(q2) * math.sin(q3)


@compiled
def arm_energy(constants: FloatArray, arm: int, q: Vector, v: Vector) -> tuple[float, float]:
    """Kinetic and potential energy of one arm with its third of the platform [J]; the latter but for a constant."""
    l1, l2, m2, mt = (
        constants[PROXIMAL],
        constants[DISTAL],
        constants[DISTAL_MASS + arm],
        constants[PLATFORM_MASS] / 3.0,
    )
    m11, m12, m13, m22, m33 = arm_inertia(constants, arm, q[0], q[1], q[2])
    kinetic = 0.5 * (m11 * v[0] * v[0] + m22 * v[1] * v[1] + m33 * v[2] * v[2]) + v[0] * (m12 * v[1] + m13 * v[2])
    upper = (constants[PROXIMAL_MOMENT + arm] + l1 * (m2 + mt)) * math.sin(q[0])
    lower = l2 * (m2 / 2.0 + mt) * math.sin(q[1]) * math.cos(q[2])
    return kinetic, -constants[GRAVITY] * (upper + lower)


@compiled
def shaft_friction(velocity: float, viscous: float, coulomb: float, speed: float) -> float:
    """D of one servomotor: viscous and Coulomb friction, the sign smoothed over ``speed`` [rad/s] [N m]."""
    return viscous * velocity + coulomb * math.tanh(velocity / speed)


@compiled
def moving_mass(constants: FloatArray) -> float:
    """What the tool feels of platform and rods: mp + (m21 + m22 + m23) / 3 [kg]."""
    rods: float = constants[DISTAL_MASS] + constants[DISTAL_MASS + 1] + constants[DISTAL_MASS + 2]
    return float(constants[PLATFORM_MASS] + rods / 3.0)


@compiled
def joint_inertia(constants: FloatArray, e: Triad, jacobian: FloatArray, inertia: FloatArray) -> None:
    """M_y = Tᵀ M T, the inertia that the servomotors feel; stands for (19), which is misprinted.

    M_y = (mp + Σ m2k / 3) J_cᵀ J_c + diag (I1k + m2k l1²/3) + (l1 / 6) (S + Sᵀ), with rows S_i = m2i e_iᵀ J_c, where e
    are the unit vectors in which the elbows move and J_c has shape (3, 3) [m/rad]. ``inertia``, shape (3, 3), is out
    [kg m²].
    """
    l1, moving = constants[PROXIMAL], moving_mass(constants)
    sixth = l1 / 6.0
    for i in range(3):
        mi = constants[DISTAL_MASS + i]
        column_i = (jacobian[0, i], jacobian[1, i], jacobian[2, i])
        for j in range(i, 3):
            column_j = (jacobian[0, j], jacobian[1, j], jacobian[2, j])
            coupling = mi * dot(e[i], column_j) + constants[DISTAL_MASS + j] * dot(e[j], column_i)
            value = moving * dot(column_i, column_j) + sixth * coupling
            if i == j:
                value += constants[HINGE_INERTIA + i] + mi * l1 * l1 / 3.0
            inertia[i, j] = value
            inertia[j, i] = value


@compiled
def gravity_torque(constants: FloatArray, e: Triad, jacobian: FloatArray, torque: FloatArray) -> None:
    """τ_g = Tᵀ G, what holds the robot against gravity; equals τ_u of (15) without solving.

    Half of the rods' weight acts at the elbows, the other half with the platform's at the tool. The elbows move along
    unit vectors e, whose z3 is cos y_i; J_c has shape (3, 3) [m/rad], ``torque``, shape (3,), is out [N m].
    """
    g, l1 = constants[GRAVITY], constants[PROXIMAL]
    rods = constants[DISTAL_MASS] + constants[DISTAL_MASS + 1] + constants[DISTAL_MASS + 2]
    at_tool = g * (constants[PLATFORM_MASS] + 0.5 * rods)
    for i in range(3):
        at_elbow = g * (constants[PROXIMAL_MOMENT + i] + 0.5 * l1 * constants[DISTAL_MASS + i])
        torque[i] = -at_elbow * e[i][2] - at_tool * jacobian[2, i]
