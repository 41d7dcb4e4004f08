"""A tick of the plant in one compiled call: MuJoCo's step, then what encoders, speed watch and fingers make of it.

Called from Python one after the other, reading and filtering takes as long as the physics. MuJoCo's own ``mj_step`` is
called by its address, on the very model and data that Python sees.
"""

import ctypes
import math
from pathlib import Path
from typing import Any, Final

import mujoco
import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

Array = NDArray[np.float64]

COUNTS: Final = slice(0, 3)
TOUCH: Final = slice(6, 8)
PEAK_SQUARED: Final = 8
FASTEST: Final = 9
ARM_SPEED: Final = 10
MEMORY: Final = 11
"""What a tick remembers: encoder counts, speeds [rad/s], lagging forces on the right and left pad [N], the square of
the largest contact force so far [N²], the fastest servomotor [rad/s], and the fastest joint of arm and gripper
[rad/s, m/s]."""


def step_address() -> int:
    """Address of ``mj_step`` in the library that the Python package has loaded."""
    library = next(Path(mujoco.__file__).parent.glob("libmujoco.so*"))
    address = ctypes.cast(ctypes.CDLL(str(library)).mj_step, ctypes.c_void_p).value
    assert address is not None
    return address


@intrinsic
def _call_step(_typing: Any, step: Any, model: Any, data: Any) -> Any:
    """``step(model, data)``, all three being addresses."""

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        function, first, second = arguments
        kind = ir.FunctionType(ir.VoidType(), [first.type, second.type])
        builder.call(builder.inttoptr(function, kind.as_pointer()), [first, second])
        return context.get_dummy_value()

    return types.void(step, model, data), generate


@numba.njit(
    types.void(
        types.intp, types.intp, types.intp, types.int64, types.float64[::1], types.float64[::1], types.float64[::1],
        types.int64[::1], types.int64[::1], types.int64[::1], types.float64[::1], types.float64[::1],
    ),
    cache=True,
)  # fmt: skip
def advance(
    step: int, model: int, data: int, steps: int, positions: Array, velocities: Array, sensors: Array,
    servos: NDArray[np.int64], joints: NDArray[np.int64], forces: NDArray[np.int64], constants: Array, memory: Array,
) -> None:  # fmt: skip
    """One tick of so many steps, by the addresses of ``mj_step``, of MuJoCo's model and of its data.

    Of all generalised positions and velocities and all sensor readings, ``servos`` (3,) says where the servomotors'
    angles are, ``joints`` (n,) where the velocities of arm and gripper are, and ``forces`` (n,) where the contact
    forces begin, right and left finger first. ``constants`` are of ``constants_of``; ``memory`` is changed, as
    ``MEMORY`` says.
    """
    for _ in range(steps):
        _call_step(step, model, data)  # type: ignore[call-arg]  # the first is the compiler's
    scale, speed, lag = constants[0], constants[1], constants[2]
    fastest = 0.0
    for i in range(3):
        count = np.rint(positions[servos[i]] * scale)
        memory[3 + i] = (count - memory[i]) * speed
        memory[i] = count
        fastest = max(fastest, abs(memory[3 + i]))
    memory[FASTEST] = fastest
    quickest = 0.0
    for i in range(len(joints)):
        quickest = max(quickest, abs(velocities[joints[i]]))
    memory[ARM_SPEED] = quickest
    # a finger's sensor sits behind its pad and feels the force along the finger axis, pressing positive
    memory[6] += lag * (max(0.0, -sensors[forces[0]]) - memory[6])
    memory[7] += lag * (max(0.0, sensors[forces[1]]) - memory[7])
    for i in range(len(forces)):
        at = forces[i]
        squared = sensors[at] ** 2 + sensors[at + 1] ** 2 + sensors[at + 2] ** 2
        memory[PEAK_SQUARED] = max(memory[PEAK_SQUARED], squared)


def constants_of(encoder_bits: int, tick: float, bandwidth: float) -> Array:
    """Encoder counts for each rad, rad/s for each count in a tick [s], share in a tick of a bandwidth's lag [rad/s]."""
    counts = 2.0**encoder_bits / (2.0 * math.pi)
    return np.array([counts, 1.0 / (counts * tick), 1.0 - math.exp(-bandwidth * tick)])
