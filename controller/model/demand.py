"""What a motion of the tool asks of the servomotors: the inverse dynamics along many references at once, compiled."""

import numpy as np

from controller.model.compiled import DEMAND, FROZEN, SCALAR, TABLE, FloatArray, Vector, compiled, compiled_as
from controller.model.constants import COULOMB, VISCOUS
from controller.model.dynamics import gravity_torque, joint_inertia, shaft_friction
from controller.model.kinematics import OK, arm_directions, control_jacobian, inverse_arm
from controller.model.second_order import tool_drift, velocity_torque
from controller.model.vectors import minus, times


@compiled
def _vector(row: FloatArray, first: int) -> Vector:
    return row[first], row[first + 1], row[first + 2]


@compiled_as(DEMAND(FROZEN, SCALAR, TABLE))
def torque_demand(
    constants: FloatArray, coulomb_speed: float, motion: FloatArray
) -> tuple[int, int, FloatArray, FloatArray]:
    """Torques that make the tool move so exactly, and those that would hold it there.

        u = M_y J_c⁻¹ (z̈ - J̇_c ẏ) + D + a + τ_g

    ``motion`` is the tool's position [m], velocity [m/s] and acceleration [m/s²], base frame, (n, 9); the sign of the
    shafts' Coulomb friction is smoothed over ``coulomb_speed`` [rad/s]. Returns the status; if it is not OK, the row
    that ended it; u and τ_g, (n, 3) each [N m], of no use from that row on.
    """
    count = motion.shape[0]
    torque, holding = np.zeros((count, 3)), np.zeros((count, 3))
    y, rate, jacobian, inverse, inertia = np.empty(3), np.empty(3), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    for i in range(count):
        z = _vector(motion[i], 0)
        for arm in range(3):
            status, y[arm] = inverse_arm(constants, arm, z)
            if status != OK:
                return status, i, torque, holding
        d, e = arm_directions(constants, y, z)
        status, _, _ = control_jacobian(constants, d, e, jacobian, inverse)
        if status != OK:
            return status, i, torque, holding
        rate[0], rate[1], rate[2] = times(inverse, _vector(motion[i], 3))
        drift = tool_drift(constants, y, rate, d, e, jacobian)
        a = velocity_torque(constants, y, rate, e, jacobian, drift)
        joint_inertia(constants, e, jacobian, inertia)
        gravity_torque(constants, e, jacobian, holding[i])
        moving = times(inertia, times(inverse, minus(_vector(motion[i], 6), drift)))
        for j in range(3):
            rubbing = shaft_friction(rate[j], constants[VISCOUS + j], constants[COULOMB + j], coulomb_speed)
            torque[i, j] = moving[j] + a[j] + rubbing + holding[i, j]
    return OK, 0, torque, holding
