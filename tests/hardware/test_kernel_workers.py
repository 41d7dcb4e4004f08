"""The kernel's unbound workers are promoted while a block lasts, and nobody else."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

from hardware import kernel_workers
from hardware.kernel_workers import Promotion, hurried, workers
from tests.controller.loop.test_realtime import may_schedule
from tests.waiting import until

NAMES = {11: "kworker/u8:2-events_unbound", 12: "kworker/1:0-mm", 13: "python", 14: "kworker/u9:0", 15: "kworker/u8:1"}


@pytest.fixture
def policies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[int, tuple[int, int]]:
    """Processes of a made-up kernel with their policy and priority; somebody else has promoted the last."""
    for number, name in NAMES.items():
        (tmp_path / str(number)).mkdir()
        (tmp_path / str(number) / "comm").write_text(name + "\n")
    (tmp_path / "self").mkdir()
    found = dict.fromkeys(NAMES, (os.SCHED_OTHER, 0)) | {15: (os.SCHED_FIFO, 50)}
    monkeypatch.setattr(kernel_workers, "PROCESSES", tmp_path)
    monkeypatch.setattr(os, "sched_getscheduler", lambda process: found[process][0])

    def schedule(process: int, policy: int, parameter: os.sched_param) -> None:
        found[process] = (policy, parameter.sched_priority)

    monkeypatch.setattr(os, "sched_setscheduler", schedule)
    return found


def test_ordinary_unbound_workers_are_promoted_and_are_ordinary_afterwards(
    policies: dict[int, tuple[int, int]], tmp_path: Path
) -> None:
    before, promotion = dict(policies), Promotion(79)
    promotion.look()
    assert {process for process, now in policies.items() if now == (os.SCHED_FIFO, 79)} == {11, 14}
    (tmp_path / "16").mkdir()
    (tmp_path / "16" / "comm").write_text("kworker/u8:7\n")
    policies[16] = (os.SCHED_OTHER, 0)
    promotion.look()  # the kernel has made one more meanwhile
    assert policies[16] == (os.SCHED_FIFO, 79)
    (tmp_path / "11" / "comm").write_text("somebody else\n")
    policies[11] = (os.SCHED_FIFO, 20)
    promotion.end()
    assert policies == before | {16: (os.SCHED_OTHER, 0), 11: (os.SCHED_FIFO, 20)}


@pytest.mark.real_time
@pytest.mark.skipif(not may_schedule(), reason="this account gets no real time")
@pytest.mark.parametrize("killed", [False, True])
def test_it_ends_with_the_block_and_with_its_process(killed: bool) -> None:
    code = "import sys; from hardware.kernel_workers import hurried\n" \
        "with hurried(7): print('in', flush=True); sys.stdin.read()"  # fmt: skip
    there = ordinary()
    loop = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    with loop:
        assert loop.stdout is not None
        assert loop.stdout.readline() == "in\n"
        assert not there & ordinary()
        if killed:
            loop.send_signal(signal.SIGKILL)
        else:
            loop.communicate()
    until(lambda: not there & workers() - ordinary(), "the end of their real time")


def ordinary() -> set[int]:
    """Workers that have no real time."""
    found = set()
    for worker in workers():
        with suppress(ProcessLookupError):  # it has ended since it was listed
            if os.sched_getscheduler(worker) == os.SCHED_OTHER:
                found.add(worker)
    return found


def test_what_the_system_does_not_grant_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernel_workers.sys, "executable", "/bin/false")
    with pytest.raises(OSError, match="does not begin"), hurried(3):
        pass
