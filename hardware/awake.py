"""Keeps processors that have nothing to do awake, so that a message wakes its reader within a microsecond or two.

A computer of one's own keeps all of them awake. On a virtual machine a processor that waits awake looks busy to its
host: where all do, the machine takes more than its share, and the host lets it stand for some milliseconds out of each
100 (measured on two virtual processors: 0.1 % of all ticks missed with both awake, 0.01 % with one). So there only one
is: the reader's own, or the last that it may run on.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Final

LATENCY = "/dev/cpu_dma_latency"
"""Longest wake-up of all processors that its writer bears, as long as it is open [µs], as a binary integer (the
kernel's pm_qos_interface)."""
LATENCY_OF_ONE = "/sys/devices/system/cpu/cpu{}/power/pm_qos_resume_latency_us"
"""The same of one processor, as text (the kernel's sysfs-devices-power): it stays until somebody writes another."""
PROCESSORS = Path("/proc/cpuinfo")
_NOTHING: Final = b"n/a"
"""In ``LATENCY_OF_ONE``: no latency at all is borne …"""
_ANY: Final = b"0"
"""… and as it is by default: any is."""


@contextlib.contextmanager
def kept_awake(core: int | None) -> Iterator[None]:
    """For as long as the block lasts; raises ``OSError`` where the system does not let us.

    Args:
        core: the only one that the thread runs on; None: any.
    """
    with contextlib.ExitStack() as undo:
        if not is_virtual() or not _one(max(os.sched_getaffinity(0)) if core is None else core, undo):
            file = os.open(LATENCY, os.O_WRONLY | os.O_CLOEXEC)
            undo.callback(os.close, file)
            os.write(file, struct.pack("i", 0))
        yield


def is_virtual() -> bool:
    """Whether this computer's processors say that they are a virtual machine's."""
    try:
        words = PROCESSORS.read_text(encoding="ascii", errors="replace").split()
    except OSError:
        return False
    return "hypervisor" in words


def _one(core: int, undo: contextlib.ExitStack) -> bool:
    """Keep one awake; whether that was granted. Whoever is the last to need it lets it sleep again."""
    try:
        file = os.open(LATENCY_OF_ONE.format(core), os.O_RDWR | os.O_CLOEXEC)
    except OSError:
        return False
    undo.callback(os.close, file)
    try:
        fcntl.flock(file, fcntl.LOCK_SH)
        os.pwrite(file, _NOTHING, 0)
    except OSError:
        return False
    undo.callback(_let_sleep, file)
    return True


def _let_sleep(file: int) -> None:
    with contextlib.suppress(BlockingIOError):  # somebody else needs it still
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        os.pwrite(file, _ANY, 0)
