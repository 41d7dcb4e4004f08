"""Real time: what is asked for, what is said where it is not granted, and that it ends with the block."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import threading
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

import hardware.awake as awake
import hardware.realtime as realtime
from controller.loop.realtime import set_up_real_time
from controller.settings import ControllerSettings
from hardware.realtime import RealTime, exact_timers, real_time, scheduling_kept
from hardware.sim.process.server import World

ORDINARY = (os.SCHED_OTHER, 0)


def may_schedule() -> bool:
    """Whether this account gets SCHED_FIFO; tried in a process of its own."""
    code = "import os; os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))"
    return subprocess.run([sys.executable, "-c", code], capture_output=True, check=False).returncode == 0


def present() -> tuple[int, int]:
    """Policy, without flags, and priority of this thread."""
    return os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK, os.sched_getparam(0).sched_priority


def bus(lockstep: bool, **more: bool) -> Any:
    """What is asked of a bus here."""
    return SimpleNamespace(lockstep=lockstep, **more)


def refuse(*_: Any) -> None:
    raise PermissionError(1, "Operation not permitted")


@pytest.fixture
def unprivileged(monkeypatch: pytest.MonkeyPatch) -> None:
    """A system that grants nothing."""
    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    library = realtime._libc

    def deaf(name: str) -> Callable[..., int] | None:
        return (lambda *_: 1) if name == "mlockall" else library(name)

    monkeypatch.setattr(realtime, "_libc", deaf)
    monkeypatch.setattr("ctypes.get_errno", lambda: 12)
    monkeypatch.setattr(awake, "LATENCY", "/nowhere/cpu_dma_latency")
    monkeypatch.setattr(awake, "LATENCY_OF_ONE", "/nowhere/cpu{}")


def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, int]]:
    """Records who asks for SCHED_FIFO, and grants nothing."""
    seen: list[tuple[int, int]] = []

    def record(_pid: int, policy: int, parameter: os.sched_param) -> None:
        seen.append((policy, parameter.sched_priority))
        refuse()

    monkeypatch.setattr(os, "sched_setscheduler", record)
    return seen


@pytest.mark.usefixtures("unprivileged")
def test_without_privileges_it_runs_and_says_what_is_missing_and_what_to_do(capfd: pytest.CaptureFixture[str]) -> None:
    with set_up_real_time(ControllerSettings(), bus(lockstep=False)) as granted:
        assert not granted.granted
        assert (granted.scheduled, granted.locked, granted.pinned, granted.awake) == (False, False, True, False)
    remedy = "run as root, or 'sudo setcap cap_sys_nice,cap_ipc_lock+ep' the Python binary, or allow your account "
    assert granted.notes == (
        f"the memory of the controller is not locked: Cannot allocate memory: {remedy}'memlock unlimited' in "
        "/etc/security/limits.conf",
        "the processors may fall asleep beside the controller: /nowhere/cpu_dma_latency: No such file or directory: "
        "run as root on Linux, or allow your account that file by a rule of udev",
        f"the controller has no SCHED_FIFO 80: Operation not permitted: {remedy}'rtprio 95' in "
        "/etc/security/limits.conf",
    )
    assert capfd.readouterr().err.splitlines() == [
        f"{note}; until then the controller runs without it, and may miss ticks on a busy PC" for note in granted.notes
    ]


@pytest.mark.usefixtures("unprivileged")
def test_of_a_bus_by_a_serial_port_it_says_besides_that_the_kernel_may_be_late(monkeypatch: pytest.MonkeyPatch) -> None:
    priorities: list[int] = []

    def refused(priority: int) -> Any:
        priorities.append(priority)
        refuse()

    monkeypatch.setattr("hardware.kernel_workers.hurried", refused)
    with set_up_real_time(ControllerSettings(), bus(lockstep=False, by_serial_port=True)) as granted:
        assert not granted.scheduled
    assert priorities == [ControllerSettings().priority - 1]
    assert [note for note in granted.notes if "kernel" in note] == [
        "the kernel may be late with what comes at the controller's port: Operation not permitted: run as root, or "
        "'sudo setcap cap_sys_nice+ep' the Python binary"
    ]


@pytest.mark.parametrize(("wanted", "lockstep"), [(True, True), (False, False), (False, True)])
def test_never_on_a_lockstep_bus_nor_where_it_is_not_wanted(
    wanted: bool, lockstep: bool, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    seen = asked(monkeypatch)
    monkeypatch.setattr(realtime, "_lock_memory", lambda undo: seen.append((-1, -1)))
    before, _new = gc.get_freeze_count(), [object() for _ in range(10)]
    with set_up_real_time(ControllerSettings(realtime=wanted), bus(lockstep)) as granted:
        assert gc.get_freeze_count() > before
    assert granted == RealTime(scheduled=False, locked=False, pinned=False, awake=False, notes=())
    assert seen == []
    assert capfd.readouterr().err == ""


def test_what_it_starts_is_to_be_ordinary(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = asked(monkeypatch)
    with real_time("a test", 42):
        pass
    assert seen == [(os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, 42)]


def test_a_core_that_is_not_there() -> None:
    cores = os.sched_getaffinity(0)
    with real_time("a test", 1, core=100_000) as granted:
        assert os.sched_getaffinity(0) == cores
    assert not granted.pinned
    assert not granted.granted
    listed = ", ".join(map(str, sorted(cores)))
    sentence = f"a test is not bound to core 100000: Invalid argument: choose among the cores {listed}, or none"
    assert sentence in granted.notes


def test_a_core_is_kept_for_the_block_alone() -> None:
    cores = os.sched_getaffinity(0)
    with real_time("a test", 1, core=min(cores)) as granted:
        assert os.sched_getaffinity(0) == {min(cores)}
    assert granted.pinned
    assert os.sched_getaffinity(0) == cores


def test_a_system_without_any_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "other")
    monkeypatch.setattr(realtime, "_libc", lambda name: None)
    monkeypatch.setattr(awake, "LATENCY", "/nowhere/cpu_dma_latency")
    monkeypatch.setattr(awake, "LATENCY_OF_ONE", "/nowhere/cpu{}")
    monkeypatch.delattr(os, "sched_setscheduler")
    monkeypatch.delattr(os, "sched_setaffinity")
    with real_time("a test", 1, core=0) as granted:
        pass
    assert granted.notes == (
        "a test is not bound to core 0: other cannot bind a thread to a core: use Linux",
        "the memory of a test is not locked: other has no mlockall: use Linux",
        "the processors may fall asleep beside a test: /nowhere/cpu_dma_latency: No such file or directory: run as "
        "root on Linux, or allow your account that file by a rule of udev",
        "a test has no SCHED_FIFO 1: other has no SCHED_FIFO: use Linux",
    )


@pytest.mark.skipif(not may_schedule(), reason="this account gets no SCHED_FIFO")
def test_granted_for_this_thread_and_until_the_block_ends() -> None:
    found: dict[str, Any] = {}

    def work() -> None:
        with real_time("a test", 7) as granted:
            found["granted"], found["inside"] = granted, present()
            started = threading.Thread(target=lambda: found.update(thread=present()))
            started.start()
            started.join()
            code = "import os; print(os.sched_getscheduler(0), os.sched_getparam(0).sched_priority)"
            done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
            found["process"] = tuple(map(int, done.stdout.split()))
        found["after"] = present()

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert found["granted"].scheduled
    assert found["inside"] == (os.SCHED_FIFO, 7)
    assert found["thread"] == found["process"] == found["after"] == ORDINARY
    assert present() == ORDINARY


@pytest.mark.parametrize("limit", [1 << 30, -1])
def test_memory_to_come_is_locked_only_where_that_cannot_starve_the_process(
    limit: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    flags: list[int] = []

    def library(name: str) -> Callable[..., int]:
        return (lambda value=0, *_: flags.append(value) or 0) if name == "mlockall" else (lambda *_: 0)

    monkeypatch.setattr(realtime, "_libc", library)
    monkeypatch.setattr("resource.getrlimit", lambda which: (limit, limit))
    monkeypatch.setattr(realtime, "_CAP_IPC_LOCK", 0)
    asked(monkeypatch)
    with real_time("a test", 1) as granted:
        pass
    assert granted.locked
    assert flags == [1 | 4 | (2 if limit == -1 else 0)]


@pytest.mark.skipif(not may_schedule(), reason="this account gets no SCHED_FIFO")
def test_what_a_library_does_to_this_threads_scheduling_is_undone() -> None:
    with scheduling_kept():
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        assert present() == (os.SCHED_FIFO, 1)
    assert present() == ORDINARY


def test_timers_are_exact_within_the_block() -> None:
    prctl = realtime._libc("prctl")
    assert prctl is not None
    before = prctl(30, 0, 0, 0, 0)
    with exact_timers():
        assert prctl(30, 0, 0, 0, 0) == 1
    assert prctl(30, 0, 0, 0, 0) == before


THAWED = """
import contextlib, gc
from hardware.realtime import quiet_memory
with contextlib.suppress(ZeroDivisionError), quiet_memory():
    with quiet_memory():
        pass
    assert gc.get_freeze_count() > 0
    raise ZeroDivisionError
assert gc.get_freeze_count() == 0
"""


def test_the_garbage_collector_is_thawed_again_by_the_outermost() -> None:
    """In a process of its own: to look through all that thousands of tests have loaded takes seconds."""
    subprocess.run([sys.executable, "-c", THAWED], check=True)


@pytest.mark.parametrize("wanted", [True, False])
def test_the_world_is_punctual_where_that_is_wanted(
    wanted: bool, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    seen = asked(monkeypatch)
    world = object.__new__(World)
    world._realtime = wanted
    with world._punctual():
        pass
    assert [priority for _, priority in seen] == ([90] if wanted else [])
    assert ("the simulated world has no SCHED_FIFO 90: " in capfd.readouterr().err) is wanted
    assert ControllerSettings().priority < 90
