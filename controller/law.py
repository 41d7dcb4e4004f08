"""The chess controller: approximate feedback linearisation in task space, (23), with gravity compensation (15).

    u = M_y J_c⁻¹ v + D + τ_g,      v = k_p (r - z) + k_v (ṙ - ż) + r̈ + k* (f_right - f_left) e_1

M_y is the projected inertia Tᵀ M T in place of (19), which the paper misprints; D is the friction of the shafts.
The tool then follows ë + k_v ė + k_p e ≈ 0, e = z - r, in each direction by itself.

Sign of the tactile term: the right finger is at +z1 and its pad looks to -z1. An object pressing on the right pad
pushes the tool towards +z1, and f_right > 0 makes the robot accelerate towards +z1: it yields. (The paper subtracts
k* times a difference whose order it does not print; it is f_left - f_right.) With effective mass m a push F along z1
then accelerates the tool by (1/m + k*) F: the admittance grows by 1 + k* m.

Two compiled calls make a tick, `TaskSpaceController.update` and `.torque`; protection reads `.state` in between.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from pydantic import BaseModel, ConfigDict, PositiveFloat

from controller.model.compiled import FROZEN, PAIR, ROW, STATUS, TABLE, VECTOR, FloatArray, Vector, compiled_as
from controller.model.constants import COULOMB, VISCOUS, DeltaModel
from controller.model.dynamics import gravity_torque, joint_inertia, shaft_friction, task_inertia
from controller.model.kinematics import (
    OK,
    Status,
    arm_directions,
    arm_tool_point,
    control_jacobian,
    forward_kinematics,
    forward_kinematics_closed,
)
from hardware.interfaces import Triple

# rows of the state, a float64 array of three columns
_X, _ANGLE, _RATE, _POSITION, _VELOCITY = 0, 2, 3, 4, 5
_JACOBIAN, _INVERSE, _INERTIA, _TASK_INERTIA = 6, 9, 12, 15
_GRAVITY, _FRICTION, _ASKED, _TORQUE, _QUALITY, _WARM = 18, 19, 20, 21, 22, 23
_ROWS = 24

REFERENCE_SIZE: Final = 16
"""Numbers in a reference: a contiguous float64 array that begins with r 0:3 [m], ṙ 3:6 [m/s], r̈ 6:9 [m/s²],
k_p 9:12 [1/s²], k_v 12:15 [1/s], all in the base frame, and k* at 15 [1/kg]. `pack_reference` makes one; longer rows
serve too, the law reads no further."""


class LawSettings(BaseModel):
    """Settings of the law."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    friction_compensation: bool = True
    """Whether the shafts' viscous and Coulomb friction is fed forward from the measured velocity."""
    coulomb_speed: PositiveFloat = 0.05
    """The Coulomb term's sign is tanh(q̇ / coulomb_speed): no chatter about standstill [rad/s]."""


@dataclass(frozen=True, slots=True)
class ArmState:
    """What the last `update` and `torque` found: views of one preallocated buffer, rewritten every tick.

    Read them, copy what must last, and never write. Frame base. After an `update` that was not OK only `angle` and
    `rate` are of that tick.
    """

    unmeasured: FloatArray
    """x, shape (3, 2): q_i2 and q_i3 [rad]."""
    angle: FloatArray
    """y, shape (3,) [rad]."""
    rate: FloatArray
    """ẏ, shape (3,) [rad/s]."""
    position: FloatArray
    """z, shape (3,): the tool point [m]."""
    velocity: FloatArray
    """ż, shape (3,) [m/s]."""
    jacobian: FloatArray
    """J_c = ∂z/∂y, shape (3, 3) [m/rad]."""
    jacobian_inverse: FloatArray
    """J_c⁻¹, shape (3, 3) [rad/m]."""
    inertia: FloatArray
    """M_y, shape (3, 3) [kg m²]."""
    task_inertia: FloatArray
    """J_c⁻ᵀ M_y J_c⁻¹, shape (3, 3) [kg]."""
    gravity: FloatArray
    """τ_g, shape (3,): the torques that hold the arm [N m]."""
    friction: FloatArray
    """D, shape (3,): friction as compensated; zero when switched off [N m]."""
    asked: FloatArray
    """v, shape (3,): tool acceleration that the law last asked for [m/s²]."""
    torque: FloatArray
    """u, shape (3,): torques that the law last gave, not limited [N m]."""
    quality: FloatArray
    """Shape (3,): volume of the distal directions and least transmission (both 0 at a singularity); Newton steps."""


def _views(buffer: FloatArray) -> ArmState:
    """Name the rows of the buffer."""
    flat = buffer.reshape(-1)

    def square(row: int) -> FloatArray:
        return buffer[row : row + 3]

    return ArmState(
        unmeasured=flat[3 * _X : 3 * _X + 6].reshape(3, 2),
        angle=buffer[_ANGLE],
        rate=buffer[_RATE],
        position=buffer[_POSITION],
        velocity=buffer[_VELOCITY],
        jacobian=square(_JACOBIAN),
        jacobian_inverse=square(_INVERSE),
        inertia=square(_INERTIA),
        task_inertia=square(_TASK_INERTIA),
        gravity=buffer[_GRAVITY],
        friction=buffer[_FRICTION],
        asked=buffer[_ASKED],
        torque=buffer[_TORQUE],
        quality=buffer[_QUALITY],
    )


