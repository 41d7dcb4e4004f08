"""Waiting for what other threads and processes do: as long as a busy machine needs, and no longer than it takes."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")

PATIENCE = 120.0
"""After so long what has not come does not come any more, however busy the machine is [s]."""


def until(condition: Callable[[], T], what: str = "it") -> T:
    """Wait for a condition to become true; its value."""
    deadline = time.monotonic() + PATIENCE
    while not (value := condition()):
        assert time.monotonic() < deadline, f"{what} did not happen within {PATIENCE:g} s"
        time.sleep(0.003)
    return value
