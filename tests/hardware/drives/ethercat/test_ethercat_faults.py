"""Faults planted in emulated slaves, and what the bus makes of them: brakes, a device, a cause, and the way back."""

from __future__ import annotations

import functools
import multiprocessing
import os
import select
import time
from collections.abc import Iterator
from multiprocessing.connection import Connection
from typing import NamedTuple

import pytest

from hardware.drives.ethercat.bus import EtherCatServoBus
from hardware.drives.ethercat.settings import Device, EtherCatSettings
from hardware.drives.settings import DriveSettings
from hardware.interfaces import BusLost, Command, DriveStatus, DriveTrouble, Measurement, fault_of
from hardware.parameters import load_parameters
from hardware.sim.emulated.ethercat import namespace
from hardware.sim.emulated.ethercat.devices import EtherCatDevices
from hardware.sim.emulated.plant_drives import MotorState
from tests.hardware.drives.ethercat.privileges import require_privileges

SETTINGS, DRIVES = EtherCatSettings(interface=namespace.MASTER_END), DriveSettings()
ROBOT = DRIVES.robot(load_parameters())
REST = Command((0.0, 0.0, 0.0), 0.0, brake=True, enable=False, busy=False)
HELD = Command((0.5, 0.5, 0.5), 0.0, brake=False, enable=True, busy=True)


def emulate(control: Connection) -> None:
    """Slaves whose motors never turn, with faults planted as they are asked for."""
    namespace.make_network()
    devices = EtherCatDevices(SETTINGS, DRIVES, ROBOT, namespace.SLAVES_END)
    still = MotorState(0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, (0.0, 0.0))
    devices.sense(still)
    control.send(os.getpid())
    while True:
        ready = select.select([*devices.numbers, control], [], [], 0.001)[0]
        if control in ready:
            name, argument = control.recv()
            if name == "end":
                return
            PLANTED[name](devices, argument)
            control.send(None)
        if len(ready) > (control in ready):
            devices.hear()
        devices.act(time.monotonic())
        devices.sense(still)


def cut(devices: EtherCatDevices, reach: int) -> None:
    devices.segment.reach = reach
    devices.segment.link_up()


PLANTED = {
    "code": lambda devices, code: devices.drives[1].fault(code),
    "drop": lambda devices, code: devices.slaves[Device.ARM2].drop(4, code),
    "reach": cut,
    "link": lambda _devices, up: namespace.set_link(namespace.SLAVES_END, up=up),
    "jump": lambda devices, angle: setattr(devices.drives[1].flaws, "jump", angle),
    "follows": lambda devices, share: setattr(devices.drives[1].flaws, "follows", share),
    "bites": lambda devices, bites: setattr(devices.slaves[Device.ARM2], "bites", bites),
    "biased": lambda devices, more: setattr(devices.slaves[Device.ARM2], "biased", more),
    "lose": lambda devices, frames: setattr(devices.segment, "losing", frames),
    "damage": lambda devices, frames: (
        setattr(devices.segment, "damaged_before", 1), setattr(devices.segment, "damaging", frames),
    ),
}  # fmt: skip


class Bench(NamedTuple):
    """A bus, and what plants faults behind it."""

    bus: EtherCatServoBus
    told: list[str]
    control: Connection

    def plant(self, name: str, argument: object) -> None:
        self.control.send((name, argument))
        self.control.recv()

    def settle(self) -> None:
        """Disabled until all is well, then enabled and held."""
        for _ in range(3000):
            if not self.bus.exchange(REST).status & (DriveStatus.FAULT | DriveStatus.WATCHDOG):
                break
        else:
            pytest.fail(f"the fault does not go away: {self.told}")
        for _ in range(1000):
            said = self.bus.exchange(HELD)
            if said.status & DriveStatus.ENABLED and not said.status & DriveStatus.BRAKED:
                return
        pytest.fail(f"the drives do not follow: {said.status!r}, {self.told}")

    def until_fault(self, exchanges: int = 1000) -> Measurement:
        for _ in range(exchanges):
            said = self.bus.exchange(HELD)
            if said.status & (DriveStatus.FAULT | DriveStatus.WATCHDOG):
                for _ in range(3):  # one to tell the drives, one to hear of it
                    said = self.bus.exchange(HELD)
                return said
        pytest.fail("the fault was not found")


