"""Real time for a process that ticks: what the operating system grants, and plain words on what it does not.

The controller's process uses it, and the simulated world's where it has to be as punctual as a motion board.
"""

import contextlib
import ctypes
import gc
import os
import resource
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from hardware import awake, kernel_workers

_CURRENT, _FUTURE, _ON_FAULT = 1, 2, 4
"""``mlockall``: what is there, what comes, and no page before it is touched (else it would load whole libraries)."""
_SET_TIMER_SLACK, _GET_TIMER_SLACK = 29, 30
"""``prctl``."""
_CAP_IPC_LOCK = 1 << 14
_AWAKE_REMEDY = "run as root on Linux, or allow your account that file by a rule of udev"
_REMEDY = (
    "run as root, or 'sudo setcap cap_sys_nice,cap_ipc_lock+ep' the Python binary, "
    "or allow your account '{}' in /etc/security/limits.conf"
)


class RealTime(NamedTuple):
    """What a process got."""

    scheduled: bool
    """SCHED_FIFO with the priority asked for: no ordinary program can keep it from its processor."""
    locked: bool
    """Its memory is never swapped out."""
    pinned: bool
    """It stays on the core asked for; also true where none was asked for."""
    awake: bool
    """Processors that have nothing to do wait awake, as far as ``hardware.awake`` says."""
    notes: tuple[str, ...]
    """What it did not get, why, and the remedy, one sentence each."""

    @property
    def granted(self) -> bool:
        """Whether it got everything."""
        return self.scheduled and self.locked and self.pinned and self.awake


@contextlib.contextmanager
def real_time(name: str, priority: int, core: int | None = None, *, serial: bool = False) -> Iterator[RealTime]:
    """Real time for the calling thread and its process, as far as the system grants it, until the block ends.

    SCHED_FIFO is for this thread alone, with a priority of 1 to 99; above 50, where Linux with PREEMPT_RT handles
    interrupts. Threads and processes that it starts are ordinary ones. Whoever has it must sleep in each period; the
    kernel takes the processor away for 50 ms from one that spins for 950 ms. ``core`` is the only one to run on; None
    leaves that to the system. ``serial``: it waits for a serial port. What was granted comes with ``name`` in its
    notes.
    """
    with contextlib.ExitStack() as undo:
        notes: list[str] = []
        pinned = core is None or _try(lambda: _pin(core, undo), f"{name} is not bound to core {core}", notes)
        locked = _try(lambda: _lock_memory(undo), f"the memory of {name} is not locked", notes)
        woken = _try(lambda: _keep_awake(core, undo), f"the processors may fall asleep beside {name}", notes)
        if serial:
            _try(lambda: _hurry(priority, undo), f"the kernel may be late with what comes at {name}'s port", notes)
        undo.enter_context(exact_timers())
        undo.enter_context(quiet_memory())
        scheduled = _try(lambda: _schedule(priority, undo), f"{name} has no SCHED_FIFO {priority}", notes)
        yield RealTime(scheduled, locked, pinned, woken, tuple(notes))


@contextlib.contextmanager
def quiet_memory() -> Iterator[None]:
    """What was allocated before the block is never looked at by the garbage collector; within another it stays so."""
    within = gc.get_freeze_count() > 0
    gc.collect()  # takes some 50 ms: now, while nothing waits for this process
    gc.freeze()
    try:
        yield
    finally:
        if not within:
            gc.unfreeze()


@contextlib.contextmanager
def scheduling_kept() -> Iterator[None]:
    """Whatever a library does in the block to the scheduling of this thread is undone at its end."""
    if not hasattr(os, "sched_getscheduler"):
        yield
        return
    policy, before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        yield
    finally:
        _restore(policy, before)


@contextlib.contextmanager
def exact_timers() -> Iterator[None]:
    """Sleeps of this thread end on time, not up to 50 µs later to spare the processor; needs no privilege."""
    prctl = _libc("prctl")
    before = prctl(_GET_TIMER_SLACK, 0, 0, 0, 0) if prctl else -1
    if prctl is None or before <= 0:
        yield
        return
    prctl(_SET_TIMER_SLACK, 1, 0, 0, 0)
    try:
        yield
    finally:
        prctl(_SET_TIMER_SLACK, before, 0, 0, 0)


class _NotGranted(Exception):
    """Why not, and the remedy."""


def _try(setting: Callable[[], None], failure: str, notes: list[str]) -> bool:
    try:
        setting()
    except _NotGranted as error:
        notes.append(f"{failure}: {error}")
        return False
    return True


def _pin(core: int, undo: contextlib.ExitStack) -> None:
    if not hasattr(os, "sched_setaffinity"):
        raise _NotGranted(f"{sys.platform} cannot bind a thread to a core: use Linux")
    before = os.sched_getaffinity(0)
    try:
        os.sched_setaffinity(0, {core})
    except OSError as error:
        cores = ", ".join(map(str, sorted(before)))
        raise _NotGranted(f"{error.strerror}: choose among the cores {cores}, or none") from error
    undo.callback(os.sched_setaffinity, 0, before)


def _lock_memory(undo: contextlib.ExitStack) -> None:
    lock, unlock = _libc("mlockall"), _libc("munlockall")
    if lock is None or unlock is None:
        raise _NotGranted(f"{sys.platform} has no mlockall: use Linux")
    # with a finite limit a locked process that grows would be refused memory in the middle of its work
    flags = _CURRENT | _ON_FAULT | (_FUTURE if _may_lock_everything() else 0)
    if lock(flags):
        raise _NotGranted(f"{os.strerror(ctypes.get_errno())}: {_REMEDY.format('memlock unlimited')}")
    undo.callback(unlock)


def _keep_awake(core: int | None, undo: contextlib.ExitStack) -> None:
    try:
        undo.enter_context(awake.kept_awake(core))
    except OSError as error:
        raise _NotGranted(f"{awake.LATENCY}: {error.strerror}: {_AWAKE_REMEDY}") from error


def _hurry(priority: int, undo: contextlib.ExitStack) -> None:
    try:
        undo.enter_context(kernel_workers.hurried(max(1, priority - 1)))
    except OSError as error:
        raise _NotGranted(
            f"{error.strerror}: run as root, or 'sudo setcap cap_sys_nice+ep' the Python binary"
        ) from error


def _may_lock_everything() -> bool:
    if resource.getrlimit(resource.RLIMIT_MEMLOCK)[0] == resource.RLIM_INFINITY:
        return True
    with contextlib.suppress(OSError):
        for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
            if line.startswith("CapEff:"):
                return bool(int(line.split()[1], 16) & _CAP_IPC_LOCK)
    return False


def _schedule(priority: int, undo: contextlib.ExitStack) -> None:
    if not hasattr(os, "sched_setscheduler"):
        raise _NotGranted(f"{sys.platform} has no SCHED_FIFO: use Linux")
    policy, before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except OSError as error:
        raise _NotGranted(f"{error.strerror}: {_REMEDY.format('rtprio 95')}") from error
    undo.callback(_restore, policy, before)


def _restore(policy: int, before: os.sched_param) -> None:
    # without privileges RESET_ON_FORK cannot be taken back, only kept
    for flags in (policy, policy | os.SCHED_RESET_ON_FORK):
        with contextlib.suppress(PermissionError):
            os.sched_setscheduler(0, flags, before)
            return


def _libc(name: str) -> Callable[..., int] | None:
    """A function of the C library; None where it has none of that name."""
    try:
        function: Callable[..., int] = getattr(ctypes.CDLL(None, use_errno=True), name)
    except (AttributeError, OSError, TypeError):
        return None
    return function
