"""The clock of a bus that has none: deadlines that are whole multiples of its period, by this computer's clock."""

import time
from typing import Final, NamedTuple

_SPIN: Final = 60e-6
"""A sleep ends so much early, and the rest is waited for actively [s]: ordinary kernels wake sleepers 50 µs late."""


class ExchangeTimes(NamedTuple):
    """Moments of one exchange (``time.monotonic``) [s]."""

    began: float
    """Its tick began."""
    sent: float
    """The command is given to the operating system."""
    came: float
    """The last answer is taken from it."""
    known: float
    """The measurement is known."""


def tick_now(period: float) -> int:
    """Periods [s] since this computer's clock began, so that all programs on it agree about them."""
    return int(time.monotonic() / period)


class TickClock:
    """Waits for one tick after the other; ``tick`` is the number of the last one, counted as by ``tick_now``."""

    def __init__(self, period: float) -> None:
        self._period, self._shift = period, 0.0
        self.tick = tick_now(period)

    def due(self) -> float:
        """When the next tick begins, if nothing comes between (``time.monotonic``) [s]; does not wait for it."""
        return self._tick_after(time.monotonic()) * self._period + self._shift

    def next(self) -> float:
        """Wait for the next tick; when it really began (``time.monotonic``) [s].

        Whoever comes more than a period late misses ticks: they are left out, the count goes on with the wall clock.
        """
        now = time.monotonic()
        self.tick = self._tick_after(now)
        due = self.tick * self._period + self._shift
        if (left := due - now - _SPIN) > 0.0:
            time.sleep(left)
        while (now := time.monotonic()) < due:
            pass
        return now

    def told(self, answered: float) -> int:
        """Tick of a measurement that was asked for in this tick and had then (``time.monotonic``) [s].

        If that took more than a period, nobody knows in which tick it was made: it is told with the one that it came
        in, and the next is left out, so that neither neighbour follows it.
        """
        came = int((answered - self._shift) / self._period)
        if came <= self.tick:
            return self.tick
        self.tick = came + 1
        return came

    def _tick_after(self, now: float) -> int:
        return max(self.tick + 1, int((now - self._shift) / self._period))

    def shift(self, seconds: float) -> None:
        """All ticks to come are later by so much; for a bus that has to keep in step with another clock."""
        self._shift += seconds
