"""Encoders that contradict themselves or each other, tick by tick.

An arm that is blocked stands still with all its servomotors, by dry friction without a single count of change; an
encoder that stands still while another servomotor goes where it is asked to is broken.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from controller.model.compiled import ROW, SCALAR, STATUS, TABLE, VECTOR, FloatArray, Vector, compiled_as, direct
from controller.protection.limits import Limits, Violation
from controller.protocol.causes import Cause
from hardware.interfaces import Measurement, Triple

_TICK, _PERIOD, _JUMP, _WAY = range(4)
_ANGLE: Final = 4
_THEN: Final = 7
"""For each encoder the angles of all when it last moved, shape (3, 3) …"""
_REFERENCE: Final = 16
"""… and the reference then, shape (3, 3)."""
ENCODERS_SIZE: Final = 25
_JUMPED, _STUCK = 1, 4
"""What `watch_encoders` says of the first; of the next ones so much more."""


@compiled_as(STATUS(ROW, STATUS, VECTOR, TABLE))
def _stands_alone(memory: FloatArray, i: int, reference: Vector, rates: FloatArray) -> int:
    """Whether servomotor i should have moved and did not, while another one did."""
    way = (
        reference[0] - memory[_REFERENCE + 3 * i],
        reference[1] - memory[_REFERENCE + 3 * i + 1],
        reference[2] - memory[_REFERENCE + 3 * i + 2],
    )
    if not abs(rates[i, 0] * way[0] + rates[i, 1] * way[1] + rates[i, 2] * way[2]) > memory[_WAY]:
        return 0
    for j in range(3):
        asked = rates[j, 0] * way[0] + rates[j, 1] * way[1] + rates[j, 2] * way[2]
        if j != i and abs(asked) > 0.1 * memory[_WAY]:
            share = (memory[_ANGLE + j] - memory[_THEN + 3 * i + j]) / asked
            if 0.5 < share < 2.0:
                return 1
    return 0


@compiled_as(STATUS(ROW, SCALAR, VECTOR, VECTOR, VECTOR, TABLE))
def watch_encoders(
    memory: FloatArray, tick: float, angle: Vector, velocity: Vector, reference: Vector, rates: FloatArray
) -> int:
    """Take a tick in.

    Args:
        memory: shape (25,), in and out.
        tick: its number, a whole one.
        angle: y [rad].
        velocity: ẏ [rad/s].
        reference: where the tool is asked to be [m].
        rates: J_c⁻¹, shape (3, 3), which turns its way into the servomotors' [rad/m].

    Returns:
        0 all are well; 1, 2, 3: that one disagrees with its own velocity; 4, 5, 6: that one stands still alone.
    """
    consecutive = tick == memory[_TICK] + 1.0
    memory[_TICK] = tick
    before = memory[_ANGLE], memory[_ANGLE + 1], memory[_ANGLE + 2]
    for i in range(3):
        memory[_ANGLE + i] = angle[i]
    for i in range(3):
        moved = angle[i] - before[i]
        if consecutive and abs(moved - velocity[i] * memory[_PERIOD]) > memory[_JUMP]:
            return _JUMPED + i
        if not consecutive or moved != 0.0:
            for j in range(3):
                memory[_THEN + 3 * i + j] = angle[j]
                memory[_REFERENCE + 3 * i + j] = reference[j]
        elif _stands_alone(memory, i, reference, rates):
            return _STUCK + i
    return 0


_watch: Final = direct(watch_encoders)


class Encoders:
    """Whether each encoder agrees with its own velocity, and moves with the others.

    Args:
        limits: of a jump, and of a way asked for and not seen.
        period: of a tick [s].
        memory: of `watch_encoders`, shape (25,); by default an array of its own.
    """

    def __init__(self, limits: Limits, period: float, memory: FloatArray | None = None) -> None:
        self._memory = np.zeros(ENCODERS_SIZE) if memory is None else memory
        self._limits = limits
        self._memory[_PERIOD], self._memory[_JUMP], self._memory[_WAY] = period, limits.encoder_jump, limits.encoder_way
        self.reset()

    def check(self, measurement: Measurement, reference: Triple, rates: FloatArray) -> Violation | None:
        """Take a tick in; arguments as of `watch_encoders`."""
        found = _watch(self._memory, float(measurement.tick), measurement.angle, measurement.velocity, reference, rates)
        if not found:
            return None
        limits = self._limits
        if found < _STUCK:
            return Violation(Cause.ENCODER, float(found), limits.encoder_jump)
        return Violation(Cause.ENCODER, float(found - _STUCK + 1), limits.encoder_way)

    def reset(self) -> None:
        """Forget the angles before."""
        self._memory[_TICK] = -math.inf
