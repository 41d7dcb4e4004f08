"""The dynamics projected on the servomotors, linear in the ten numbers that they depend on: the base parameters.

Whatever rod joins elbow and tool, of mass m, with its centre at a share c of its length and an inertia J about it, has
the energy ½ α |v|² + β v·w + ½ γ |w|² in the velocities v and w of its ends, with β = m c (1 - c) - J/l2²; its weight
acts with α + β at the elbow and with β + γ at the tool. So torques show of each arm, in the notation of
`controller.model.dynamics`,

    A_i = I1i + α_i l1²,     E_i = m1i c1i + l1 (α_i + β_i),     B_i = β_i,     and of all      P = mp + Σ γ_k:

    u_i = A_i ÿ_i - g E_i cos y_i + B_i l1 e_i·z̈ + Σ_k B_k (column i of J_c)·(l1 ë_k - g z3) + P (column i)·(z̈ - g z3)

with ë_k = e_k ÿ_k - ẏ_k² p_k. Mass and centre of a link, or link and rotor, cannot be told apart. A uniform rod has
α = γ = m2/3 and β = m2/6, and there is one of each robot of uniform rods that has the same ten numbers: `robot_with`.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from controller.model.compiled import FROZEN, STATUS, TABLE, FloatArray, compiled_as
from controller.model.constants import GRAVITY, PROXIMAL
from controller.model.kinematics import OK, arm_directions, control_jacobian, spheres_meet
from controller.model.second_order import proximal_direction, tool_drift
from controller.model.vectors import dot, times
from hardware.parameters import OneArm, RobotParameters

NAMES: Final = ("A1", "A2", "A3", "E1", "E2", "E3", "B1", "B2", "B3", "P")
UNITS: Final = ("kg m²",) * 3 + ("kg m",) * 3 + ("kg",) * 4
SIZE: Final = len(NAMES)
_A, _E, _B, _P = 0, 3, 6, 9


@compiled_as(STATUS(FROZEN, TABLE, TABLE))
def fill_regressor(constants: FloatArray, motion: FloatArray, columns: FloatArray) -> int:
    """What each base parameter contributes to the torques, friction aside.

    Args:
        constants: of the model; only its lengths and gravity count.
        motion: servomotor angles [rad], rates [rad/s] and their change [rad/s²], (n, 9).
        columns: out, (3 n, 10), three rows a state [N m for each unit].

    Returns:
        OK, or the number of the row that is out of reach, less one, negative.
    """
    l1, g = constants[PROXIMAL], constants[GRAVITY]
    jacobian, inverse = np.empty((3, 3)), np.empty((3, 3))
    for n in range(motion.shape[0]):
        y, rate, change = motion[n, 0:3], motion[n, 3:6], motion[n, 6:9]
        status, z = spheres_meet(constants, y[0], y[1], y[2])
        if status != OK:
            return -1 - n
        d, e = arm_directions(constants, y, z)
        status, _, _ = control_jacobian(constants, d, e, jacobian, inverse)
        if status != OK:
            return -1 - n
        drift = tool_drift(constants, y, rate, d, e, jacobian)
        moved = times(jacobian, (change[0], change[1], change[2]))
        tool = moved[0] + drift[0], moved[1] + drift[1], moved[2] + drift[2]
        for i in range(3):
            row = columns[3 * n + i]
            row[:] = 0.0
            column = jacobian[0, i], jacobian[1, i], jacobian[2, i]
            row[_A + i] = change[i]
            row[_E + i] = -g * e[i][2]
            for k in range(3):
                p = proximal_direction(k, y[k])
                square = rate[k] * rate[k]
                row[_B + k] = l1 * (change[k] * dot(column, e[k]) - square * dot(column, p)) - g * column[2]
            row[_B + i] += l1 * dot(e[i], tool)
            row[_P] = dot(column, tool) - g * column[2]
    return OK


def regressor(constants: FloatArray, angle: FloatArray, rate: FloatArray, change: FloatArray) -> FloatArray:
    """`fill_regressor` of states (n, 3) each, as (n, 3, 10).

    Raises:
        ValueError: an angle is out of reach; the message names the row.
    """
    motion = np.ascontiguousarray(np.hstack((angle, rate, change)))
    columns = np.empty((3 * len(motion), SIZE))
    status = fill_regressor(constants, motion, columns)
    if status != OK:
        raise ValueError(f"no tool point exists for the angles of row {-1 - status}: check the encoders' zeros")
    return columns.reshape(-1, 3, SIZE)


def base_of(parameters: RobotParameters) -> FloatArray:
    """The base parameters of a robot, (10,)."""
    l1 = parameters.geometry.proximal_length
    arms = [parameters.arm(number) for number in range(3)]
    return np.array([
        *(arm.hinge_inertia + arm.distal_pair_mass * l1**2 / 3.0 for arm in arms),
        *(arm.proximal_moment + arm.distal_pair_mass * l1 / 2.0 for arm in arms),
        *(arm.distal_pair_mass / 6.0 for arm in arms),
        parameters.inertia.moving_platform_mass + sum(arm.distal_pair_mass for arm in arms) / 3.0,
    ])  # fmt: skip


def robot_with(
    parameters: RobotParameters, base: FloatArray, viscous: FloatArray, coulomb: FloatArray
) -> RobotParameters:
    """The robot of uniform rods that has these base parameters (10,) and this friction of its shafts, (3,) each.

    What moves with the tool keeps the proportions that the parameters state.

    Raises:
        ValueError: no such robot exists, as a mass or an inertia would not be positive.
    """
    l1, inertia = parameters.geometry.proximal_length, parameters.inertia
    arms = []
    for i in range(3):
        a, e, b = (float(base[at + i]) for at in (_A, _E, _B))
        arms.append(
            OneArm(a - 2.0 * b * l1**2, e - 3.0 * l1 * b, 6.0 * b, max(0.0, float(viscous[i])),
                   max(0.0, float(coulomb[i])))
        )  # fmt: skip
    platform = float(base[_P]) - sum(arm.distal_pair_mass for arm in arms) / 3.0
    least = min(
        min(arm.hinge_inertia - inertia.rotor_inertia, arm.proximal_moment, arm.distal_pair_mass) for arm in arms
    )
    if min(least, platform) <= 0.0:
        raise ValueError(f"a platform of {platform:.3f} kg and arms {arms} would not all have a positive mass")
    share = platform / inertia.moving_platform_mass
    parts = ("flange_mass", "gripper_body_mass", "finger_mass")
    moving = inertia.model_copy(update={name: share * getattr(inertia, name) for name in parts})
    return parameters.model_copy(update={"inertia": moving}).with_arms(arms)
