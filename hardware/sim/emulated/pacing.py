"""When the plant behind emulated drives ticks: in step with whoever commands them, and never far from the wall clock.

A driver has a clock of its own. If plant and driver ticked side by side, each by its own deadlines, the driver would
see some state twice and another never, whenever one of them is late by a moment. So a tick that is due waits a little
for its commands, and commands that are early bring it forward a little; what remains moves the deadlines slowly to
where the commands come. Without commands the plant ticks by itself.
"""

from typing import Final

_EARLY, _LATE = 0.5, 0.5
"""Shares of a period by which commands bring a tick forward, and by which it waits for them."""
_GAIN: Final = 0.05
"""Share of a command's delay by which the deadlines move."""
LONGEST_DELAY: Final = 5.0
"""What is made up for [s]: beyond it plant time slips, as after this process was stopped."""


class FollowingPacer:
    """Deadlines of ticks; all times are ``time.monotonic`` [s]. ``slipped``: ticks that were given up."""

    def __init__(self, period: float, now: float) -> None:
        self.slipped = 0
        self._period = period
        self._due = now + period

    @property
    def window(self) -> tuple[float, float]:
        """From when on commands bring the next tick, and when it comes without."""
        return self._due - _EARLY * self._period, self._due + _LATE * self._period

    @property
    def expected(self) -> float:
        """When the next commands come, if they come as they did."""
        return self._due

    def ran(self, now: float, commanded: bool) -> None:
        """A tick has begun."""
        if commanded:
            delay = now - self._due
            self._due += _GAIN * min(self._period, max(-self._period, delay))
        self._due += self._period
        if (behind := now - self._due) > LONGEST_DELAY:
            self.slipped += round(behind / self._period)
            self._due += round(behind / self._period) * self._period
