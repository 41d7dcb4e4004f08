"""When frames set out: absolute deadlines, moved slowly so that they keep their place before SYNC0.

The drives' clocks run on their own; within an hour a computer's is some milliseconds off. So the deadlines follow the
reference clock, whose time comes back with every frame, by a proportional and an integral part, at most 0.1 % of the
period at a time.
"""

from typing import Final

_MOST: Final = 1e-3
"""Share of a period by which a deadline moves."""
_GAIN, _SLOW_GAIN = 0.02, 2e-5


class ReferenceFollower:
    """Corrections of the deadlines from the reference clock's times, for frames that shall meet its whole periods."""

    def __init__(self, period: float) -> None:
        self._period = period
        self._cycle = round(period * 1e9)
        self._drift = 0.0
        self.error = 0.0
        """By how much the last frame was late against the reference [s]."""

    def correct(self, reference: int) -> float:
        """By how much the deadlines move [s], given the reference's time as a frame came by [ns]; 0: none is there."""
        if reference <= 0:
            return 0.0
        phase = reference % self._cycle
        if phase > self._cycle // 2:
            phase -= self._cycle
        self.error = phase * 1e-9
        most = _MOST * self._period
        self._drift = max(-most, min(most, self._drift - _SLOW_GAIN * self.error))
        return max(-most, min(most, self._drift - _GAIN * self.error))
