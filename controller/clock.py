"""How regularly the loop ticks, and how long it works."""

from __future__ import annotations

from typing import NamedTuple


class Pulse(NamedTuple):
    """Statistics of the loop, as the telemetry tells them."""

    skipped: int = 0
    """Ticks that went by without an exchange since the start."""
    period: float = 0.0
    """Mean wall time between two exchanges in the last second of ticks [s]."""
    lateness: float = 0.0
    """Largest delay of an exchange's answer against the ticks' own rhythm in that second [s]."""
    work: float = 0.0
    """Longest computation of a tick in that second [s]."""
