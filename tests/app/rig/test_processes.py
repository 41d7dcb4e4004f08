"""A simulated world that a command starts for itself ends with it, whenever that is."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.rig.rig_file import DrivesSection, RigFile, WorldSection
from app.rig.simulation import processes
from app.rig.simulation.settings import own_rig

WAITS = [sys.executable, "-c", "import sys, time; sys.stdout.write('.'); sys.stdout.flush(); time.sleep(600)"]


@pytest.fixture
def rig(tmp_path: Path) -> RigFile:
    rig = own_rig(tmp_path / "run", WorldSection(), drives=DrivesSection())
    rig.run_dir.mkdir()
    return rig


@pytest.fixture
def world() -> Iterator[subprocess.Popen[bytes]]:
    """Stands for one, and is up."""
    with subprocess.Popen(WAITS, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.read(1) == b"."
        yield process
        process.kill()


def test_an_interrupt_while_it_starts_ends_it(
    rig: RigFile, world: subprocess.Popen[bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(_run_dir: Path) -> int | None:
        raise KeyboardInterrupt

    monkeypatch.setattr(processes, "spawn", lambda _name, _rig: world)
    monkeypatch.setattr(processes, "world_pid", interrupted)
    with pytest.raises(KeyboardInterrupt):
        processes._start_world(rig)
    assert world.wait() == -signal.SIGKILL


def test_it_ends_though_no_controller_said_goodbye(
    rig: RigFile, world: subprocess.Popen[bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(processes, "world_pid", lambda _run_dir: world.pid)
    assert not rig.drives.emulated
    with processes.drives_of(rig, lambda _: None):
        os.kill(world.pid, 0)  # as long as it is wanted
    assert world.wait() == -signal.SIGTERM
