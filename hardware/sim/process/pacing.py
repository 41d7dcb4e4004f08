"""Plant time against wall time: when ticks are due in pace real, and how fast they ran."""

import time

CATCH_UP = 0.020
"""Pace real: a delay up to this is made up for [s, wall]; beyond it plant time slips. Below the lead of a motion's
first sample on a real-time bus."""


class Pacer:
    """When ticks of a period [s] are due in pace real. All times are ``time.monotonic`` [s].

    A tick is due one period after the one before was due, so that small delays do not add up. A world that is late runs
    its next ticks as soon as the controller is ready for each, so that it neither outruns the controller nor holds it
    responsible for a delay of its own: a command counts as missing one period after the last tick was run.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self._due = self._ran = time.monotonic()

    def next(self, now: float) -> tuple[float, float]:
        """When the next tick is due, and how long it may wait for its command."""
        self._due = max(self._due + self._period, now - CATCH_UP)
        return self._due, max(self._due, self._ran + self._period)

    def ran(self, now: float) -> None:
        """A tick begins."""
        self._ran = now


class SpeedMeter:
    """How fast plant time runs against the wall, while it runs: ``ticks``, and the ``wall`` time they took [s]."""

    def __init__(self) -> None:
        self.ticks = 0
        self.wall = 0.0
        self._last: float | None = None

    def ran(self, ticks: int) -> None:
        """So many ticks have run since it was last told."""
        now = time.perf_counter()
        if self._last is not None:
            self.wall += now - self._last
            self.ticks += ticks
        self._last = now

    def stood(self) -> None:
        """Plant time stood still: what passes until the next tick does not count."""
        self._last = None
