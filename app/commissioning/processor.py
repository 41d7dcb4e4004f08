"""What the operating system says of the processor."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Self


@dataclass(frozen=True, slots=True)
class ProcessorTime:
    """Counters since the PC was started, over all cores [ticks of the system]: all time, and what a host stole.

    In a virtual machine stolen time is what the host gave to others while this machine wanted to work. No privilege
    within the machine protects a loop from it.
    """

    total: int
    stolen: int

    @classmethod
    def now(cls) -> Self | None:
        """The counters; None where the system does not tell."""
        try:
            first = Path("/proc/stat").read_text(encoding="ascii").splitlines()[0].split()
        except (OSError, IndexError):
            return None
        values = [int(value) for value in first[1:9]]  # what follows is counted in these already
        return cls(sum(values), values[7]) if len(values) == 8 else None


def stolen_share(before: ProcessorTime | None, after: ProcessorTime | None) -> float:
    """Share of the processors' time that a host stole between two counts, 0 to 1; 0 where it is not known."""
    if before is None or after is None or after.total <= before.total:
        return 0.0
    return (after.stolen - before.stolen) / (after.total - before.total)
