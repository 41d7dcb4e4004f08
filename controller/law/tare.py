"""What the tactile sensors say of free fingers is taken off what they say of held ones.

A sensor that reads 0.1 N too much on one side drives the tactile loop to a side: with k* = 5 and ω = 10 rad/s by 5 mm.
So each sensor's zero is found again whenever the fingers are free, as a weighing scale's is.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from controller.law.tactile import Pair
from controller.model.compiled import PAIR, ROW, SCALAR, FloatArray, compiled_as, direct

LARGEST_OFFSET: Final = 0.6
"""A free finger reads no more than this [N]: else it touches something, or its sensor is broken."""
FREE_AFTER: Final = 0.05
"""Fingers that do not close and read so little for so long are free: five times the sensors' lag [s]."""
AVERAGE: Final = 0.25
"""The zero is averaged over so long [s]."""
TARE_SIZE: Final = 6
_RIGHT, _LEFT, _FREE, _AVERAGED, _WAIT, _MOST = range(TARE_SIZE)


@compiled_as(PAIR(ROW, PAIR, SCALAR))
def weigh(memory: FloatArray, said: Pair, finger_velocity: float) -> Pair:
    """What presses on the pads [N].

    Args:
        memory: shape (6,), in and out: the zeros first.
        said: by the sensors [N].
        finger_velocity: that was asked for, positive opening [m/s]; fingers that close are about to hold something.
    """
    right, left = said
    small = abs(right) < LARGEST_OFFSET and abs(left) < LARGEST_OFFSET
    if finger_velocity < 0.0 or not small:
        memory[_FREE] = 0.0
    else:
        memory[_FREE] += 1.0
        if memory[_FREE] > memory[_WAIT]:
            memory[_AVERAGED] = min(memory[_AVERAGED] + 1.0, memory[_MOST])
            share = 1.0 / memory[_AVERAGED]
            memory[_RIGHT] += share * (right - memory[_RIGHT])
            memory[_LEFT] += share * (left - memory[_LEFT])
    return right - memory[_RIGHT], left - memory[_LEFT]


_weigh: Final = direct(weigh)


class Tare:
    """The zeros of both sensors.

    Args:
        period: of a tick [s].
        memory: where they are kept, shape (6,); by default an array of its own.
    """

    def __init__(self, period: float, memory: FloatArray | None = None) -> None:
        self._memory = np.zeros(TARE_SIZE) if memory is None else memory
        self._memory[_WAIT] = round(FREE_AFTER / period)
        self._memory[_MOST] = round(AVERAGE / period)

    @property
    def zero(self) -> Pair:
        """What the right and the left sensor say when nothing touches them [N]."""
        right, left = self._memory[:2].tolist()
        return right, left

    def weigh(self, said: Pair, finger_velocity: float) -> Pair:
        """What presses on the pads [N]; see `weigh`."""
        return _weigh(self._memory, said, finger_velocity)
