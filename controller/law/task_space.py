"""The laws. The chess controller is approximate feedback linearisation in task space, (23), with gravity (15).

    u = M_y J_c⁻¹ v + D + τ_g,      v = k_p (r - z) + k_v (ṙ - ż) + r̈ + k* (f_right - f_left) e_1

M_y is the projected inertia Tᵀ M T in place of (19), which the paper misprints; D is the friction of the shafts.
The tool then follows ë + k_v ė + k_p e ≈ 0, e = z - r, in each direction by itself.

Sign of the tactile term: the right finger is at +z1 and its pad looks to -z1. An object pressing on the right pad
pushes the tool towards +z1, and f_right > 0 makes the robot accelerate towards +z1: it yields. (The paper subtracts
k* times a difference whose order it does not print; it is f_left - f_right.) With effective mass m a push F along z1
then accelerates the tool by (1/m + k*) F: the admittance grows by 1 + k* m.

Two compiled calls make a tick, `TaskSpaceController.update` and `.torque`; protection reads `.state` in between.

The exact laws are in `controller.law.exact_linearisation`; the server does not call them.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from controller.law.exact_linearisation import exact_joint_law, exact_task_law, neglected_acceleration
from controller.law.settings import LawSettings
from controller.model.compiled import (
    PAIR,
    ROW,
    STATUS,
    TABLE,
    VECTOR,
    FloatArray,
    Vector,
    compiled_as,
    direct,
)
from controller.model.constants import COULOMB, VISCOUS, DeltaModel
from controller.model.dynamics import gravity_torque, joint_inertia, shaft_friction
from controller.model.kinematics import (
    OK,
    Status,
    control_jacobian,
    elbows,
    spheres_meet,
    tool_point_near,
)
from controller.model.state import (
    ANGLE,
    ASKED,
    COMPENSATED,
    FRICTION,
    GRAVITY_TORQUE,
    INERTIA,
    INVERSE,
    JACOBIAN,
    POSITION,
    QUALITY,
    RATE,
    REFERENCE_SIZE,
    TORQUE,
    VELOCITY,
    WARM,
    blank_state,
    constants_of,
    load_model,
    views,
)
from hardware.interfaces import Triple


@compiled_as(STATUS(TABLE, VECTOR, VECTOR))
def estimate(state: FloatArray, angle: Vector, velocity: Vector) -> int:
    """Where the arm is, how it moves and what it weighs, from the servomotors' angles and velocities.

    Args:
        state: shape (27, 3), in: the model, the friction to feed forward, the last z as warm start; out: the fields
            of `ArmState`.
        angle: y [rad].
        velocity: ẏ [rad/s].

    Returns:
        Status. After anything but OK the next call starts cold, in closed form.
    """
    constants, y = constants_of(state), state[ANGLE]
    for i in range(3):
        state[ANGLE, i] = angle[i]
        state[RATE, i] = velocity[i]
    near = state[POSITION, 0], state[POSITION, 1], state[POSITION, 2]
    if state[WARM, 0] == 0.0:
        status, near = spheres_meet(constants, angle[0], angle[1], angle[2])
        if status != OK:
            return status
    state[WARM, 0] = 0.0
    centres, e = elbows(constants, y)
    status, steps, z, d = tool_point_near(constants, centres, near)
    if status != OK:
        return status
    jacobian, inverse = state[JACOBIAN : JACOBIAN + 3], state[INVERSE : INVERSE + 3]
    status, volume, transmission = control_jacobian(constants, d, e, jacobian, inverse)
    if status != OK:
        return status
    share, speed = state[COMPENSATED, 0], state[COMPENSATED, 1]
    for i in range(3):
        state[POSITION, i] = z[i]
        state[VELOCITY, i] = jacobian[i, 0] * velocity[0] + jacobian[i, 1] * velocity[1] + jacobian[i, 2] * velocity[2]
        rubbing = shaft_friction(velocity[i], constants[VISCOUS + i], constants[COULOMB + i], speed)
        state[FRICTION, i] = share * rubbing
    joint_inertia(constants, e, jacobian, state[INERTIA : INERTIA + 3])
    gravity_torque(constants, e, jacobian, state[GRAVITY_TORQUE])
    state[QUALITY, 0], state[QUALITY, 1], state[QUALITY, 2] = volume, transmission, float(steps)
    state[WARM, 0] = 1.0
    return OK


@compiled_as(VECTOR(TABLE, ROW, PAIR))
def task_space_law(state: FloatArray, reference: FloatArray, tactile: tuple[float, float]) -> Vector:
    """(23) on an estimated state.

    Args:
        state: shape (27, 3), as `estimate` left it; the fields ``asked`` and ``torque`` are written.
        reference: shape (16,) or longer, see `REFERENCE_SIZE`.
        tactile: forces on the right (+z1) and left (-z1) pad, pressing positive [N].

    Returns:
        u [N m], not limited.

    Raises:
        ValueError: the reference is too short.
    """
    if reference.size < REFERENCE_SIZE:
        raise ValueError("a reference has 16 numbers, see REFERENCE_SIZE")
    for i in range(3):
        position_error = reference[i] - state[POSITION, i]
        velocity_error = reference[3 + i] - state[VELOCITY, i]
        state[ASKED, i] = reference[9 + i] * position_error + reference[12 + i] * velocity_error + reference[6 + i]
    state[ASKED, 0] += reference[15] * (tactile[0] - tactile[1])
    for i in range(3):
        state[TORQUE, i] = state[FRICTION, i] + state[GRAVITY_TORQUE, i]
    for j in range(3):
        w = state[INVERSE + j]
        rate = w[0] * state[ASKED, 0] + w[1] * state[ASKED, 1] + w[2] * state[ASKED, 2]
        for i in range(3):
            state[TORQUE, i] += state[INERTIA + i, j] * rate
    return state[TORQUE, 0], state[TORQUE, 1], state[TORQUE, 2]


def pack_reference(
    position: Triple,
    *,
    velocity: Triple = (0.0, 0.0, 0.0),
    acceleration: Triple = (0.0, 0.0, 0.0),
    stiffness: Triple = (0.0, 0.0, 0.0),
    damping: Triple = (0.0, 0.0, 0.0),
    tactile_gain: float = 0.0,
) -> FloatArray:
    """A reference for `TaskSpaceController.torque`, shape (16,).

    Args:
        position: r [m].
        velocity: ṙ [m/s].
        acceleration: r̈ [m/s²].
        stiffness: k_p of each direction [1/s²].
        damping: k_v of each direction [1/s].
        tactile_gain: k* [1/kg].
    """
    return np.array([*position, *velocity, *acceleration, *stiffness, *damping, tactile_gain], dtype=np.float64)


class TaskSpaceController:
    """Estimator and law of one robot, everything preallocated and compiled before the first tick.

    Attributes:
        state: results of the last tick, for protection and telemetry.
    """

    def __init__(self, model: DeltaModel, settings: LawSettings | None = None) -> None:
        self._buffer = blank_state()
        self._settings = settings or LawSettings()
        self.state = views(self._buffer)
        self.use(model)

    def use(self, model: DeltaModel) -> None:
        """Go on with another model, say with a payload; the estimate stays warm if the lengths are the same."""
        self._model = model
        load_model(self._buffer, model)
        share = 1.0 if self._settings.friction_compensation else 0.0
        self._buffer[COMPENSATED] = share, self._settings.coulomb_speed, 0.0

    @property
    def memory(self) -> FloatArray:
        """All that the last tick left, shape (27, 3), as compiled functions take it; see `controller.model.state`."""
        return self._buffer

    @property
    def model(self) -> DeltaModel:
        """The model in use."""
        return self._model

    def reset(self) -> None:
        """Forget the warm start: the next `update` starts from the closed form."""
        self._buffer[WARM, 0] = 0.0

    def update(self, angle: Triple, velocity: Triple) -> Status:
        """Estimate the state from the servomotors' angles [rad] and velocities [rad/s].

        Returns:
            OK; anything else means that `state` is stale and that no torque may be computed from it. The next call
            then starts cold.
        """
        return _STATUS[_estimate(self._buffer, angle, velocity)]

    def torque(self, reference: FloatArray, tactile: tuple[float, float] = (0.0, 0.0)) -> Triple:
        """Torques of (23) for the state of the last `update`, which must have been OK.

        Args:
            reference: float64, contiguous, shape (16,) or longer, see `REFERENCE_SIZE`.
            tactile: forces on the right (+z1) and left (-z1) pad [N].

        Returns:
            Servomotor torques, not limited [N m].
        """
        return _task_space_law(self._buffer, reference, tactile)

    def exact_joint_torque(self, reference: FloatArray) -> Triple:
        """Torques of (20), exact in joint space, for the state of the last `update`, not limited [N m].

        Args:
            reference: as for `torque`, but of the servomotors [rad, rad/s, rad/s²].
        """
        return exact_joint_law(self._buffer, reference)

    def exact_task_torque(self, reference: FloatArray, tactile: tuple[float, float] = (0.0, 0.0)) -> Triple:
        """Torques of (23) with the velocity terms it leaves out; arguments and result as for `torque`."""
        return exact_task_law(self._buffer, reference, tactile)

    def residual(self) -> Triple:
        """What (23) neglects at the state of the last `update`, as a tool acceleration [m/s²]."""
        return neglected_acceleration(self._buffer)

    def holding_torque(self) -> Triple:
        """Gravity compensation alone, for the state of the last `update`: the arm floats [N m]."""
        g1, g2, g3 = self.state.gravity.tolist()
        return g1, g2, g3


_STATUS: Final = tuple(Status)
_estimate: Final = direct(estimate)
_task_space_law: Final = direct(task_space_law)
