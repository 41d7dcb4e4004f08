"""The clock of a bus that has none: deadlines that are whole multiples of its period, by this computer's clock."""

import math
import time
from collections.abc import Callable
from typing import Final, NamedTuple

from hardware.interfaces import Triple

_SPIN: Final = 60e-6
"""A sleep ends so much early, and the rest is waited for actively [s]: ordinary kernels wake sleepers 50 µs late."""
_STANDING: Final = 1e-3
"""Joints that move by less in a period do not tell how much time has passed [rad]: it is a few counts of a coarse
encoder, and 0.3 mm at the tool."""


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


def periods_moved(before: Triple, velocity: Triple, now: Triple, period: float) -> float:
    """How many periods joints have moved on between two measurements; no number if they hardly move.

    Args:
        before: angles at the first [rad].
        velocity: at the first [rad/s].
        now: angles at the second [rad].
        period: of the bus [s].
    """
    square = sum(v * v for v in velocity)
    if square * period * period < _STANDING * _STANDING:
        return math.nan
    way = sum((b - a) * v for a, b, v in zip(before, now, velocity, strict=True))
    return way / (square * period)


def tick_now(period: float) -> int:
    """Periods [s] since this computer's clock began, so that all programs on it agree about them."""
    return int(time.monotonic() / period)


class TickClock:
    """Waits for one tick after the other; ``tick`` is the number of the last one, counted as by ``tick_now``."""

    def __init__(self, period: float) -> None:
        self._period, self._shift = period, 0.0
        self.tick = self._measured = tick_now(period)

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

    def told(self, answered: float, moved: Callable[[], float]) -> int:
        """Tick of a measurement that was asked for in this tick and had then (``time.monotonic``) [s].

        If that took more than a period, the computer may have been late to ask, or late to take the answer: only the
        arm itself tells which, by how far it has moved. Told with a tick in which it was not made, a measurement would
        be some millimetres from the reference of that tick, and stop an arm that is where it should be.

        Args:
            answered: when it was known.
            moved: called in that case: how many periods the arm has moved on since the measurement before; no number
                if it hardly moves, so that any tick is as good.
        """
        came = int((answered - self._shift) / self._period)
        if came > self.tick:
            periods = moved()
            self.tick = came if math.isnan(periods) else min(came, max(self.tick, self._measured + round(periods)))
        self._measured = self.tick
        return self.tick

    def _tick_after(self, now: float) -> int:
        return max(self.tick + 1, int((now - self._shift) / self._period))

    def shift(self, seconds: float) -> None:
        """All ticks to come are later by so much; for a bus that has to keep in step with another clock."""
        self._shift += seconds
