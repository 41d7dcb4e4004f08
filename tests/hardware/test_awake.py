"""Processors that wait awake: all of one's own, one of a virtual machine's; and asleep again afterwards."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from hardware import awake
from hardware.awake import is_virtual, kept_awake


@pytest.fixture
def system(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A computer of one's own with two processors, whose files lie in this folder."""
    (tmp_path / "cpu_dma_latency").write_bytes(b"")
    for core in (0, 1):
        (tmp_path / f"cpu{core}").write_bytes(b"0")
    (tmp_path / "cpuinfo").write_text("processor : 0\nflags : fpu vme sse\n")
    monkeypatch.setattr(awake, "LATENCY", str(tmp_path / "cpu_dma_latency"))
    monkeypatch.setattr(awake, "LATENCY_OF_ONE", str(tmp_path / "cpu{}"))
    monkeypatch.setattr(awake, "PROCESSORS", tmp_path / "cpuinfo")
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1})
    return tmp_path


def virtual(system: Path) -> None:
    (system / "cpuinfo").write_text("processor : 0\nflags : fpu vme hypervisor sse\n")


def latencies(system: Path) -> tuple[bytes, bytes]:
    """Of the two processors; the kernel ends a number where it is written."""
    one, two = ((system / f"cpu{core}").read_bytes()[:3] for core in (0, 1))
    return one, two


def is_open(path: Path) -> bool:
    return any(entry.exists() and entry.samefile(path) for entry in Path("/proc/self/fd").iterdir())


def test_all_processors_of_a_computer_of_ones_own_for_the_block_alone(system: Path) -> None:
    file = system / "cpu_dma_latency"
    with kept_awake(None):
        assert is_open(file)
        assert file.read_bytes() == bytes(4)
    assert not is_open(file)
    assert latencies(system) == (b"0", b"0")


@pytest.mark.parametrize(("core", "during"), [(None, (b"0", b"n/a")), (0, (b"n/a", b"0")), (1, (b"0", b"n/a"))])
def test_one_processor_of_a_virtual_machine(system: Path, core: int | None, during: tuple[bytes, bytes]) -> None:
    virtual(system)
    with kept_awake(core):
        assert latencies(system) == during
    assert [one[:1] for one in latencies(system)] == [b"0", b"0"]
    assert (system / "cpu_dma_latency").read_bytes() == b"", "the others may sleep"


def test_it_stays_awake_until_the_last_who_needs_it_ends(system: Path) -> None:
    virtual(system)
    with kept_awake(1):
        with kept_awake(1):
            pass
        assert latencies(system)[1] == b"n/a"
    assert latencies(system)[1][:1] == b"0"


def test_what_a_killed_process_left_awake_sleeps_after_the_next(system: Path) -> None:
    virtual(system)
    program = f"""
import os, signal
from hardware import awake
awake.LATENCY_OF_ONE, awake.is_virtual = {str(system / "cpu{}")!r}, lambda: True
with awake.kept_awake(1):
    os.kill(os.getpid(), signal.SIGKILL)
"""
    subprocess.run([sys.executable, "-c", program], check=False)
    assert latencies(system)[1] == b"n/a"
    with kept_awake(1):
        pass
    assert latencies(system)[1][:1] == b"0"


def test_where_one_alone_is_not_granted_all_are_and_where_nothing_is_it_says_so(system: Path) -> None:
    virtual(system)
    (system / "cpu1").unlink()
    with kept_awake(1):
        assert is_open(system / "cpu_dma_latency")
    (system / "cpu_dma_latency").unlink()
    with pytest.raises(FileNotFoundError), kept_awake(1):
        pass


def test_processors_of_which_nothing_is_known_are_ones_own(system: Path) -> None:
    (system / "cpuinfo").unlink()
    assert not is_virtual()
