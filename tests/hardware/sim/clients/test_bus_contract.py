"""What every servo bus has to do: simulated drives in either pace, and in the thread of their controller."""

from __future__ import annotations

import itertools
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

from hardware.interfaces import BusLost, Command, DriveStatus, Measurement, Pace, ServoBus
from hardware.parameters import load_parameters
from hardware.sim.clients.bus import SimServoBus
from hardware.sim.process.inner_bus import InnerServoBus
from hardware.sim.process.server import World
from hardware.sim.process.settings import FILE_NAME, WorldSettings

PARAMETERS = load_parameters()
HOME = (0.0, 0.075, 0.325)
REST = Command((0.0, 0.0, 0.0), 0.0, brake=True, enable=False, busy=False)
POWERED = Command((0.0, 0.0, 0.0), 0.0, brake=True, enable=True, busy=True)
FREE = Command((1.0, 1.0, 1.0), 0.01, brake=False, enable=True, busy=True)
Open = Callable[[], ServoBus]


@pytest.fixture(scope="module", params=["fast", "real", "inside"])
def open_bus(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Open]:
    """Opens a bus of one kind anew."""
    worlds: list[subprocess.Popen[bytes]] = []
    opened = ExitStack()

    def start() -> ServoBus:
        run_dir: Path = tmp_path_factory.mktemp("bus")
        inside = request.param == "inside"
        pace = Pace.FAST if inside else Pace(request.param)
        settings = WorldSettings(pieces=(), home=HOME, pace=pace, cameras=False, linger=0.0)
        if inside:
            world = World(run_dir, settings)
            opened.enter_context(world.open())
            return InnerServoBus(world)
        (run_dir / FILE_NAME).write_text(settings.model_dump_json(), encoding="utf-8")
        worlds.append(
            subprocess.Popen(
                [sys.executable, "-P", "-m", "app.cli", "world", "--run-dir", str(run_dir)], env=os.environ
            )
        )
        return SimServoBus(run_dir)

    with opened:
        yield start
    for world in worlds:
        world.kill()
        world.wait()


@pytest.fixture
def bus(open_bus: Open) -> Iterator[ServoBus]:
    one = open_bus()
    yield one
    one.close()


def is_sound(said: Measurement) -> bool:
    numbers = (*said.angle, *said.velocity, said.finger_position, *said.tactile)
    kinds = all(type(number) is float for number in numbers) and type(said.tick) is int
    return kinds and isinstance(said.status, DriveStatus) and all(map(math.isfinite, numbers))


def test_it_says_its_period_and_whether_time_waits(bus: ServoBus) -> None:
    assert bus.period == PARAMETERS.drive.tick
    assert isinstance(bus.lockstep, bool)


def test_measurements_are_sound_and_ticks_go_on(bus: ServoBus) -> None:
    said = [bus.exchange(POWERED) for _ in range(200)]
    assert all(map(is_sound, said))
    steps = np.diff([one.tick for one in said])
    assert (steps >= 0).all()
    assert steps.sum() > 0
    for before, after in itertools.pairwise(said):
        stood = after.tick == before.tick
        assert stood == bool(after.status & DriveStatus.STANDING), "only a plant that stands repeats a tick"
    if bus.lockstep:
        assert steps.max() == 1


def test_drives_that_are_not_enabled_stand_on_their_brakes(bus: ServoBus) -> None:
    for _ in range(50):
        said = bus.exchange(REST)
    assert said.status & DriveStatus.BRAKED
    assert not said.status & (DriveStatus.ENABLED | DriveStatus.FAULT)
    assert max(map(abs, said.velocity)) < 0.05


def test_after_close_it_is_lost_and_a_second_close_does_nothing(open_bus: Open) -> None:
    bus = open_bus()
    bus.exchange(REST)
    bus.close()
    bus.close()
    with pytest.raises(BusLost):
        bus.exchange(REST)


# --------------------------------------------------------------------------------- what only drives that move can do


def test_a_command_acts_and_brakes_end_it(bus: ServoBus) -> None:
    for _ in range(20):  # once is enough, unless this process stumbles and the watchdog of drives in real time bites
        bus.exchange(REST)
        moved = [bus.exchange(FREE) for _ in range(60)][-1]
        if not moved.status & DriveStatus.WATCHDOG:
            break
    assert moved.status & DriveStatus.ENABLED
    assert not moved.status & DriveStatus.BRAKED
    assert max(map(abs, moved.velocity)) > 0.01
    for _ in range(400):
        rested = bus.exchange(POWERED)
    assert rested.status & DriveStatus.BRAKED
    assert max(map(abs, rested.velocity)) < 0.01
    assert rested.finger_position > moved.finger_position - 1e-3


def test_what_is_no_number_is_a_fault_on_the_brakes_until_disabled(bus: ServoBus) -> None:
    bus.exchange(POWERED)
    for _ in range(20):
        said = bus.exchange(FREE._replace(torque=(math.nan, 0.0, 0.0)))
    assert said.status & DriveStatus.FAULT
    assert said.status & DriveStatus.BRAKED
    for _ in range(20):
        said = bus.exchange(REST)
    assert not said.status & DriveStatus.FAULT


def test_a_torque_beyond_the_peak_is_cut_and_said_to_be(bus: ServoBus) -> None:
    peak = PARAMETERS.drive.peak_torque
    said = [bus.exchange(POWERED._replace(torque=(2.0 * peak, 0.0, 0.0))) for _ in range(20)]
    assert said[-1].status & DriveStatus.SATURATED


def test_silence_brakes_drives_whose_time_goes_on(bus: ServoBus) -> None:
    if bus.lockstep:
        pytest.skip("its time waits")
    for _ in range(20):
        bus.exchange(FREE)
    time.sleep(20.0 * PARAMETERS.drive.watchdog_ticks * bus.period)
    said = bus.exchange(FREE)
    assert said.status & DriveStatus.WATCHDOG
    assert said.status & DriveStatus.BRAKED
