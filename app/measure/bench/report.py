"""What a bench reports: rows of statistics, each with its limit, under the names that the command prints as JSON."""

from __future__ import annotations

import os
import platform
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import numba
import numpy as np
from numpy.typing import ArrayLike
from rich.console import Group
from rich.text import Text

from app.terminal.report_table import judged, rows_table
from hardware.frozen import Frozen

Progress = Callable[[str], None]  # told what is being done

Tally = defaultdict[str, list[float]]  # what a bench saw: values by the names of their rows; begins as ``Tally(list)``


class Row(Frozen):
    """Statistics of one quantity; ``holds`` is true where there is no limit."""

    unit: str
    n: int
    mean: float
    p50: float
    p99: float
    max: float
    limit: float | None = None
    holds: bool = True

    def texts(self, name: str) -> tuple[str | Text, ...]:
        """What a table for people says of it."""
        limit = "" if self.limit is None else f"{self.limit:g}"
        verdict = "" if self.limit is None else judged("holds" if self.holds else "does not hold", self.holds)
        numbers = (f"{value:.4g}" for value in (self.mean, self.p50, self.p99, self.max))
        return name, self.unit, str(self.n), *numbers, limit, verdict


class BenchReport(Frozen):
    """One bench: ``holds`` says whether all of its rows hold."""

    bench: str
    seed: int
    pace: str
    machine: str
    holds: bool
    rows: dict[str, Row]

    @classmethod
    def of(cls, bench: str, seed: int, rows: dict[str, Row], pace: str = "fast") -> BenchReport:
        """Of rows that were measured on this machine."""
        holds = all(one.holds for one in rows.values())
        return cls(bench=bench, seed=seed, pace=pace, machine=machine(), holds=holds, rows=rows)

    def table(self) -> Group:
        """For people: one line a row."""
        columns = ("", "unit", ">n", ">mean", ">p50", ">p99", ">max", ">limit", "")
        return Group(rows_table(columns, [one.texts(name) for name, one in self.rows.items()]), self.machine)


def row(values: ArrayLike, unit: str, limit: float | None = None, bound: str = "p50", n: int | None = None) -> Row:
    """Statistics of values, at least one and all finite; ``limit`` is the bar, in the same unit.

    ``bound`` says which statistic must be no more: ``mean``, ``p50``, ``p99`` or ``max``; ``least``: the mean must be
    no less. ``n``: of how many, where the values are already of several.
    """
    numbers = np.asarray(values, dtype=np.float64).reshape(-1)
    p50, p99 = np.percentile(numbers, (50.0, 99.0)).tolist()
    statistics = {"mean": float(numbers.mean()), "p50": p50, "p99": p99, "max": float(numbers.max())}
    holds = limit is None or (statistics["mean"] >= limit if bound == "least" else statistics[bound] <= limit)
    return Row(unit=unit, n=numbers.size if n is None else n, **statistics, limit=limit, holds=holds)


def machine() -> str:
    """Processor, cores and software that numbers were measured on; names no host."""
    cpu = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        names = [
            line.split(":", 1)[1].strip() for line in info.read_text().splitlines() if line.startswith("model name")
        ]
        cpu = names[0] if names else cpu
    versions = f"Python {platform.python_version()}, NumPy {np.__version__}, Numba {numba.__version__}"
    return f"{cpu}, {os.cpu_count()} cores, {platform.system()}, {versions}"