@pytest.fixture
def bench() -> Iterator[Bench]:
    require_privileges()
    context = multiprocessing.get_context("spawn")
    control, theirs = context.Pipe()
    process = context.Process(target=emulate, args=(theirs,), daemon=True)
    process.start()
    assert control.poll(60.0), "the emulator does not start"
    pid, told = control.recv(), list[str]()
    bus = EtherCatServoBus(SETTINGS, DRIVES, ROBOT, functools.partial(namespace.within_network, pid), told.append)
    one = Bench(bus, told, control)
    one.settle()
    yield one
    control.send(("end", None))
    bus.close()
    process.join(10.0)
    process.kill()


@pytest.mark.parametrize(
    ("name", "argument", "undo", "device", "trouble", "words"),
    [
        ("code", 0x4310, None, 2, DriveTrouble.TOO_HOT, "0x4310"),
        ("code", 0x3220, None, 2, DriveTrouble.UNDER_VOLTAGE, "0x3220"),
        ("drop", 0x001A, None, 2, DriveTrouble.NOT_OPERATIONAL, "synchronisation error"),
        ("reach", 1, 6, 2, DriveTrouble.NO_REPLY, "device 2"),
        ("jump", 0.05, 0.0, 2, DriveTrouble.ENCODER_JUMPED, "0.0500 rad"),
        ("follows", 0.0, 1.0, 2, DriveTrouble.TORQUE_NOT_FOLLOWED, "asked for 0.50 N m"),
        ("biased", -1, 0, 0, DriveTrouble.WRONG_REPLY, "working counter"),
    ],
)
def test_a_fault_brakes_and_is_told_and_ends(
    bench: Bench, name: str, argument: object, undo: object, device: int, trouble: DriveTrouble, words: str
) -> None:
    bench.plant(name, argument)
    said = bench.until_fault()
    assert fault_of(said.status) == (device, trouble)
    assert said.status & DriveStatus.BRAKED
    assert words in bench.told[-1]
    if undo is not None:
        bench.plant(name, undo)
    bench.settle()


def test_a_frame_that_is_lost_is_a_tick_that_is_missed(bench: Bench) -> None:
    before = bench.bus.exchange(HELD)
    lost = bench.bus.lost
    bench.plant("lose", 2)
    said = [bench.bus.exchange(HELD) for _ in range(20)]
    assert bench.bus.lost >= lost + 2
    assert not said[-1].status & DriveStatus.FAULT
    assert said[-1].tick - before.tick >= 22


def test_damaged_frames_are_a_fault_of_the_cable_before_the_device_that_counts_them(bench: Bench) -> None:
    for _ in range(20):
        bench.plant("damage", 3)
        for _ in range(3):
            said = bench.bus.exchange(HELD)
    assert fault_of(said.status) == (2, DriveTrouble.FRAMES_LOST)
    assert "device 2" in bench.told[-1]


def test_a_pulled_cable_is_a_lost_bus(bench: Bench) -> None:
    bench.plant("link", False)
    with pytest.raises(BusLost, match="no EtherCAT frame has come back"):
        bench.until_fault()
    bench.plant("link", True)


def test_a_watchdog_that_does_not_bite_is_told(bench: Bench) -> None:
    bench.plant("bites", False)
    time.sleep(0.3)
    said = bench.bus.exchange(HELD)
    assert fault_of(said.status) == (2, DriveTrouble.WATCHDOG_DEAD)
    bench.plant("bites", True)
    bench.settle()
