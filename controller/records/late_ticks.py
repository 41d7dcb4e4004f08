"""Whether ticks come late or take too long: a warning on stderr when they do, and what the statistics count.

Everything is allocated before the first tick; counting one tick takes about a microsecond.
"""

from __future__ import annotations

from typing import Any

from controller.records.loop_statistics import Histogram, LoopStatistics
from controller.records.stderr import say_at_once

_BLOCK = 0.25
"""Ticks are judged in blocks of this length [s]."""
_BLOCKS = 4
"""Blocks that make up "the last second"."""
_QUIET_BLOCKS = 40
"""Blocks between two warnings: 10 s."""
_SHARE = 0.5
"""A tick may work, and may be late, for this share of the period before a warning."""


class LoopClock:
    """Told of each exchange; knows the last second of ticks and the whole run.

    An answer is late by how much more it lags behind ``tick * period`` than the most punctual answer of the last half
    second did. So only the ticks' own rhythm counts: two clocks that drift apart by 100 parts in a million make an
    error of at most 0.05 ms, and a plant that stood still for a while is on time again half a second later.

    On a lockstep bus plant time waits for the loop, so that nothing can be late or skipped: both are 0 there.

    Args:
        period: of a tick [s].
        lockstep: whether plant time waits for the loop.

    Attributes:
        ticks: that were taken in.
        skipped: ticks that went by without an exchange.
        period_error: how far the wall time between two exchanges was from that of their ticks.
        lateness: of each answer against the ticks' own rhythm; nothing on a lockstep bus.
        law: from each answer until the next torque is known: estimate, protection, law, limits.
        work: from each answer until the loop is ready for the next exchange: law, socket, telemetry.
        warning_due: ``warn`` has something to say.
    """

    def __init__(self, period: float, lockstep: bool) -> None:
        self.skipped = self.ticks = 0
        self.period_error, self.lateness, self.law, self.work = Histogram(), Histogram(), Histogram(), Histogram()
        self.warning_due = False
        self._period = period
        self._lockstep = lockstep
        self._running = False
        self._tick = -1
        self._answered = 0.0
        self._least = self._least_before = float("inf")
        # of the present block, then of those before
        self._length = self._left = max(1, round(_BLOCK / period))
        self._ticks, self._wall, self._latest, self._longest = 0, 0.0, 0.0, 0.0
        self._past: list[tuple[int, float, float, float]] = [(0, 0.0, 0.0, 0.0)] * _BLOCKS
        # since the last warning
        self._settling, self._quiet = _BLOCKS, 0
        self._blocks, self._skipped_then, self._worst_latest, self._worst_longest = 0, 0, 0.0, 0.0

    def ran(self, tick: int, asked: float, answered: float, advanced: float) -> None:
        """An exchange brought a new tick.

        Args:
            tick: its number.
            asked: wall time before the exchange [s].
            answered: after it [s].
            advanced: when the torque of the next exchange was known [s].
        """
        if self._running:
            self._count_turn(asked - self._answered)
            passed, wall = tick - self._tick, answered - self._answered
            self._ticks += 1
            self._wall += wall
            self.period_error.add(abs(wall - passed * self._period))
            if passed > 1 and not self._lockstep:
                self.skipped += passed - 1
        if not self._lockstep:
            self._count_lateness(answered - tick * self._period)
        self.law.add(advanced - answered)
        self._tick, self._answered, self._running = tick, answered, True
        self._count(1)

    def ran_on(self, ticks: int, tick: int, asked: float, advanced: float) -> None:
        """So many ticks were run in one call, up to this one; on a lockstep bus alone.

        Args:
            ticks: how many.
            tick: number of the last one.
            asked: wall time before the call [s].
            advanced: when the torque of the next exchange was known [s].
        """
        if self._running:
            self._count_turn(asked - self._answered)
            self._ticks += ticks
            self._wall += advanced - self._answered
        self._tick, self._answered, self._running = tick, advanced, True
        self._count(ticks)

    def stood(self, asked: float) -> None:
        """The loop asked for no tick, or was told the same one again: what passes until the next one does not count.

        Args:
            asked: wall time before it asked [s].
        """
        if self._running:
            self._running = False
            self._count_turn(asked - self._answered)

    def statistics(self) -> LoopStatistics:
        """The last second of ticks."""
        ticks, wall, latest, longest = self._ticks, self._wall, self._latest, self._longest
        for block in self._past:
            ticks += block[0]
            wall += block[1]
            latest = max(latest, block[2])
            longest = max(longest, block[3])
        return LoopStatistics(self.skipped, wall / ticks if ticks else 0.0, latest, longest)

    def warn(self) -> None:
        """Say on stderr what was worse than it should be; nothing when stderr could not take it at once.

        For the end of a turn, when the next torque is known and sent as soon as the plant asks.
        """
        sentence = self._complaint()
        self._quiet, self.warning_due = _QUIET_BLOCKS, False
        self._forget()
        say_at_once(sentence)

    def summary(self) -> dict[str, Any]:
        """Statistics of the whole run, as they stand in the file: times in s, ``n``, mean and percentiles of each."""
        return {
            "period": self._period, "lockstep": self._lockstep, "ticks": self.ticks, "skipped": self.skipped,
            "period_error": self.period_error.summary(), "lateness": self.lateness.summary(),
            "law": self.law.summary(), "work": self.work.summary(),
        }  # fmt: skip

    def _count(self, ticks: int) -> None:
        self.ticks += ticks
        self._left -= ticks
        if self._left <= 0:
            self._close_block()

    def _count_turn(self, work: float) -> None:
        self.work.add(work)
        self._longest = max(self._longest, work)

    def _count_lateness(self, offset: float) -> None:
        """Against the least offset in this block and the one before."""
        self._least = min(self._least, offset)
        late = offset - (self._least if self._least < self._least_before else self._least_before)
        self.lateness.add(late)
        self._latest = max(self._latest, late)

    def _close_block(self) -> None:
        self._past.append((self._ticks, self._wall, self._latest, self._longest))
        del self._past[0]
        self._worst_latest = max(self._worst_latest, self._latest)
        self._worst_longest = max(self._worst_longest, self._longest)
        self._left, self._ticks, self._wall, self._latest, self._longest = self._length, 0, 0.0, 0.0, 0.0
        self._least_before, self._least = self._least, float("inf")
        self._blocks += 1
        if self._settling:  # the first second: everything is done for the first time
            self._settling -= 1
            self._forget()
        elif self._quiet:
            self._quiet -= 1
        elif not self._lockstep:
            limit = _SHARE * self._period
            worst = max(self._worst_latest, self._worst_longest)
            self.warning_due = self.skipped > self._skipped_then or worst > limit

    def _forget(self) -> None:
        """Warnings are about what comes from now on."""
        self._blocks, self._skipped_then, self._worst_latest, self._worst_longest = 0, self.skipped, 0.0, 0.0

    def _complaint(self) -> str:
        """The worst of what is wrong, with its limit and what to do."""
        skipped, limit = self.skipped - self._skipped_then, _SHARE * self._period
        span = f"in the last {self._blocks * self._length * self._period:.1f} s of ticks"
        if self._worst_longest > limit:
            trouble = (
                f"a tick took {self._worst_longest * 1e3:.2f} ms {span}, at most {limit * 1e3:.2f} ms is acceptable"
            )
        elif skipped:
            trouble = f"{skipped} ticks passed without an exchange {span}, at most 0 is acceptable"
        else:
            trouble = (
                f"a tick came {self._worst_latest * 1e3:.2f} ms late {span}, at most {limit * 1e3:.2f} ms is acceptable"
            )
        return f"{trouble}: end other programs on this PC, or run 'touchmove link-test' to see what to change"
