"""The moteus driver against emulated controllers on the simulated plant, over a pseudo-terminal."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from hardware.drives.moteus.bus import MoteusServoBus
from hardware.drives.moteus.fdcanusb import CanFrame, parse_frame, send_line, with_check_sum, without_check_sum
from hardware.drives.moteus.frames import parse
from hardware.drives.moteus.settings import MoteusSettings, PinSettings
from hardware.drives.settings import DriveSettings
from hardware.interfaces import BusLost, Command, DriveStatus, Pace
from hardware.parameters import load_parameters
from hardware.realtime import real_time
from hardware.sim.emulated.moteus.devices import PORT
from hardware.sim.process.planted import PlantedFault, PlantedKind
from hardware.sim.process.settings import WorldSettings, keep_settings
from tests.hardware.bus_benches import as_soon_as_there, held_up

pytestmark = pytest.mark.real_time

DRIVES = DriveSettings()
SETTINGS = MoteusSettings(brakes=PinSettings(id=4, aux=2, pin=1))
REST = Command((0.0, 0.0, 0.0), 0.0, brake=True, enable=False, busy=False)
POWERED = Command((0.0, 0.0, 0.0), 0.0, brake=True, enable=True, busy=True)
FREE = Command((1.0, 1.0, 1.0), 0.01, brake=False, enable=True, busy=True)


def test_the_example_of_the_documentation() -> None:
    written = [(0x000, 10.0), (0x020, 96.0), (0x021, 288.0), (0x022, -176.0)]
    asked = [(register, 0.0) for register in (0, 1, 2, 3, 13, 14, 15)]
    assert [(one.register, one.value) for one in parse(bytes.fromhex("01000a07206000200150ff140400130d"))] == [
        *written, *asked
    ]  # fmt: skip
    frame = parse_frame(b"rcv 100 2404000a005000000170ff230d181400")
    assert (frame.source, frame.destination) == (1, 0)
    assert [one.value for one in parse(frame.data)] == [10, 80, 256, -144, 24, 20, 0]


def test_lines_with_check_sums() -> None:
    line = send_line(CanFrame(0x8001, b"\x01\x00\x0a"))
    assert without_check_sum(with_check_sum(line)) == (line, True)
    with pytest.raises(ValueError, match="wrong check sum"):
        without_check_sum(with_check_sum(line).replace(b"8001", b"8002"))


@pytest.fixture
def bus(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[MoteusServoBus]:
    """Of a world in which what a test is parametrized with is planted."""
    world = WorldSettings(
        pieces=(), home=(0.0, 0.075, 0.325), pace=Pace.REAL, cameras=False, linger=20.0, drives=DRIVES, moteus=SETTINGS,
        planted=getattr(request, "param", ()), realtime=True,
    )  # fmt: skip
    keep_settings(world, tmp_path)
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "app.cli", "world", "--run-dir", str(tmp_path)], env=os.environ
    )
    try:
        settings = SETTINGS.model_copy(update={"port": tmp_path / PORT})
        with real_time("the test", 80, serial=True):  # where the system grants it, as a controller has it
            one = as_soon_as_there(process, lambda: MoteusServoBus(DRIVES, settings, DRIVES.robot(load_parameters())))
            yield one
        one.close()
        one.close()
        with pytest.raises(BusLost):
            one.exchange(REST)
    finally:
        process.kill()
        process.wait()


def test_it_moves_brakes_and_its_watchdog_bites(bus: MoteusServoBus) -> None:
    for _ in range(50):
        said = bus.exchange(REST)
    assert said.status == DriveStatus.BRAKED
    for _ in range(20):  # once is enough, unless this process or the simulated one stumbles
        for _ in range(100):
            bus.exchange(REST)
        for _ in range(100):
            ready = bus.exchange(POWERED)
        moved = [bus.exchange(FREE) for _ in range(60)][-1]
        if moved.status == DriveStatus.ENABLED and max(map(abs, moved.velocity)) > 0.01:
            break
    assert ready.status & DriveStatus.ENABLED
    assert moved.status == DriveStatus.ENABLED
    assert max(map(abs, moved.velocity)) > 0.01
    time.sleep(20.0 * DRIVES.watchdog)
    assert bus.exchange(FREE).status == DriveStatus.WATCHDOG | DriveStatus.BRAKED
    for _ in range(100):
        said = bus.exchange(REST)
    assert said.status == DriveStatus.BRAKED
    assert max(map(abs, said.velocity)) < 0.05


@pytest.mark.parametrize(
    "bus", [(PlantedFault(kind=kind),) for kind in (PlantedKind.ENCODER_SIGN, PlantedKind.TORQUE_SIGN)], indirect=True
)
def test_a_motor_that_turns_the_wrong_way_does_not_run_away_while_its_brake_closes(bus: MoteusServoBus) -> None:
    """It is held by its own position loop until then, which pushes it on where a sign is wrong."""
    free = FREE._replace(torque=(0.0, 0.0, 0.0), finger_velocity=0.0)
    for _ in range(20):  # until this machine is not held up meanwhile
        before = [bus.exchange(POWERED) for _ in range(100)][-1]
        said = [bus.exchange(free)]
        while abs(said[-1].velocity[0]) < 0.1 and len(said) < 200:  # it takes the relay a moment
            said.append(bus.exchange(free))
        said += [bus.exchange(REST) for _ in range(300)]
        if not any(map(held_up, said)):
            break
    else:
        pytest.fail("this machine is held up again and again")
    after = said[-1]
    assert abs(after.velocity[0]) < 0.05
    assert max(abs(a - b) for a, b in zip(after.angle, before.angle, strict=True)) < 0.15
