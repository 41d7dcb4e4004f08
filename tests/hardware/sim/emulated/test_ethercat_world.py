"""The process of a world behind emulated EtherCAT drives: its settings, how it ends, and its sentences."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import cast

import pytest
from pydantic import ValidationError

from hardware.drives.ethercat.settings import EtherCatSettings
from hardware.drives.moteus.settings import MoteusSettings
from hardware.drives.settings import DriveSettings
from hardware.interfaces import HardwareError, Pace
from hardware.sim.emulated.ethercat import namespace
from hardware.sim.emulated.plant_drives import EmulatedDevices, driven_world_of
from hardware.sim.emulated.process import devices_of, run_emulated
from hardware.sim.process.settings import END_FILE, WorldSettings, keep_settings
from tests.waiting import PATIENCE, until

PROCESS = [sys.executable, "-P", "-m", "hardware.sim.emulated.ethercat.process"]


def settings(**also: object) -> WorldSettings:
    given = {"pieces": (), "home": (0.0, 0.075, 0.325), "pace": Pace.REAL, "cameras": False, "drives": DriveSettings()}
    return WorldSettings.model_validate(given | {"ethercat": EtherCatSettings()} | also)


def refused(run_dir: Path) -> str:
    """What a process says that ends with status 1 by itself."""
    done = subprocess.run([*PROCESS, str(run_dir)], capture_output=True, text=True, timeout=60.0, check=False)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    return done.stderr


def minds_signals(pid: int) -> bool:
    """Whether a process runs: SIGTERM ends it in order, and it does not heed SIGINT, which it begins to do later."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    masks = {words[0]: int(words[1], 16) for words in map(str.split, status.splitlines()) if words[0].startswith("Sig")
             and words[0] != "SigQ:"}  # fmt: skip
    caught, ignored = masks["SigCgt:"] >> (signal.SIGTERM - 1), masks["SigIgn:"] >> (signal.SIGINT - 1)
    return bool(caught & ignored & 1)


def test_the_drives_are_on_one_bus_and_have_settings() -> None:
    with pytest.raises(ValidationError, match="both moteus and ethercat"):
        settings(moteus=MoteusSettings())
    with pytest.raises(ValidationError, match="ethercat is given without drives"):
        settings(drives=None)
    with pytest.raises(ValidationError, match="moteus is given without drives"):
        settings(drives=None, ethercat=None, moteus=MoteusSettings())


def test_settings_of_a_world_need_no_master() -> None:
    code = "import sys, hardware.sim.process.settings; sys.exit('pysoem' in sys.modules)"
    subprocess.run([sys.executable, "-P", "-c", code], check=True, timeout=60.0)


def test_devices_without_their_cable_say_how_their_world_is_started(tmp_path: Path) -> None:
    with pytest.raises(HardwareError, match=r"hardware\.sim\.emulated\.ethercat\.process"):
        devices_of(tmp_path, settings())


def test_what_cannot_be_a_world_is_one_sentence(tmp_path: Path) -> None:
    """Whatever it is, the process says it: seen once before and once after it has loaded everything."""
    assert "nothing can be written" in refused(tmp_path / "nowhere")
    assert "no world settings" in refused(tmp_path)
    keep_settings(settings(pace=Pace.FAST), tmp_path)
    with pytest.raises(HardwareError, match="emulated drives need pace real"):
        driven_world_of(tmp_path, cast("EmulatedDevices", None))
    keep_settings(settings(parameters_file=tmp_path / "none.toml"), tmp_path)
    with pytest.raises(HardwareError, match="this world cannot be made"):
        run_emulated(tmp_path)


def test_it_ends_in_order(tmp_path: Path) -> None:
    keep_settings(settings(), tmp_path)
    process = subprocess.Popen([*PROCESS, str(tmp_path)])
    try:
        assert namespace.network_pid(tmp_path) == process.pid
        until(lambda: process.poll() is not None or minds_signals(process.pid))
        process.send_signal(signal.SIGINT)  # whoever has started it decides
        time.sleep(0.2)
        assert process.poll() is None
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE) == 0
    finally:
        process.kill()
        process.wait()
    assert (tmp_path / END_FILE).exists()
