"""How long a new process needs until its first tick: with nothing compiled yet, and from the cache on disk."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from typing import NamedTuple

FIRST_TICK = """
import time
start = time.perf_counter()
from controller.law.task_space import TaskSpaceController, pack_reference
from controller.model.constants import DeltaModel
from hardware.parameters import load_parameters
law = TaskSpaceController(DeltaModel(load_parameters()))
assert law.update((0.3, 0.3, 0.3), (0.0, 0.0, 0.0)) == 0
law.torque(pack_reference((0.0, 0.0, 0.4)))
print(time.perf_counter() - start)
"""


class Starts(NamedTuple):
    """Seconds of wall time from the first import to the first torque."""

    first: float
    """With an empty cache: everything is compiled."""
    cached: list[float]
    """Later starts, one by one."""


def measure_starts(cached: int) -> Starts:
    """Start the law in processes of their own, with a cache directory that is empty before the first.

    Args:
        cached: how many starts from the cache.
    """
    with tempfile.TemporaryDirectory(prefix="touchmove-bench-") as folder:
        return Starts(start_once(folder), [start_once(folder) for _ in range(cached)])


def start_once(cache: str) -> float:
    """Seconds from the first import to the first torque in a new process with this cache directory."""
    done = subprocess.run(
        [sys.executable, "-c", FIRST_TICK],
        env={**os.environ, "NUMBA_CACHE_DIR": cache}, stdin=subprocess.DEVNULL, capture_output=True, text=True,
        check=True, timeout=120,
    )  # fmt: skip
    return float(done.stdout)
