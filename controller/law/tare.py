"""What the tactile sensors say of free fingers is taken off what they say of held ones.

A sensor that reads 0.1 N too much on one side drives the tactile loop to a side: with k* = 5 and ω = 10 rad/s by 5 mm.
So each sensor's zero is found again whenever the fingers are free, as a weighing scale's is.
"""

from __future__ import annotations

from typing import Final

from controller.law.tactile import Pair

LARGEST_OFFSET: Final = 0.6
"""A free finger reads no more than this [N]: else it touches something, or its sensor is broken."""
FREE_AFTER: Final = 0.05
"""Fingers that do not close and read so little for so long are free: five times the sensors' lag [s]."""
AVERAGE: Final = 0.25
"""The zero is averaged over so long [s]."""


class Tare:
    """The zeros of both sensors.

    Args:
        period: of a tick [s].

    Attributes:
        zero: what the right and the left sensor say when nothing touches them [N].
    """

    def __init__(self, period: float) -> None:
        self.zero: Pair = (0.0, 0.0)
        self._wait = round(FREE_AFTER / period)
        self._most = round(AVERAGE / period)
        self._free = 0
        self._averaged = 0

    def weigh(self, said: Pair, finger_velocity: float) -> Pair:
        """What presses on the pads [N].

        Args:
            said: by the sensors [N].
            finger_velocity: that was asked for, positive opening [m/s]; fingers that close are about to hold something.
        """
        right, left = said
        zero_right, zero_left = self.zero
        if finger_velocity < 0.0 or not (
            -LARGEST_OFFSET < right < LARGEST_OFFSET and -LARGEST_OFFSET < left < LARGEST_OFFSET
        ):
            self._free = 0
        else:
            self._free += 1
            if self._free > self._wait:
                self._averaged = min(self._averaged + 1, self._most)
                share = 1.0 / self._averaged
                zero_right += share * (right - zero_right)
                zero_left += share * (left - zero_left)
                self.zero = zero_right, zero_left
        return right - zero_right, left - zero_left
