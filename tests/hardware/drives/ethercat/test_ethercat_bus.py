"""EtherCAT drives through pysoem's master and a virtual cable: what a bus has to do, and how it fails.

Only what needs no faults planted in the other process is here; the emulated slaves have tests of their own.
"""

from __future__ import annotations

import functools
import math
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from hardware.drives.ethercat import al_status
from hardware.drives.ethercat.bus import EtherCatServoBus
from hardware.drives.ethercat.network import Network, load_pysoem
from hardware.drives.ethercat.settings import Device, EtherCatSettings
from hardware.drives.settings import DriveSettings, ForceSettings, JointSettings
from hardware.interfaces import BusLost, Command, DriveStatus, DriveTrouble, HardwareError, Pace
from hardware.parameters import RobotParameters, load_parameters
from hardware.realtime import real_time
from hardware.sim.emulated.ethercat import namespace
from hardware.sim.process.settings import WorldSettings, keep_settings
from tests.hardware.drives.ethercat.privileges import require_privileges

pytestmark = pytest.mark.real_time

DRIVES = DriveSettings(
    joints=(JointSettings(encoder_bits=22, sign=-1, offset=0.3), JointSettings(encoder_bits=22), JointSettings()),
    forces=(ForceSettings(gain=5.0), ForceSettings(gain=-5.0, zero=4.0)),
)
ROBOT = DRIVES.robot(load_parameters())
REST = Command((0.0, 0.0, 0.0), 0.0, brake=True, enable=False, busy=False)
POWERED = Command((0.0, 0.0, 0.0), 0.0, brake=True, enable=True, busy=True)
SYNC_MANAGER_0_ACTIVATE = 0x0806
"""Register of an EtherCAT slave: whether its first mailbox is there (ETG.1000.4)."""
FREE = Command((1.0, 1.0, 1.0), 0.01, brake=False, enable=True, busy=True)


class Opened(NamedTuple):
    """A bus, the process behind it, what it has told, and how often something was lost while it was set up."""

    bus: EtherCatServoBus
    world: int
    told: list[str]
    lost: int


@pytest.fixture(scope="module", params=["generic", "mr-j4-tm"])
def opened(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Opened]:
    require_privileges()
    run_dir: Path = tmp_path_factory.mktemp("ethercat")
    settings = EtherCatSettings(interface=namespace.MASTER_END, preset=request.param)
    world = WorldSettings(
        pieces=(), home=(0.0, 0.075, 0.325), pace=Pace.REAL, cameras=False, linger=20.0, drives=DRIVES,
        ethercat=settings, realtime=True,
    )  # fmt: skip
    keep_settings(world, run_dir)
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "hardware.sim.emulated.ethercat.process", str(run_dir)], env=os.environ
    )
    try:
        pid, told, lost = namespace.network_pid(run_dir), list[str](), list[str]()
        sizes, set_out = Network._check_sizes, Network._configure

        def first_is_lost(network: Network) -> None:
            if len(lost) < 2:
                lost.append("a frame")
                raise load_pysoem().WkcError
            sizes(network)

        def without_a_mailbox(network: Network, robot: RobotParameters) -> None:
            if not lost:
                lost.append("a frame with a sync manager")
                slave = network._slave(Device.FORCES)
                for state in (al_status.INIT, al_status.PREOP):
                    slave._fpwr(SYNC_MANAGER_0_ACTIVATE, b"\0")
                    slave.state = state
                    slave.write_state()
            set_out(network, robot)

        deadline = time.monotonic() + 60.0
        while True:
            try:
                enter = functools.partial(namespace.within_network, pid)
                lost.clear()  # each start loses two frames, and ends well once the world is there
                with pytest.MonkeyPatch.context() as patched:
                    patched.setattr(Network, "_configure", without_a_mailbox)
                    patched.setattr(Network, "_check_sizes", first_is_lost)
                    bus = EtherCatServoBus(settings, DRIVES, ROBOT, enter, told.append)
                break
            except HardwareError:  # the world is not there yet
                if time.monotonic() > deadline or process.poll() is not None:
                    raise
                time.sleep(0.1)
        with real_time("the test", 80):  # where the system grants it, as a controller has it
            yield Opened(bus, process.pid, told, len(lost))
        bus.close()
        bus.close()
        with pytest.raises(BusLost, match="given up"):
            bus.exchange(REST)
    finally:
        process.kill()
        process.wait()


