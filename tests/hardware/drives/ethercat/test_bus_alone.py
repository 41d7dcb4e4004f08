"""The EtherCAT bus by itself: drives that follow at once, on a cable without frames, and a clock that is a number."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from hardware.drives import clock
from hardware.drives.ethercat import al_status, bus
from hardware.drives.ethercat.axis import Facts
from hardware.drives.ethercat.bus import LIFT_EVERY, EtherCatServoBus
from hardware.drives.ethercat.network import Health
from hardware.drives.ethercat.presets import DRIVE_INPUTS, TERMINAL_INPUTS
from hardware.drives.ethercat.settings import ARMS, Device, EtherCatSettings
from hardware.drives.settings import DriveSettings, VelocitySource
from hardware.interfaces import Command, DriveStatus, DriveTrouble, Measurement, fault_of
from hardware.parameters import load_parameters

DRIVES = DriveSettings()
COUNTS = 1 << DRIVES.joints[0].encoder_bits
REST = Command((0.0, 0.0, 0.0), 0.0, brake=True, enable=False, busy=False)
RUN = Command((0.0, 0.0, 0.0), 0.0, brake=False, enable=True, busy=True)
DISABLED, READY, SWITCHED_ON, ENABLED = 0x40, 0x21, 0x23, 0x27
"""Status words of a drive without a fault."""
FOLLOWED = {0x06: READY, 0x07: SWITCHED_ON, 0x0F: ENABLED}
"""Status words that follow from control words."""


class Cable:
    """All devices, and what a test makes of them; takes the place of ``Network``."""

    expected = len(ARMS)
    reference_time = 0

    def __init__(self, settings: EtherCatSettings, *_: object) -> None:
        self.facts = {device: Facts(COUNTS, 2.4, math.tau / COUNTS) for device in (*ARMS, Device.GRIPPER)}
        self.off = False
        """STO: no servomotor is given power."""
        self.angle = self.velocity = 0.0
        """Of the first servomotor [rad, rad/s]."""
        self.gone: Device | None = None
        self.asked = 0
        """How often all devices were asked for their state."""
        self._chain = settings.chain
        self._control = dict.fromkeys(self.facts, 0)
        self._inputs = {Device.FORCES: bytes(TERMINAL_INPUTS.packed.size)}

    def output(self, device: Device, data: bytes) -> None:
        self._control[device] = int.from_bytes(data[:2], "little")

    def input(self, device: Device) -> bytes:
        return self._inputs[device]

    def send(self) -> None:
        """Inputs of whoever is gone stay what they were, as a master's do."""
        for device, control in self._control.items():
            word = DISABLED if self.off and device in ARMS else FOLLOWED.get(control & 0x7F, DISABLED)
            first = device is ARMS[0]
            angle, velocity = (self.angle, self.velocity) if first else (0.0, 0.0)
            counts = round(angle / math.tau * COUNTS), round(velocity / math.tau * COUNTS)
            if device is not self.gone:
                self._inputs[device] = DRIVE_INPUTS.packed.pack(word, *counts, 0, 0)

    def receive(self, patience: float) -> int:
        assert patience > 0.0
        return self.expected - (self.gone is not None)

    def health(self) -> list[Health]:
        self.asked += 1
        states = [0 if device is self.gone else al_status.OP for device in self._chain]
        return [
            Health(device, place, state, 0)
            for place, (device, state) in enumerate(zip(self._chain, states, strict=True))
        ]

    def lift(self, one: Health) -> None:
        raise AssertionError(f"{one} is in OP")


class Bench:
    """A bus, the cable behind it, what it has told, and its computer's clock, on which a look takes 1 µs [s]."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, **joint: Any) -> None:
        self.now, self.told = 1000.0, list[str]()
        time = SimpleNamespace(monotonic=self._look, sleep=self._sleep)
        monkeypatch.setattr(clock, "time", time)
        monkeypatch.setattr(bus, "time", time)
        monkeypatch.setattr(bus, "Network", Cable)
        joints = tuple(one.model_copy(update=joint) for one in DRIVES.joints)
        drives = DRIVES.model_copy(update={"joints": joints})
        settings = EtherCatSettings(distributed_clocks=False)
        self.bus = EtherCatServoBus(settings, drives, drives.robot(load_parameters()), tell=self.told.append)
        cable = self.bus._network
        assert isinstance(cable, Cable)
        self.cable = cable

    def _look(self) -> float:
        self.now += 1e-6
        return self.now

    def _sleep(self, seconds: float) -> None:
        self.now += seconds

    def exchange(self, command: Command, times: int = 1) -> Measurement:
        """So many exchanges in which the first servomotor goes on turning; the last one's measurement."""
        for _ in range(times):
            self.cable.angle += self.cable.velocity * DRIVES.period
            said = self.bus.exchange(command)
        return said

    def run(self) -> None:
        """All drives follow their torque."""
        assert self.exchange(RUN, 20).status == DriveStatus.ENABLED
        assert not self.told


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    one = Bench(monkeypatch)
    one.run()
    return one


