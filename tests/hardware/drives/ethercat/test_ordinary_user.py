"""The EtherCAT bus for somebody who is not root: the world and its driver in a user namespace of their own."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from hardware.drives.ethercat.settings import EtherCatSettings
from hardware.drives.settings import DriveSettings
from hardware.interfaces import Pace
from hardware.sim.emulated.ethercat import namespace
from hardware.sim.process.settings import WorldSettings, keep_settings

pytestmark = pytest.mark.real_time

_DROP_FROM_BOUNDING_SET, _LAST_CAPABILITY = 24, Path("/proc/sys/kernel/cap_last_cap")
_SET_FILE_CAPABILITIES = 31
"""Who has the number 0 may bring it into a user namespace with this one alone; see capabilities(7)."""
PACKAGE = "hardware.sim.emulated.ethercat"
HERE = Path(__file__).parent
DRIVER = """
import functools, sys, time
from hardware.drives.ethercat.bus import EtherCatServoBus
from hardware.drives.ethercat.settings import EtherCatSettings
from hardware.drives.settings import DriveSettings
from hardware.interfaces import Command, DriveStatus, HardwareError
from hardware.parameters import load_parameters
from hardware.sim.emulated.ethercat import namespace

enter = functools.partial(namespace.within_network, int(sys.argv[1]))
drives, cable = DriveSettings(), EtherCatSettings(interface=namespace.MASTER_END)
until = time.monotonic() + 60.0
while True:
    try:
        bus = EtherCatServoBus(cable, drives, drives.robot(load_parameters()), enter)
        break
    except HardwareError:  # the world is not there yet
        if time.monotonic() > until:
            raise
        time.sleep(0.1)
powered = Command((0.0, 0.0, 0.0), 0.0, brake=True, enable=True, busy=True)
followed = any(DriveStatus.ENABLED in bus.exchange(powered).status for _ in range(1000))
bus.close()
sys.exit(not followed)
"""


def without_capabilities() -> None:
    """What is executed next can do no more than anybody else, though it may read root's files: Python may lie there."""
    prctl = ctypes.CDLL(None, use_errno=True).prctl
    for capability in set(range(int(_LAST_CAPABILITY.read_text(encoding="ascii")) + 1)) - {_SET_FILE_CAPABILITIES}:
        assert prctl(_DROP_FROM_BOUNDING_SET, capability, 0, 0, 0) == 0


@pytest.fixture
def ordinary() -> dict[str, Any]:
    """How ``subprocess`` starts a process without privileges in a folder of its own."""
    how: dict[str, Any] = {"env": {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}}
    if namespace.privileged():
        how["preexec_fn"] = without_capabilities
    reason = None
    make = f"from {PACKAGE}.namespace import NoNetwork, make_network\ntry:\n make_network()\n"
    make += "except NoNetwork as error:\n raise SystemExit(str(error))"
    done = subprocess.run(
        [sys.executable, "-P", "-c", make], capture_output=True, text=True, timeout=60.0, check=False, **how
    )
    reason = done.stderr.strip() if done.returncode else None
    if reason is not None:
        if os.environ.get("CI"):
            pytest.fail(reason)
        pytest.skip(reason)
    return how


@pytest.fixture
def world(ordinary: dict[str, Any], tmp_path: Path) -> Iterator[int]:
    """The process of a world that an ordinary user has started."""
    settings = WorldSettings(
        pieces=(), home=(0.0, 0.075, 0.325), pace=Pace.REAL, cameras=False, linger=20.0, drives=DriveSettings(),
        ethercat=EtherCatSettings(),
    )  # fmt: skip
    keep_settings(settings, tmp_path)
    process = subprocess.Popen([sys.executable, "-P", "-m", f"{PACKAGE}.process", str(tmp_path)], **ordinary)
    try:
        yield namespace.network_pid(tmp_path)
        process.terminate()
        assert process.wait(30.0) == 0
    finally:
        process.kill()
        process.wait()


def inside(arguments: list[str], how: dict[str, Any], **also: Any) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-P", "-m", f"{PACKAGE}.enter_namespace", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, **how, **also)


def test_an_ordinary_user_drives_emulated_devices(world: int, ordinary: dict[str, Any], tmp_path: Path) -> None:
    (tmp_path / "driver.py").write_text(DRIVER, encoding="utf-8")
    path = os.pathsep.join([str(tmp_path), ordinary["env"].get("PYTHONPATH", "")])
    how = {**ordinary, "env": {**ordinary["env"], "PYTHONPATH": path}}
    done = inside([str(world), "-m", "driver", str(world)], how, timeout=120.0)
    assert done.returncode == 0, done.stderr
    outside = [sys.executable, "-P", "-m", "driver", str(world)]
    refused = subprocess.run(outside, capture_output=True, text=True, timeout=120.0, check=False, **how)
    assert refused.returncode
    assert f"{PACKAGE}.enter_namespace {world}" in refused.stderr


def test_what_cannot_be_entered_is_one_sentence(ordinary: dict[str, Any]) -> None:
    for arguments, words in (
        (["1", "-m", "this"], "the network of process 1 cannot be entered"),
        (["4194305", "-m", "this"], "No such file or directory"),
        (["-m", "this"], "usage: "),
    ):
        done = inside(arguments, ordinary, timeout=60.0)
        assert done.returncode == 1
        assert words in done.stderr
        assert done.stderr.count("\n") == 1


@pytest.mark.slow
@pytest.mark.skipif(namespace.privileged(), reason="they have run as they are")
def test_the_tests_of_the_bus_hold_for_an_ordinary_user(world: int, ordinary: dict[str, Any]) -> None:
    tests = [str(path) for path in sorted(HERE.glob("test_ethercat_*.py"))]
    done = inside([str(world), "-m", "pytest", "-q", "-p", "no:cacheprovider", *tests], ordinary, timeout=500.0)
    assert done.returncode == 0, done.stdout
    assert " passed" in done.stdout
    assert "skipped" not in done.stdout
