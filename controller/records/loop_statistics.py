"""Statistics of the loop: of its last second for the telemetry, of a whole run for its file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

from controller.records.stderr import say_at_once

STATISTICS_FILE = "controller_pulse.json"
"""Statistics of a whole run (``LoopClock.summary``), written by the controller into the run directory when it ends."""

_FINE = 4096
"""Bins of 1 µs …"""
_COARSE = 4096
"""… and behind them bins of 100 µs; the last one also counts what is longer."""


class LoopStatistics(NamedTuple):
    """Statistics of the loop, as the telemetry tells them."""

    skipped: int = 0
    """Ticks that went by without an exchange since the start."""
    period: float = 0.0
    """Mean wall time between two exchanges in the last second of ticks [s]."""
    lateness: float = 0.0
    """Largest delay of an exchange's answer against the ticks' own rhythm in that second [s]."""
    work: float = 0.0
    """Longest computation of a tick in that second [s]."""


class Histogram:
    """Counts durations of a whole run: exact number, mean and maximum, percentiles to 1 µs (100 µs beyond 4 ms).

    Attributes:
        largest: of them [s].
    """

    __slots__ = ("_coarse", "_fine", "_total", "largest")

    def __init__(self) -> None:
        self.largest = 0.0
        self._total = 0.0
        self._fine, self._coarse = [0] * _FINE, [0] * _COARSE

    def add(self, duration: float) -> None:
        """Count a duration of at least 0 [s]."""
        self._total += duration
        self.largest = max(self.largest, duration)
        try:
            self._fine[int(duration * 1e6)] += 1
        except IndexError:
            self._coarse[min(int(duration * 1e4) - _FINE // 100, _COARSE - 1)] += 1

    @property
    def n(self) -> int:
        """Durations counted."""
        return sum(self._fine) + sum(self._coarse)

    @property
    def mean(self) -> float:
        """[s]; 0 if nothing was counted."""
        return self._total / max(1, self.n)

    def percentile(self, share: float) -> float:
        """The duration below which this share (0 to 1) of all lie, interpolated within its bin [s]."""
        wanted, below = share * self.n, 0
        for k, count in enumerate(self._fine + self._coarse):
            if count and below + count >= wanted:
                part = (wanted - below) / count
                end = (k + part) * 1e-6 if k < _FINE else (k - _FINE + _FINE // 100 + part) * 1e-4
                return min(self.largest, end)
            below += count
        return self.largest

    def summary(self) -> dict[str, float]:
        """``n``, and ``mean``, ``p50``, ``p99``, ``max`` [s]."""
        return {
            "n": self.n, "mean": self.mean, "p50": self.percentile(0.5), "p99": self.percentile(0.99),
            "max": self.largest,
        }  # fmt: skip


def write_statistics(directory: Path, run: dict[str, Any], realtime: dict[str, Any]) -> None:
    """Leave the statistics of a run in ``STATISTICS_FILE``; said on stderr where that cannot be written.

    Args:
        directory: of the run.
        run: ``LoopClock.summary``.
        realtime: what real time was granted, as JSON.
    """
    file = directory / STATISTICS_FILE
    new = file.with_suffix(".new")
    try:
        new.write_text(json.dumps({**run, "realtime": realtime}) + "\n", encoding="utf-8")
        new.replace(file)
    except OSError as error:
        say_at_once(f"{file} cannot be written ({error.strerror}): the loop's statistics of this run are lost")