def test_drives_that_lose_their_power_without_a_fault_do_not_start_again_by_themselves(bench: Bench) -> None:
    """An E-stop's contact that bounces: its reset must not start anything."""
    bench.cable.off = True
    said = bench.exchange(RUN)
    assert fault_of(said.status) == (1, DriveTrouble.NOT_OPERATIONAL)
    assert said.status & DriveStatus.BRAKED
    assert bench.told == [
        "servomotor 1 has left its operating state (it is in 'Switch on disabled' without a fault, as after STO or an "
        "E-stop; device 1 on the cable): check its own diagnosis, then clear the fault"
    ]
    bench.cable.off = False
    for _ in range(50):
        assert bench.exchange(RUN).status & (DriveStatus.FAULT | DriveStatus.BRAKED) == (
            DriveStatus.FAULT | DriveStatus.BRAKED
        )
    bench.exchange(REST, 2)
    assert bench.exchange(RUN, 20).status == DriveStatus.ENABLED, "somebody has cleared it"


def test_drives_that_do_not_begin_to_run_are_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """A power stage takes some tenths of a second."""
    bench = Bench(monkeypatch)
    bench.cable.off = True
    assert not bench.exchange(RUN, 900).status & DriveStatus.FAULT
    said = bench.exchange(RUN, 200)
    assert fault_of(said.status) == (1, DriveTrouble.NOT_OPERATIONAL)
    assert "it has stayed in 'Switch on disabled' for 1.0 s" in bench.told[0]


def test_what_lasts_is_told_once_and_nobody_is_asked_about_it_in_every_exchange(bench: Bench) -> None:
    bench.cable.angle += 0.3
    said = bench.exchange(RUN)
    jumped = fault_of(said.status)
    assert jumped == (1, DriveTrouble.ENCODER_JUMPED)
    bench.cable.asked = 0
    for _ in range(500):
        assert fault_of(bench.exchange(REST).status) == jumped
    assert len(bench.told) == 1
    assert bench.cable.asked <= 500 * DRIVES.period / LIFT_EVERY + 1
    bench.cable.angle -= 0.3
    assert fault_of(bench.exchange(REST).status) == jumped, "it has jumped back in this exchange"
    assert not bench.exchange(REST, 2).status & DriveStatus.FAULT
    assert len(bench.told) == 1


def test_what_is_no_number_is_told_once_while_it_lasts(bench: Bench) -> None:
    said = bench.exchange(REST._replace(torque=(math.nan, 0.0, 0.0)), 50)
    assert fault_of(said.status) == (0, DriveTrouble.NOT_FINITE)
    assert len(bench.told) == 1
    assert not bench.exchange(REST, 2).status & DriveStatus.FAULT


@pytest.mark.parametrize("velocity", VelocitySource)
def test_a_drive_that_is_lost_while_it_turns_is_not_said_to_turn_for_ever(
    monkeypatch: pytest.MonkeyPatch, velocity: VelocitySource
) -> None:
    bench = Bench(monkeypatch, velocity=velocity)
    bench.run()
    bench.cable.velocity = 3.0
    assert bench.exchange(RUN, 20).velocity[0] == pytest.approx(3.0, rel=0.01)
    bench.cable.gone = ARMS[0]
    said = bench.exchange(RUN)
    assert fault_of(said.status) == (1, DriveTrouble.NO_REPLY)
    assert said.velocity == (0.0, 0.0, 0.0)
    lost = said.angle
    assert bench.exchange(REST, 200)[1:3] == (lost, (0.0, 0.0, 0.0))
    bench.cable.gone = None
    said = bench.exchange(REST)
    assert said.angle[0] > lost[0] + 0.5, "it is asked again"
    assert said.velocity[0] == pytest.approx(3.0, rel=0.1)
    assert not bench.exchange(REST, 50).status & DriveStatus.FAULT
    assert len(bench.told) == 1
