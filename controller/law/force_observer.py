"""The force on the tool, told from torques and motion alone: a momentum observer.

    M_y ÿ = u - a - D - τ_g + τ_ext

Between the ticks k-2 and k the servomotors' momentum changes by M_y (ẏ_k - ẏ_k-1), as a drive's velocity is the mean
over its tick; what u, a, D and τ_g do not explain came from outside. A first-order filter makes it a usable number, and
J_c⁻ᵀ takes it from the shafts to the tool. Everything is taken at tick k-1, the middle, so that no error is of first
order in the tick. It is the discrete form of de Luca's observer, without the derivative of M_y.

It knows nothing of what the reference asks: protection built on it does not depend on the law.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from controller.model.compiled import ROW, STATUS, TABLE, VECTOR, FloatArray, Vector, compiled_as, direct
from controller.model.constants import COULOMB, VISCOUS
from controller.model.dynamics import shaft_friction
from controller.model.kinematics import arm_directions
from controller.model.second_order import tool_drift, velocity_torque
from controller.model.state import (
    ANGLE,
    GRAVITY_TORQUE,
    INERTIA,
    INVERSE,
    JACOBIAN,
    POSITION,
    RATE,
    WARM,
    constants_of,
)
from hardware.interfaces import Triple

BANDWIDTH: Final = 200.0
"""Of the filter [rad/s]: half of a step of force is told after 3.5 ms; noise of the encoders stays below 0.1 N."""
_FORCE, _BEFORE, _RESIDUAL, _KNOWN, _SHARE, _PER_TICK, _SMOOTH = 0, 3, 6, 9, 10, 11, 12
OBSERVER_SIZE: Final = 13
_COULOMB_SPEED: Final = 0.05
"""As in the law [rad/s]."""


@compiled_as(STATUS(ROW, TABLE, VECTOR, VECTOR))
def observe(memory: FloatArray, state: FloatArray, velocity: Vector, acting: Vector) -> int:
    """One tick.

    Args:
        memory: shape (13,), in and out; the first three are the force on the tool, base frame [N].
        state: shape (27, 3), as `controller.law.task_space.estimate` left it at the tick before; not changed.
        velocity: ẏ of this tick [rad/s].
        acting: torque of the servomotors during this tick [N m]; not finite where it is not known (brakes).

    Returns:
        1 where the force is known, 0 where it was set to zero: after the start, on the brakes, or without a pose.
    """
    mean = (
        0.5 * (acting[0] + memory[_BEFORE]),
        0.5 * (acting[1] + memory[_BEFORE + 1]),
        0.5 * (acting[2] + memory[_BEFORE + 2]),
    )
    for i in range(3):
        memory[_BEFORE + i] = acting[i]
    if state[WARM, 0] == 0.0 or not math.isfinite(mean[0] + mean[1] + mean[2]):
        for i in range(3):
            memory[_RESIDUAL + i] = 0.0
            memory[_FORCE + i] = 0.0
        memory[_KNOWN] = 0.0
        return 0
    constants = constants_of(state)
    before, jacobian, inverse, inertia = (
        state[RATE],
        state[JACOBIAN : JACOBIAN + 3],
        state[INVERSE : INVERSE + 3],
        state[INERTIA : INERTIA + 3],
    )
    d, e = arm_directions(constants, state[ANGLE], (state[POSITION, 0], state[POSITION, 1], state[POSITION, 2]))
    drift = tool_drift(constants, state[ANGLE], before, d, e, jacobian)
    inward = velocity_torque(constants, state[ANGLE], before, e, jacobian, drift)
    change = velocity[0] - before[0], velocity[1] - before[1], velocity[2] - before[2]
    for i in range(3):
        gained = inertia[i, 0] * change[0] + inertia[i, 1] * change[1] + inertia[i, 2] * change[2]
        friction = shaft_friction(
            0.5 * (velocity[i] + before[i]), constants[VISCOUS + i], constants[COULOMB + i], memory[_SMOOTH]
        )
        outside = gained * memory[_PER_TICK] - (mean[i] - inward[i] - friction - state[GRAVITY_TORQUE, i])
        memory[_RESIDUAL + i] += memory[_SHARE] * (outside - memory[_RESIDUAL + i])
    for i in range(3):
        memory[_FORCE + i] = (
            inverse[0, i] * memory[_RESIDUAL]
            + inverse[1, i] * memory[_RESIDUAL + 1]
            + inverse[2, i] * memory[_RESIDUAL + 2]
        )
    memory[_KNOWN] = 1.0
    return 1


_observe: Final = direct(observe)
_UNKNOWN: Final = (math.nan, math.nan, math.nan)


class ForceObserver:
    """The momentum observer of one arm.

    Args:
        period: of a tick [s].
        bandwidth: of the filter [rad/s].
        memory: of `observe`, shape (13,); by default an array of its own.
    """

    def __init__(self, period: float, bandwidth: float = BANDWIDTH, memory: FloatArray | None = None) -> None:
        self._memory = np.zeros(OBSERVER_SIZE) if memory is None else memory
        self._memory[_SHARE] = 1.0 - math.exp(-bandwidth * period)
        self._memory[_PER_TICK] = 1.0 / period
        self._memory[_SMOOTH] = _COULOMB_SPEED
        self._memory[_BEFORE : _BEFORE + 3] = math.nan

    def update(self, state: FloatArray, velocity: Triple, acting: Triple | None) -> Triple:
        """Take a tick in, before the law's estimate of it.

        Args:
            state: of the law, still of the tick before.
            velocity: of the servomotors in this tick [rad/s].
            acting: torque during this tick [N m], ``None`` where it is not known: on the brakes.

        Returns:
            Force on the tool, base frame [N]; zero where it is not known.
        """
        _observe(self._memory, state, velocity, _UNKNOWN if acting is None else acting)
        return self.force

    @property
    def force(self) -> Triple:
        """On the tool at the last tick, base frame [N]; zero where it is not known."""
        x, y, z = self._memory[:3].tolist()
        return x, y, z

    @property
    def known(self) -> bool:
        """Whether the force is known; in the first ticks after the brakes it is not."""
        return bool(self._memory[_KNOWN])