@compiled_as(STATUS(FROZEN, ROW, TABLE, VECTOR, VECTOR))
def estimate(constants: FloatArray, friction: FloatArray, state: FloatArray, angle: Vector, velocity: Vector) -> int:
    """Where the arm is, how it moves and what it weighs, from the servomotors' angles and velocities.

    Args:
        constants: of the model.
        friction: shape (3,): viscous [N m s/rad], Coulomb [N m], speed over which its sign is smoothed [rad/s].
        state: shape (24, 3), in: the last x as warm start; out: the fields of `ArmState`.
        angle: y [rad].
        velocity: ẏ [rad/s].

    Returns:
        Status. After anything but OK the next call starts cold, in closed form.
    """
    for i in range(3):
        state[_ANGLE, i] = angle[i]
        state[_RATE, i] = velocity[i]
    y, x = state[_ANGLE], state[_X : _X + 2].reshape(6)
    if state[_WARM, 0] == 0.0:
        status = forward_kinematics_closed(constants, y, x)
        if status != OK:
            return status
    state[_WARM, 0] = 0.0
    status, steps = forward_kinematics(constants, y, x)
    if status != OK:
        return status
    z = arm_tool_point(constants, 0, y[0], x[0], x[1])
    d, e = arm_directions(constants, y, z)
    jacobian, inverse = state[_JACOBIAN : _JACOBIAN + 3], state[_INVERSE : _INVERSE + 3]
    status, volume, transmission = control_jacobian(constants, d, e, jacobian, inverse)
    if status != OK:
        return status
    for i in range(3):
        state[_POSITION, i] = z[i]
        state[_VELOCITY, i] = jacobian[i, 0] * velocity[0] + jacobian[i, 1] * velocity[1] + jacobian[i, 2] * velocity[2]
        state[_FRICTION, i] = shaft_friction(velocity[i], friction[0], friction[1], friction[2])
    joint_inertia(constants, e, jacobian, state[_INERTIA : _INERTIA + 3])
    task_inertia(constants, e, inverse, state[_TASK_INERTIA : _TASK_INERTIA + 3])
    gravity_torque(constants, e, jacobian, state[_GRAVITY])
    state[_QUALITY, 0], state[_QUALITY, 1], state[_QUALITY, 2] = volume, transmission, float(steps)
    state[_WARM, 0] = 1.0
    return OK


@compiled_as(VECTOR(TABLE, ROW, PAIR))
def task_space_law(state: FloatArray, reference: FloatArray, tactile: tuple[float, float]) -> Vector:
    """(23) on an estimated state.

    Args:
        state: shape (24, 3), as `estimate` left it; the fields ``asked`` and ``torque`` are written.
        reference: shape (16,) or longer, see `REFERENCE_SIZE`.
        tactile: forces on the right (+z1) and left (-z1) pad, pressing positive [N].

    Returns:
        u [N m], not limited.
    """
    for i in range(3):
        position_error = reference[i] - state[_POSITION, i]
        velocity_error = reference[3 + i] - state[_VELOCITY, i]
        state[_ASKED, i] = reference[9 + i] * position_error + reference[12 + i] * velocity_error + reference[6 + i]
    state[_ASKED, 0] += reference[15] * (tactile[0] - tactile[1])
    for i in range(3):
        state[_TORQUE, i] = state[_FRICTION, i] + state[_GRAVITY, i]
    for j in range(3):
        w = state[_INVERSE + j]
        rate = w[0] * state[_ASKED, 0] + w[1] * state[_ASKED, 1] + w[2] * state[_ASKED, 2]
        for i in range(3):
            state[_TORQUE, i] += state[_INERTIA + i, j] * rate
    return state[_TORQUE, 0], state[_TORQUE, 1], state[_TORQUE, 2]


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
        self._buffer = np.zeros((_ROWS, 3))
        self._settings = settings or LawSettings()
        self._friction = np.zeros(3)
        self.state = _views(self._buffer)
        self.use(model)

    def use(self, model: DeltaModel) -> None:
        """Go on with another model, say with a payload; the estimate stays warm if the lengths are the same."""
        self._model = model
        self._constants = model.constants
        factor = 1.0 if self._settings.friction_compensation else 0.0
        viscous, coulomb = factor * model.constants[VISCOUS], factor * model.constants[COULOMB]
        self._friction[:] = viscous, coulomb, self._settings.coulomb_speed

    @property
    def model(self) -> DeltaModel:
        """The model in use."""
        return self._model

    def reset(self) -> None:
        """Forget the warm start: the next `update` starts from the closed form."""
        self._buffer[_WARM, 0] = 0.0

    def update(self, angle: Triple, velocity: Triple) -> Status:
        """Estimate the state from the servomotors' angles [rad] and velocities [rad/s].

        Returns:
            OK; anything else means that `state` is stale and that no torque may be computed from it. The next call
            then starts cold.
        """
        return _STATUS[estimate(self._constants, self._friction, self._buffer, angle, velocity)]

    def torque(self, reference: FloatArray, tactile: tuple[float, float] = (0.0, 0.0)) -> Triple:
        """Torques of (23) for the state of the last `update`, which must have been OK.

        Args:
            reference: float64, contiguous, shape (16,) or longer, see `REFERENCE_SIZE`.
            tactile: forces on the right (+z1) and left (-z1) pad [N].

        Returns:
            Servomotor torques, not limited [N m].
        """
        return task_space_law(self._buffer, reference, tactile)

    def holding_torque(self) -> Triple:
        """Gravity compensation alone, for the state of the last `update`: the arm floats [N m]."""
        g1, g2, g3 = self.state.gravity.tolist()
        return g1, g2, g3


_STATUS: Final = tuple(Status)
