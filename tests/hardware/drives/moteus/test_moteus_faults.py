"""Faults planted in emulated controllers at random moments: brakes, a device, a cause, a sentence, and the way back."""

from __future__ import annotations

import dataclasses
import math
import os
import random
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from hardware.drives.faults import DEVICES
from hardware.drives.moteus.bus import MoteusServoBus
from hardware.drives.moteus.settings import MoteusSettings, PinSettings
from hardware.drives.settings import DriveSettings
from hardware.interfaces import BusLost, Command, DriveStatus, DriveTrouble, HardwareError, Measurement, fault_of
from hardware.parameters import load_parameters
from hardware.realtime import real_time
from tests.hardware.bus_benches import held_up
from tests.hardware.drives.moteus.emulator import Emulator, emulated
from tests.waiting import until

pytestmark = pytest.mark.real_time

DRIVES = DriveSettings()
ROBOT = DRIVES.robot(load_parameters())
WITH_BRAKES = MoteusSettings(ids=(11, 12, 13, 14), brakes=PinSettings(id=14, aux=2, pin=1))
WITHOUT = WITH_BRAKES.model_copy(update={"brakes": None})
REST = Command((0.0, 0.0, 0.0), 0.0, brake=True, enable=False, busy=False)
HELD = Command((0.5, -0.5, 0.5), 0.0, brake=False, enable=True, busy=True)
ENDED = DriveStatus.FAULT | DriveStatus.WATCHDOG
LATER = 200
"""Exchanges after which a fault that is to be found must have been: any watch takes 20 ms and a few exchanges."""
ALL = 10**9
TIMES = int(os.environ.get("TOUCHMOVE_FAULT_ROUNDS", "2"))
"""Each fault is planted so often, on drawn devices at drawn moments."""


class Planted(NamedTuple):
    """A fault, and what is to be said of it."""

    attribute: str
    value: object
    trouble: DriveTrouble
    words: str
    gripper: bool = True
    """Whether the gripper can have it, too."""
    lasting: bool = True
    """Whether it is there, and seen, in drives that are disabled, too."""


FAULTS = {
    "lost": Planted("lost_replies", ALL, DriveTrouble.NO_REPLY, "4 exchanges in a row"),
    "silent": Planted("dead", True, DriveTrouble.NO_REPLY, "4 exchanges in a row"),
    "corrupt": Planted("corrupt_replies", ALL, DriveTrouble.WRONG_REPLY, "a line that describes no frame"),
    "hot": Planted("temperature", 91.0, DriveTrouble.TOO_HOT, "91 °C, at most 85 °C"),
    "sagged": Planted("voltage", 11.0, DriveTrouble.UNDER_VOLTAGE, "11.0 V, at least 12.0 V"),
    "surge": Planted("voltage", 46.0, DriveTrouble.OVER_VOLTAGE, "46.0 V, at most 44.0 V"),
    "jump": Planted("encoder_jump", 0.008, DriveTrouble.ENCODER_JUMPED, "0.0503 rad", gripper=False),
    "weak": Planted("torque_share", 0.0, DriveTrouble.TORQUE_NOT_FOLLOWED, "0.50 N m", gripper=False, lasting=False),
    "driver": Planted("code", 33, DriveTrouble.FAULT_CODE, "code 33: motor driver fault", lasting=False),
    "overheated": Planted("code", 38, DriveTrouble.TOO_HOT, "code 38: over temperature", lasting=False),
    "brown-out": Planted("code", 40, DriveTrouble.UNDER_VOLTAGE, "code 40: under voltage", lasting=False),
    "reset": Planted("reset", True, DriveTrouble.NOT_OPERATIONAL, "restart the controller", lasting=False),
}


@dataclasses.dataclass
class Bench:
    """A bus, and what plants faults behind it."""

    bus: MoteusServoBus
    told: list[str]
    emulator: Emulator
    settings: MoteusSettings

    def settle(self) -> None:
        """Disabled until all is well, then enabled and held; once more where this machine was held up meanwhile."""
        for _ in range(20):
            for _ in range(1000):
                if not self.bus.exchange(REST).status & ENDED:
                    break
            assert self.bus.fault is None, f"the fault does not go away: {self.told}"
            for _ in range(1000):
                said = self.bus.exchange(HELD)
                if said.status & ENDED:
                    break
                if said.status & DriveStatus.ENABLED and not said.status & DriveStatus.BRAKED:
                    return
            assert held_up(said), f"the drives do not follow: {said.status!r}, {self.told}"
        pytest.fail("this machine is held up again and again")

    def hold(self, exchanges: int) -> None:
        """Hold the arm."""
        for _ in range(exchanges):
            if held_up(self.bus.exchange(HELD)):
                self.settle()

    def until_fault(self) -> Measurement:
        for _ in range(LATER):
            said = self.bus.exchange(HELD)
            if said.status & ENDED:
                return said
        pytest.fail("the fault was not found")


