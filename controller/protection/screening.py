"""A quick look at a tick, compiled, which tells whether anybody has to look closer.

Nearly every tick is. The checks of `controller.protection.limits` and `controller.protection.monitor` say what is
wrong, with numbers, and remember what lasts; they are Python, and together cost a third of a tick's work, more than
that where another program has driven them out of the processor's cache. Here the same limits are compared once, in a
microsecond, and nothing is
said but yes or no: after a no they all are asked. A yes therefore means exactly that each of them has nothing to say;
`tests/controller/protection/test_screen.py` holds the two against each other.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from controller.model.compiled import PAIR, ROW, SCALAR, STATUS, TABLE, VECTOR, FloatArray, Vector, compiled_as, direct
from controller.model.state import POSITION, VELOCITY
from controller.protection.limits import Limits
from hardware.interfaces import Triple

# What the compiled functions are given beside the tick: one array, as each array costs a tenth of a microsecond.
_MIDDLE: Final = 0
_RANGE: Final = 3
_SPEED: Final = 4
_CENTRE: Final = 5
_HALF: Final = 8
_OUTSIDE: Final = 11
_TOOL_SPEED: Final = 12
_PRESS: Final = 13
_GRIP: Final = 14
_TACTILE: Final = 15
_TRACKING: Final = 16
_LEAST: Final = 17
_MOST: Final = 18
_RMS: Final = 19
_SHARE: Final = 20
_SQUARES: Final = 21
SCREEN_SIZE: Final = 24


@compiled_as(STATUS(ROW, VECTOR, VECTOR))
def joints_well(memory: FloatArray, angle: Vector, velocity: Vector) -> int:
    """Speed and range of the servomotors.

    Args:
        memory: shape (24,); not changed.
        angle: y [rad].
        velocity: ẏ [rad/s].

    Returns:
        1 where each is within its limits; else 0.
    """
    for i in range(3):
        within = abs(angle[i] - memory[_MIDDLE + i]) <= memory[_RANGE]
        if not (within and abs(velocity[i]) <= memory[_SPEED]):
            return 0
    return 1


@compiled_as(STATUS(ROW, TABLE, ROW, VECTOR, PAIR, VECTOR))
def arm_well(
    memory: FloatArray, state: FloatArray, reference: FloatArray, force: Vector, tactile: tuple[float, float],
    torque: Vector,
) -> int:  # fmt: skip
    """Tool, fingers, motors and the distance to the reference.

    Args:
        memory: shape (24,); the servomotors' mean squares go on in it, if all is well.
        state: shape (27, 3), as the law's estimate left it.
        reference: shape (16,) or longer, of this tick.
        force: on the tool [N].
        tactile: forces on the pads [N].
        torque: of the last exchange [N m].

    Returns:
        1 where nothing is beyond any limit, not even for a while; else, and where anything is no number, 0, and nothing
        has changed.
    """
    squared = 0.0
    for i in range(3):
        at = state[POSITION, i]
        error = abs(at - reference[i])
        gain = max(reference[9 + i], 1.0)
        allowed = max(memory[_LEAST], min(memory[_MOST], memory[_TRACKING] / gain))
        if not (error <= allowed and abs(at - memory[_CENTRE + i]) - memory[_HALF + i] <= memory[_OUTSIDE]):
            return 0
        squared += state[VELOCITY, i] * state[VELOCITY, i]
    press = math.sqrt(force[0] * force[0] + force[1] * force[1] + force[2] * force[2])
    if not (math.sqrt(squared) <= memory[_TOOL_SPEED] and press <= memory[_PRESS]):
        return 0
    # one by one here and below: a maximum might pass over what is no number
    borne = tactile[0] <= memory[_TACTILE] and tactile[1] <= memory[_TACTILE]
    if not (borne and min(tactile[0], tactile[1]) <= memory[_GRIP]):
        return 0
    a = memory[_SQUARES] + memory[_SHARE] * (torque[0] * torque[0] - memory[_SQUARES])
    b = memory[_SQUARES + 1] + memory[_SHARE] * (torque[1] * torque[1] - memory[_SQUARES + 1])
    c = memory[_SQUARES + 2] + memory[_SHARE] * (torque[2] * torque[2] - memory[_SQUARES + 2])
    most = memory[_RMS] * memory[_RMS]
    if not (a <= most and b <= most and c <= most):
        return 0
    memory[_SQUARES], memory[_SQUARES + 1], memory[_SQUARES + 2] = a, b, c
    return 1


@compiled_as(SCALAR(ROW))
def heat(memory: FloatArray) -> float:
    """Mean square of the torque of the warmest servomotor, as a share of what it is rated for; memory of `arm_well`."""
    warmest = max(memory[_SQUARES], memory[_SQUARES + 1], memory[_SQUARES + 2])
    share: float = warmest / (memory[_RMS] * memory[_RMS])
    return share


_arm_well: Final = direct(arm_well)
_heat: Final = direct(heat)


class Screen:
    """The quick look with its limits and its memory.

    Args:
        limits: of the protection.
        period: of a tick [s].
        memory: shape (24,); by default an array of its own.

    Attributes:
        squares: the servomotors' mean squares, shape (3,), shared with `controller.protection.monitor` [N² m²].
    """

    def __init__(self, limits: Limits, period: float, memory: FloatArray | None = None) -> None:
        self._memory = memory = np.zeros(SCREEN_SIZE) if memory is None else memory
        memory[_MIDDLE : _MIDDLE + 3], memory[_RANGE] = limits.joint_middle, limits.joint_range
        memory[_SPEED] = limits.joint_speed
        memory[_CENTRE : _CENTRE + 3], memory[_HALF : _HALF + 3] = limits.centre, limits.half_size
        memory[_OUTSIDE], memory[_TOOL_SPEED], memory[_PRESS] = limits.outside, limits.tool_speed, limits.press_force
        memory[_GRIP], memory[_TACTILE] = limits.grip_force, limits.tactile
        memory[_TRACKING] = limits.tracking_acceleration
        memory[_LEAST], memory[_MOST] = limits.tracking_least, limits.tracking_most
        memory[_RMS], memory[_SHARE] = limits.rms_torque, 1.0 - math.exp(-period / limits.rms_window)
        self.squares = memory[_SQUARES : _SQUARES + 3]

    @property
    def heat(self) -> float:
        """See `heat`."""
        return float(_heat(self._memory))

    def arm(
        self, state: FloatArray, reference: FloatArray, force: Triple, tactile: tuple[float, float], torque: Triple
    ) -> bool:
        """Whether nobody has to look closer at tool, fingers and motors; arguments as of `arm_well`."""
        return _arm_well(self._memory, state, reference, force, tactile, torque) == 1
