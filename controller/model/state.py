"""The estimated state of the arm: rows of one preallocated array for compiled functions, names for people."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from controller.model.compiled import FloatArray, compiled
from controller.model.constants import DeltaModel

# First rows of the fields of `ArmState` in a float64 array of three columns, which is all that a tick works on: each
# array passed to compiled code costs a tenth of a microsecond. WARM holds 1 after a good estimate. COMPENSATED holds
# the share of the shafts' friction to be fed forward, and the speed over which its sign is smoothed [rad/s]; from
# CONSTANTS on lie the model's.
ANGLE: Final = 0
RATE: Final = 1
POSITION: Final = 2
VELOCITY: Final = 3
JACOBIAN: Final = 4
INVERSE: Final = 7
INERTIA: Final = 10
GRAVITY_TORQUE: Final = 13
FRICTION: Final = 14
ASKED: Final = 15
TORQUE: Final = 16
QUALITY: Final = 17
WARM: Final = 18
COMPENSATED: Final = 19
CONSTANTS: Final = 20
ROWS: Final = 27


REFERENCE_SIZE: Final = 16
"""Numbers in a reference: a contiguous float64 array that begins with r 0:3 [m], ṙ 3:6 [m/s], r̈ 6:9 [m/s²],
k_p 9:12 [1/s²], k_v 12:15 [1/s], all in the base frame, and k* at 15 [1/kg]. `pack_reference` makes one; longer rows
serve too, the law reads no further."""


@dataclass(frozen=True, slots=True)
class ArmState:
    """What the last tick found: views of one preallocated buffer, rewritten every tick.

    Read them, copy what must last, and never write. Frame base. After an estimate that was not OK only `angle` and
    `rate` are of that tick.
    """

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

    @property
    def task_inertia(self) -> FloatArray:
        """Λ = J_c⁻ᵀ M_y J_c⁻¹, shape (3, 3): the inertia felt at the tool [kg]."""
        return self.jacobian_inverse.T @ self.inertia @ self.jacobian_inverse


@compiled
def constants_of(state: FloatArray) -> FloatArray:
    """The model's constants in a state: shape (21,)."""
    return state[CONSTANTS:ROWS].reshape(21)


def blank_state() -> FloatArray:
    """A state that nothing is known of, shape (27, 3)."""
    return np.zeros((ROWS, 3))


def load_model(state: FloatArray, model: DeltaModel) -> None:
    """Write a model's constants into a state."""
    state[CONSTANTS:ROWS].reshape(21)[:] = model.constants


def views(buffer: FloatArray) -> ArmState:
    """Name the rows of a state, shape (27, 3)."""
    return ArmState(
        buffer[ANGLE], buffer[RATE], buffer[POSITION], buffer[VELOCITY], buffer[JACOBIAN:INVERSE],
        buffer[INVERSE:INERTIA], buffer[INERTIA:GRAVITY_TORQUE], buffer[GRAVITY_TORQUE], buffer[FRICTION],
        buffer[ASKED], buffer[TORQUE], buffer[QUALITY],
    )  # fmt: skip
