"""The clock of a bus that has none: deadlines that are whole multiples of its period, by this computer's clock."""

import time
from typing import Final

_SPIN: Final = 60e-6
"""A sleep ends so much early, and the rest is waited for actively [s]: ordinary kernels wake sleepers 50 µs late."""


class TickClock:
    """Ticks are counted from when this computer was switched on, so that programs on it agree about them."""

    def __init__(self, period: float) -> None:
        self._period = period
        self.tick = int(time.monotonic() / period)

    def next(self) -> float:
        """Wait for the next tick; when it really began (``time.monotonic``) [s].

        Whoever comes more than a period late misses ticks: they are left out, the count goes on with the wall clock.
        """
        now = time.monotonic()
        self.tick = max(self.tick + 1, int(now / self._period))
        due = self.tick * self._period
        if (left := due - now - _SPIN) > 0.0:
            time.sleep(left)
        while (now := time.monotonic()) < due:
            pass
        return now
