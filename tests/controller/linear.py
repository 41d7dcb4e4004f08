"""The robot linearised about rest, in the servomotor angles: open loop, and closed by a sampled law."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from controller.model.compiled import FloatArray, Vector
from controller.model.constants import (
    DISTAL_MASS,
    GRAVITY,
    PLATFORM_MASS,
    PROXIMAL,
    PROXIMAL_MOMENT,
    VISCOUS,
    DeltaModel,
)
from controller.model.dynamics import gravity_torque, joint_inertia
from controller.model.kinematics import arm_directions, control_jacobian
from controller.model.reach import tool_point_at
from controller.model.second_order import tool_drift


class Linear(NamedTuple):
    """ξ̇ = A ξ + B δu with ξ = (δy, δẏ) [rad, rad/s] about rest, and the torque that holds the robot there."""

    a: FloatArray
    """Shape (6, 6)."""
    b: FloatArray
    """Shape (6, 3)."""
    holding: FloatArray
    """τ_g, shape (3,) [N m]."""

    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of A, shape (6,) [1/s]; one with a positive real part makes the rest unstable."""
        return np.asarray(np.linalg.eigvals(self.a), dtype=np.complex128)


class RestPose(NamedTuple):
    """What a rest pose gives: unit vectors d and e of `arm_directions` and J_c, shape (3, 3) [m/rad]."""

    d: tuple[Vector, Vector, Vector]
    e: tuple[Vector, Vector, Vector]
    jacobian: FloatArray


def pose_at(model: DeltaModel, angle: FloatArray) -> RestPose:
    """The pose below the base at servomotor angles, shape (3,) [rad].

    Raises:
        PoseError: there is none.
    """
    point = tool_point_at(model, angle)
    d, e = arm_directions(model.constants, angle, (float(point[0]), float(point[1]), float(point[2])))
    jacobian = np.empty((3, 3))
    control_jacobian(model.constants, d, e, jacobian, np.empty((3, 3)))
    return RestPose(d, e, jacobian)


def tool_hessian(model: DeltaModel, angle: FloatArray) -> FloatArray:
    """∂²z/∂y², shape (3, 3, 3), component of z first [m/rad²]; `tool_drift` is its quadratic form, polarised here."""
    d, e, jacobian = pose_at(model, angle)

    def form(rate: FloatArray) -> FloatArray:
        return np.array(tool_drift(model.constants, angle, rate, d, e, jacobian))

    unit, hessian = np.eye(3), np.empty((3, 3, 3))
    for i in range(3):
        for j in range(3):
            hessian[:, i, j] = 0.25 * (form(unit[i] + unit[j]) - form(unit[i] - unit[j]))
    return hessian


def linearise(model: DeltaModel, angle: FloatArray) -> Linear:
    """Open loop about rest at servomotor angles, shape (3,) [rad], held by a constant torque.

    M_y δÿ = δu - ∂τ_g/∂y δy - D' δẏ, where D' is the viscous friction alone: Coulomb's has no derivative at rest.
    """
    c = model.constants
    _, e, jacobian = pose_at(model, angle)
    inertia, holding = np.empty((3, 3)), np.empty(3)
    joint_inertia(c, e, jacobian, inertia)
    gravity_torque(c, e, jacobian, holding)
    at_elbow = c[GRAVITY] * (c[PROXIMAL_MOMENT] + c[PROXIMAL] * c[DISTAL_MASS] / 2.0)
    at_tool = c[GRAVITY] * (c[PLATFORM_MASS] + 1.5 * c[DISTAL_MASS])
    stiffness = at_elbow * np.diag(np.sin(angle)) - at_tool * tool_hessian(model, angle)[2]
    flexibility = np.linalg.inv(inertia)
    a, b = np.zeros((6, 6)), np.zeros((6, 3))
    a[:3, 3:] = np.eye(3)
    a[3:, :3] = -flexibility @ stiffness
    a[3:, 3:] = -c[VISCOUS] * flexibility
    b[3:] = flexibility
    return Linear(a, b, holding)


def sampled_loop(plant: Linear, feedback: FloatArray, period: float, *, delayed: bool, differenced: bool) -> FloatArray:
    """One tick of the loop closed by a law that is asked once a tick and whose torque is held.

    The row is (δy, δẏ, δy of the last tick, δu that acts now), shape (12,); the loop is stable if all eigenvalues of
    the result lie within the unit circle.

    Args:
        plant: open loop.
        feedback: ∂u/∂(y, ẏ) of the law, shape (3, 6).
        period: of a tick [s].
        delayed: the torque computed from a measurement acts one tick later; else at once.
        differenced: velocities are differences of two ticks' angles; else measured.

    Returns:
        Shape (12, 12).
    """
    both = np.zeros((9, 9))
    both[:6, :6], both[:6, 6:] = plant.a, plant.b
    held = expm(period * both)
    phi, gamma = held[:6, :6], held[:6, 6:]
    law = np.zeros((3, 12))
    law[:, :6] = feedback
    if differenced:
        law[:, 3:6] = 0.0
        law[:, :3] += feedback[:, 3:] / period
        law[:, 6:9] = -feedback[:, 3:] / period
    step = np.zeros((12, 12))
    step[:6, :6] = phi
    if delayed:
        step[:6, 9:] = gamma
    else:
        step[:6] += gamma @ law
    step[6:9, :3] = np.eye(3)
    step[9:] = law
    return step