@pytest.fixture
def bus(opened: Opened) -> EtherCatServoBus:
    """Disabled, without a fault."""
    settle(opened.bus)
    return opened.bus


def settle(bus: EtherCatServoBus) -> None:
    for _ in range(2000):
        said = bus.exchange(REST)
        if not said.status & (DriveStatus.FAULT | DriveStatus.WATCHDOG) and max(map(abs, said.velocity)) < 0.01:
            return
    pytest.fail("it does not come to rest")


def run(bus: EtherCatServoBus, command: Command, status: DriveStatus) -> bool:
    """Whether a status is reached within a second or so."""
    return any(bus.exchange(command).status & status == status for _ in range(1000))


def test_what_was_lost_during_set_up_costs_nothing(opened: Opened, bus: EtherCatServoBus) -> None:
    assert opened.lost == 2
    assert bus.exchange(REST).status & DriveStatus.BRAKED


def test_disabled_drives_stand_on_their_brakes(bus: EtherCatServoBus) -> None:
    said = bus.exchange(REST)
    assert said.status & DriveStatus.BRAKED
    assert not said.status & (DriveStatus.ENABLED | DriveStatus.FAULT)
    assert all(map(math.isfinite, (*said.angle, *said.velocity, said.finger_position, *said.tactile)))
    assert bus.exchange(REST).tick > said.tick


def test_scales_are_undone_so_that_the_arm_is_where_the_plant_put_it(bus: EtherCatServoBus) -> None:
    said = bus.exchange(REST)
    assert said.angle[1] == pytest.approx(said.angle[2], abs=0.3)
    assert max(map(abs, said.angle)) < 1.6
    assert said.tactile == pytest.approx((0.0, 0.0), abs=0.01)


def test_a_command_acts_and_brakes_end_it(bus: EtherCatServoBus) -> None:
    assert run(bus, POWERED, DriveStatus.ENABLED | DriveStatus.BRAKED)
    before = bus.exchange(POWERED)
    for _ in range(60):
        moved = bus.exchange(FREE)
    assert max(a - b for a, b in zip(moved.angle, before.angle, strict=True)) > 0.005
    assert moved.finger_position > before.finger_position
    for _ in range(600):
        rested = bus.exchange(POWERED)
    assert rested.status & DriveStatus.BRAKED
    assert max(map(abs, rested.velocity)) < 0.01


def test_what_is_no_number_is_a_fault_until_disabled(opened: Opened, bus: EtherCatServoBus) -> None:
    assert run(bus, FREE._replace(torque=(math.nan, 0.0, 0.0)), DriveStatus.FAULT | DriveStatus.BRAKED)
    assert bus.fault is not None
    assert bus.fault.trouble is DriveTrouble.NOT_FINITE
    assert "not a number" in opened.told[-1]
    settle(bus)


def test_a_torque_beyond_the_peak_is_cut_and_said_to_be(bus: EtherCatServoBus) -> None:
    assert run(bus, POWERED, DriveStatus.ENABLED)
    assert run(bus, POWERED._replace(torque=(20.0, 0.0, 0.0)), DriveStatus.SATURATED)


def test_silence_brakes_and_is_told_and_disabling_ends_it(opened: Opened, bus: EtherCatServoBus) -> None:
    assert run(bus, POWERED, DriveStatus.ENABLED)
    time.sleep(0.5)
    said = bus.exchange(POWERED)
    assert said.status & DriveStatus.WATCHDOG
    assert said.status & DriveStatus.BRAKED
    assert "limit 44 ms" in opened.told[-1]
    settle(bus)
    assert run(bus, POWERED, DriveStatus.ENABLED)