@pytest.fixture(scope="module", params=["brakes", "none"])
def opened(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    settings = WITH_BRAKES if request.param == "brakes" else WITHOUT
    with emulated(tmp_path_factory.mktemp("moteus"), settings) as emulator:
        told: list[str] = []
        bus = MoteusServoBus(DRIVES, settings.model_copy(update={"port": emulator.port}), ROBOT, told.append)
        yield Bench(bus, told, emulator, settings)
        bus.close()


@pytest.fixture
def bench(opened: Bench) -> Iterator[Bench]:
    with real_time("the test", 80, serial=True):  # where the system grants it, as a controller has it
        opened.emulator.heal()
        opened.settle()
        yield opened


def found(bench: Bench, fault: Planted, rng: random.Random) -> bool:
    """Plant a fault on some device at some moment, see it found, told and braked, and mend it.

    False: this machine was held up meanwhile, and the fault came second.
    """
    bus, emulator = bench.bus, bench.emulator
    place = rng.randrange(4 if fault.gripper else 3)
    bench.hold(rng.randrange(1, 60))
    del bench.told[:]
    emulator.plant(fault.attribute, place, fault.value)
    said = bench.until_fault()
    if held_up(said):
        return False
    device = place + 1, fault.trouble
    assert fault_of(said.status) == device, bench.told
    assert said.status & DriveStatus.BRAKED
    assert not said.status & DriveStatus.ENABLED
    (sentence,) = bench.told
    assert sentence.startswith(DEVICES[place + 1])
    assert f"controller {bench.settings.ids[place]}: " in sentence
    assert fault.trouble.words in sentence
    assert fault.words in sentence
    for _ in range(60):  # it stays, whatever is commanded, and is told once
        assert fault_of(bus.exchange(HELD).status) == device
    if bench.settings.brakes is not None:
        until(lambda: not math.isnan(emulator.since().braked) and not math.isnan(emulator.since().idle), "braking")
    if fault.lasting:
        for _ in range(20):
            assert fault_of(bus.exchange(REST).status) == device, "its cause is still there"
    assert bench.told.count(sentence) == 1
    return True


@pytest.mark.parametrize("name", sorted(FAULTS))
def test_a_fault_brakes_and_is_told_and_ends(bench: Bench, name: str) -> None:
    rng, times = random.Random(name), 0
    for _ in range(10 * TIMES):
        times += found(bench, FAULTS[name], rng)
        bench.emulator.heal()
        bench.settle()
        if times == TIMES:
            return
    pytest.fail("this machine is held up again and again")


def test_a_fault_outlasts_replies_that_are_lost(bench: Bench) -> None:
    """Who is silent for a moment is not well yet: only an answer that tells of no cause clears a fault."""
    found, rng = 0, random.Random(6)
    for _ in range(20):
        place = rng.randrange(4)
        bench.emulator.plant("voltage", place, 11.0)
        if not held_up(bench.until_fault()):
            bench.emulator.plant("lost_replies", place, bench.settings.lost_replies)
            said = [bench.bus.exchange(REST) for _ in range(10)]
            assert {fault_of(one.status) for one in said} == {(place + 1, DriveTrouble.UNDER_VOLTAGE)}
            found += 1
        bench.emulator.heal()
        bench.settle()
        if found == TIMES:
            return
    pytest.fail("this machine is held up again and again")


def test_single_lost_and_corrupt_replies_are_no_fault(bench: Bench) -> None:
    rng = random.Random(5)
    for _ in range(20):
        what = rng.choice(["lost_replies", "corrupt_replies"])
        bench.emulator.plant(what, rng.randrange(4), rng.randrange(1, bench.settings.lost_replies + 1))
        said = [bench.bus.exchange(HELD) for _ in range(8)]
        if held_up(said[-1]):
            bench.settle()
            continue
        assert not said[-1].status & DriveStatus.FAULT, bench.told
        assert all(map(math.isfinite, (*said[0].angle, *said[0].velocity)))


def test_a_bus_on_which_nobody_answers_is_told_as_such(bench: Bench) -> None:
    for place in range(4):
        bench.emulator.plant("lost_replies", place, ALL)
    assert fault_of(bench.until_fault().status) == (0, DriveTrouble.NO_REPLY)
    assert "the bus does not answer (none of 4 controllers" in bench.told[-1]
    bench.emulator.heal()
    bench.settle()


def test_a_watchdog_that_does_not_bite_is_told(bench: Bench) -> None:
    bench.emulator.plant("watchdog_bites", 1, False)
    time.sleep(3.0 * DRIVES.watchdog)
    said = bench.bus.exchange(HELD)
    assert fault_of(said.status) == (2, DriveTrouble.WATCHDOG_DEAD)
    assert "limit 44 ms" in bench.told[-1]
    bench.emulator.heal()
    bench.settle()


def test_silence_bites_and_is_told_once(bench: Bench) -> None:
    del bench.told[:]
    time.sleep(3.0 * DRIVES.watchdog)
    since = bench.emulator.since()
    assert not math.isnan(since.idle)
    for _ in range(5):
        said = bench.bus.exchange(HELD)
        assert said.status == DriveStatus.WATCHDOG | DriveStatus.BRAKED
    (sentence,) = bench.told
    assert DriveTrouble.WATCHDOG_BIT.words in sentence
    bench.settle()


def test_an_unplugged_adapter_is_a_lost_bus(tmp_path: Path) -> None:
    with emulated(tmp_path, WITH_BRAKES) as emulator:
        bus = MoteusServoBus(DRIVES, WITH_BRAKES.model_copy(update={"port": emulator.port}), ROBOT, print)
        bus.exchange(REST)
        emulator.end()
        for _ in range(2):
            with pytest.raises(BusLost, match=r"the adapter at .*moteus is gone.*: check its plug"):
                bus.exchange(REST)
        bus.close()
        bus.close()


def test_what_is_no_number_is_a_fault_even_of_disabled_drives(bench: Bench) -> None:
    for command in (HELD, REST):
        said = bench.bus.exchange(command._replace(finger_velocity=math.nan))
        assert fault_of(said.status) == (0, DriveTrouble.NOT_FINITE)
        bench.settle()


# --------------------------------------------------------------------------------------------------------------- start


@pytest.fixture(scope="module")
def adapter(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Emulator]:
    with emulated(tmp_path_factory.mktemp("adapter"), WITH_BRAKES) as emulator:
        yield emulator


@pytest.fixture
def emulator(adapter: Emulator) -> Emulator:
    adapter.heal()
    return adapter


def start(emulator: Emulator, **also: object) -> MoteusServoBus:
    settings = WITH_BRAKES.model_copy(update={"port": emulator.port, **also})
    return MoteusServoBus(DRIVES, settings, ROBOT, print)


@pytest.mark.parametrize(
    ("attribute", "value", "words"),
    [
        ("dead", True, r"no controller with id 12 answers at .*moteus: check its power, the CAN cable, and its id"),
        ("corrupt_replies", ALL, r"no controller with id 12 answers at .* \(there was a line that describes no frame"),
        ("home_state", 0, r"controller 12 does not know its position after power-up: give it an absolute encoder"),
        ("encoder_jump", math.nan, r"controller 12 reports no position: check its encoder"),
        ("keeps", False, r"controller 12 has servo.default_timeout_s 0.1 after it was set to 0.044: update its firm"),
        ("stays", True, r"controller 12 does not start to work, it stays in mode 0: check its fault with moteus_tool"),
        ("watchdog_bites", False, r"the watchdog of controller 12 does not trip: 98 ms after .* in mode 10 instead of"),
    ],
)
def test_a_controller_that_is_not_as_it_has_to_be(
    emulator: Emulator, attribute: str, value: object, words: str
) -> None:
    if attribute == "keeps":
        emulator.plant("reset", 1, True)
    emulator.plant(attribute, 1, value)
    with pytest.raises(HardwareError, match=words):
        start(emulator)


def test_a_port_that_is_not_there(tmp_path: Path) -> None:
    nowhere = WITH_BRAKES.model_copy(update={"port": tmp_path / "tty"})
    with pytest.raises(HardwareError, match=r"the serial port .*tty cannot be opened \(No such file or directory\): c"):
        MoteusServoBus(DRIVES, nowhere, ROBOT, print)
    with pytest.raises(HardwareError, match=r"the adapter's port is not given: give drives\.moteus its port"):
        MoteusServoBus(DRIVES, WITH_BRAKES, ROBOT, print)


def test_a_port_that_another_program_has(emulator: Emulator) -> None:
    one = start(emulator)
    with pytest.raises(HardwareError, match="is not a serial port, or another program uses it"):
        start(emulator)
    one.close()
    start(emulator).close()


def test_a_controller_that_is_not_on_the_bus(emulator: Emulator) -> None:
    with pytest.raises(HardwareError, match="no controller with id 20 answers"):
        start(emulator, ids=(11, 12, 20, 14))


def test_first_answers_that_are_lost_are_asked_for_again(emulator: Emulator) -> None:
    bus = start(emulator)
    emulator.plant("lost_replies", 0, 2)
    said = bus.exchange(REST)
    assert said.angle == pytest.approx((0.1, 0.2, 0.3), abs=1e-6)
    assert said.status == DriveStatus.BRAKED
    bus.close()
    bus = start(emulator)
    emulator.plant("lost_replies", 0, ALL)
    with pytest.raises(BusLost, match="servomotor 1 does not answer"):
        bus.exchange(REST)
    bus.close()
