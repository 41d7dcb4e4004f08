"""Faults at random moments in emulated slaves while the arm moves under torque: brakes, device, cause, the way back.

Each fault is planted by the world's process while the driver runs, at any phase of the bus's cycle; that process also
says when the brakes closed and when the arm was at rest. One bus goes through all of them.
"""

from __future__ import annotations

import contextlib
import functools
import math
import os
import random
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import pytest

from hardware.drives.ethercat.bus import EtherCatServoBus
from hardware.drives.ethercat.settings import EtherCatSettings
from hardware.drives.settings import DriveSettings
from hardware.interfaces import BusLost, Command, DriveStatus, DriveTrouble, HardwareError, Measurement, Pace, fault_of
from hardware.parameters import load_parameters
from hardware.realtime import real_time
from hardware.sim.emulated.ethercat import namespace
from hardware.sim.process.settings import WorldSettings, keep_settings
from tests.hardware.bus_benches import OF_TIME, HeldUp
from tests.hardware.drives.ethercat.privileges import require_privileges

pytestmark = pytest.mark.real_time

ROOT = Path(__file__).parents[4]
DRIVES, CABLE = DriveSettings(), EtherCatSettings(interface=namespace.MASTER_END)
ROBOT = DRIVES.robot(load_parameters())
WATCHDOG = DRIVES.watchdog
REST = Command((0.0, 0.0, 0.0), 0.0, brake=True, enable=False, busy=False)
POWERED = REST._replace(enable=True, busy=True)
ILL = DriveStatus.FAULT | DriveStatus.WATCHDOG
ARMS = ("arm1", "arm2", "arm3")
ROUNDS = int(os.environ.get("TOUCHMOVE_FAULT_ROUNDS", "1"))
"""Of each fault; the tests' own time for 20 is some minutes."""
T = TypeVar("T")
STIFFNESS, DAMPING = 30.0, 0.8
"""Of the joints [N m/rad, N m s/rad]: enough to move the arm, no more is wanted here."""
SWING, TURN = 0.15, 6.0
"""Amplitude [rad] and angular frequency [rad/s] of each joint's motion: 0.9 rad/s at most."""
SLACK = 0.010
"""Within which a frame, a tick and this program's next turn come [s]."""
TRIES = 20
"""Of what a busy machine disturbs."""
STOPPING = 0.100
"""Within which closed brakes stop the arm from that motion [s]."""


class Fault(NamedTuple):
    """One to be planted, and what has to come of it."""

    found: tuple[int, DriveTrouble] | None
    """Device and trouble; None: the bus is lost, which is an exception."""
    words: str
    """In the sentence."""
    plant: tuple[Any, ...]
    mend: tuple[Any, ...] | None = None
    silence: float = 0.0
    """The driver's own process is held up for so long [s]."""
    within: float = WATCHDOG + SLACK
    """Brakes are closed [s]."""


class Report(NamedTuple):
    """What the plant has seen since the last fault (``time.monotonic``) [s]; 0: it has not come yet."""

    planted: float
    braked: float
    rested: float
    speed: float
    """Of the fastest servomotor at the fault [rad/s]."""


class Outcome(NamedTuple):
    """What came of it."""

    found: tuple[int, DriveTrouble] | None
    sentence: str
    report: Report


def of_code(kind: str, trouble: DriveTrouble, words: str) -> Callable[[random.Random], Fault]:
    def draw(rng: random.Random) -> Fault:
        number = rng.randint(1, 4)
        return Fault((number, trouble), words, ("device", kind, number, 0.0), ("mended", kind, number))

    return draw


def lost(rng: random.Random) -> Fault:
    """Every fourth frame: it is a fault once more than a tenth of 500 are gone."""
    return Fault((0, DriveTrouble.FRAMES_LOST), "frames did not come back", ("lose", rng.uniform(0.2, 0.3), None),
                 ("lose", 0.0, None), within=0.6)  # fmt: skip


def damaged(rng: random.Random) -> Fault:
    place = rng.randint(0, 3)
    return Fault((place + 1, DriveTrouble.FRAMES_LOST), f"device {place + 1} on the cable has counted",
                 ("lose", rng.uniform(0.2, 0.3), place), ("lose", 0.0, None), within=0.6)  # fmt: skip


def burst(rng: random.Random) -> Fault:
    """No frame for longer than the watchdog."""
    return Fault(None, "no EtherCAT frame", ("burst", rng.uniform(0.1, 0.2)))


def dropped(rng: random.Random) -> Fault:
    device = rng.choice([*ARMS, "gripper", "forces"])
    number = [*ARMS, "gripper", "forces"].index(device) + 1
    return Fault((number, DriveTrouble.NOT_OPERATIONAL), "SAFE-OP, synchronisation error", ("drop", device),
                 within=0.3 if device == "forces" else Fault._field_defaults["within"])  # fmt: skip


def jumped(rng: random.Random) -> Fault:
    number, angle = rng.randint(1, 3), rng.choice((-1, 1)) * rng.uniform(0.02, 0.5)
    return Fault((number, DriveTrouble.ENCODER_JUMPED), "is possible", ("jump", number, angle), ("jump", number, 0.0))


def unfollowed(rng: random.Random) -> Fault:
    """It is seen where torque is asked for: an arm that swings asks for little twice in a second."""
    number = rng.randint(1, 3)
    return Fault((number, DriveTrouble.TORQUE_NOT_FOLLOWED), "it reports", ("device", "not-followed", number, 0.0),
                 ("mended", "not-followed", number), within=0.6)  # fmt: skip


def undying(rng: random.Random) -> Fault:
    number = rng.randint(1, 3)
    return Fault((number, DriveTrouble.WATCHDOG_DEAD), "ms without a frame", ("device", "watchdog-dead", number, 0.0),
                 ("mended", "watchdog-dead", number), silence=rng.uniform(0.1, 0.2))  # fmt: skip


def unplugged(rng: random.Random) -> Fault:
    return Fault(None, "no EtherCAT frame", ("link", False), ("link", True))


def cut(rng: random.Random) -> Fault:
    """Between two devices: whoever stands behind does not answer."""
    place = rng.randint(1, 5)
    number = (1, 2, 3, 4, 0, 5)[place]  # a coupler is none of the robot's devices, so the bus is named
    return Fault((number, DriveTrouble.NO_REPLY), f"device {place + 1} on the cable", ("cut", place),
                 ("cut", len(CABLE.chain)))  # fmt: skip


def miscounted(rng: random.Random) -> Fault:
    device, more = rng.choice([*ARMS, "gripper", "forces"]), rng.choice((-1, 1))
    return Fault((0, DriveTrouble.WRONG_REPLY), "working counter", ("bias", device, more), ("bias", device, 0))


def late(rng: random.Random) -> Fault:
    return Fault((0, DriveTrouble.WATCHDOG_BIT), "limit 44 ms", ("nothing",), silence=rng.uniform(0.08, 0.3))


FAULTS: dict[str, Callable[[random.Random], Fault]] = {
    "too hot": of_code("too-hot", DriveTrouble.TOO_HOT, "0x4310"),
    "under-voltage": of_code("under-voltage", DriveTrouble.UNDER_VOLTAGE, "0x3220"),
    "drops to SAFE-OP": dropped,
    "lost frames": lost,
    "frames lost in a row": burst,
    "corrupt frames": damaged,
    "encoder jumps": jumped,
    "torque not followed": unfollowed,
    "watchdog does not bite": undying,
    "cable pulled": unplugged,
    "cable cut between devices": cut,
    "working counter wrong": miscounted,
    "late cycle": late,
}


class Bench:
    """A bus, and what plants faults behind it."""

    def __init__(self, bus: EtherCatServoBus, told: list[str], control: Connection) -> None:
        self.bus, self.told, self.control = bus, told, control
        said = bus.exchange(REST)
        self._centre, self._began = said.angle, said.tick

    def swing(self, said: Measurement) -> Measurement:
        """One exchange in which the arm is moved on."""
        phase = TURN * (said.tick - self._began) * DRIVES.period
        grown = min(1.0, 0.5 * phase)
        torque = [
            STIFFNESS * (centre + grown * SWING * math.sin(phase + i) - angle)
            + DAMPING * (grown * SWING * TURN * math.cos(phase + i) - velocity)
            for i, (centre, angle, velocity) in enumerate(zip(self._centre, said.angle, said.velocity, strict=True))
        ]
        one, two, three = (max(-4.0, min(4.0, one)) for one in torque)
        return self.bus.exchange(Command((one, two, three), 0.0, brake=False, enable=True, busy=True))

    def start(self) -> Measurement:
        """From whatever there is to a swinging arm; once more where this machine was held up meanwhile."""
        return self._undisturbed(self._start)

    def suffer(self, fault: Fault, moment: float) -> Outcome:
        """Let it come so much later [s], then see it told, at rest, and mended; once more where it was disturbed."""
        return self._undisturbed(lambda: self._suffer(fault, moment))

    def _undisturbed(self, attempt: Callable[[], T]) -> T:
        reasons = list[str]()
        for _ in range(TRIES):
            try:
                return attempt()
            except HeldUp as held_up:
                reasons.append(str(held_up))
        pytest.fail(f"this machine is held up again and again, or the driver errs: {reasons}")

    def _start(self) -> Measurement:
        """Disabled until all is well, then enabled."""
        for _ in range(4000):
            with contextlib.suppress(BusLost):  # the cable has just been plugged in again
                if not self.bus.exchange(REST).status & ILL:
                    break
        else:
            pytest.fail(f"the fault does not go away: {self.told}")
        try:
            for _ in range(1000):
                said = self.bus.exchange(POWERED)
                if said.status & DriveStatus.ENABLED:
                    break
            self._began = said.tick
            speed = 0.0
            for _ in range(600):
                said = self.swing(said)
                speed = max(speed, *map(abs, said.velocity))
                if said.status & ILL:
                    raise HeldUp(f"it does not go on: {said.status!r}, {self.told}")
        except BusLost as error:  # slaves that did not run for so long do not pass frames on
            raise HeldUp(str(error)) from error
        assert not said.status & DriveStatus.BRAKED
        assert speed > 0.5
        return said

    def _suffer(self, fault: Fault, moment: float) -> Outcome:
        """Raises ``HeldUp`` if the driver found what a machine does that is held up, and not what was planted."""
        said = self.start()
        before = len(self.told)
        timer = threading.Timer(moment, self.control.send, [("begin", *fault.plant)])
        timer.start()
        due, lost_bus = time.monotonic() + moment, ""
        found: tuple[int, DriveTrouble] | None = None
        until = due + 2.0
        while time.monotonic() < until:
            if fault.silence and time.monotonic() > due + SLACK:
                self.control.send(("begin", "nothing"))  # what is planted only shows itself from here on
                time.sleep(fault.silence)
                due = math.inf
            try:
                said = self.swing(said)
            except BusLost as error:
                lost_bus = str(error)
                break
            if said.status & ILL:
                watchdog = bool(said.status & DriveStatus.WATCHDOG)
                found = (0, DriveTrouble.WATCHDOG_BIT) if watchdog else fault_of(said.status)
                break
        else:
            pytest.fail(f"it was not found: {fault}")
        timer.join()
        calm = time.monotonic() + 0.15
        while time.monotonic() < calm:
            with contextlib.suppress(BusLost):
                said = self.bus.exchange(POWERED)
                assert said.status & ILL, "it stays until it is disabled"
        self.control.send(("report",))
        report = Report(*self.control.recv())
        if fault.mend is not None:
            self.control.send(fault.mend)
            for _ in range(50):  # an encoder that jumps back does so before anybody clears the fault
                with contextlib.suppress(BusLost):
                    self.bus.exchange(POWERED)
        of_time = found is None or found[1] in (*OF_TIME, DriveTrouble.WATCHDOG_BIT)
        late = not report.braked or report.braked - report.planted >= fault.within
        if (found != fault.found and of_time) or late:
            raise HeldUp(f"{fault}: {found} was found, {lost_bus or self.told[before:]}, {report}")
        if lost_bus:
            return Outcome(None, lost_bus, report)
        assert len(self.told) > before
        return Outcome(found, self.told[before], report)


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    require_privileges()
    run_dir: Path = tmp_path_factory.mktemp("ethercat")
    world = WorldSettings(
        pieces=(), home=(0.0, 0.075, 0.325), pace=Pace.REAL, cameras=False, linger=20.0, drives=DRIVES, ethercat=CABLE,
        realtime=True,
    )  # fmt: skip
    keep_settings(world, run_dir)
    ours, theirs = socket.socketpair()
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "tests.hardware.drives.ethercat.faulty_world", str(run_dir), str(theirs.fileno())],
        env={**os.environ, "PYTHONPATH": path}, pass_fds=[theirs.fileno()],
    )  # fmt: skip
    theirs.close()
    control, told = Connection(ours.detach()), list[str]()
    try:
        enter = functools.partial(namespace.within_network, namespace.network_pid(run_dir))
        deadline = time.monotonic() + 60.0
        while True:
            try:
                bus = EtherCatServoBus(CABLE, DRIVES, ROBOT, enter, told.append)
                break
            except HardwareError:  # the world is not there yet
                if time.monotonic() > deadline or process.poll() is not None:
                    raise
                time.sleep(0.1)
        with real_time("this test", 80):
            yield Bench(bus, told, control)
        bus.close()
    finally:
        control.close()
        process.kill()
        process.wait()


@pytest.mark.slow
@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_in_motion_brakes_and_is_told_and_ends(bench: Bench, name: str) -> None:
    rng = random.Random(f"{name} 24")
    wrong, braked, stopped = [], [], []
    for _ in range(ROUNDS):
        fault = FAULTS[name](rng)
        found, sentence, report = bench.suffer(fault, rng.uniform(0.0, 1.0))
        assert report.speed > 0.0
        braked.append(report.braked - report.planted)
        stopped.append(report.rested - report.braked)
        if found != fault.found or fault.words not in sentence:
            wrong.append((fault, found, sentence))
        assert report.rested, f"{fault}: the arm moves: {sentence}"
    bench.start()
    middle = sorted(braked)[len(braked) // 2]
    print(
        f"{name}: {ROUNDS} times, brakes closed after {middle * 1e3:.1f} ms (median), {max(braked) * 1e3:.1f} ms "
        f"(worst), at rest {max(stopped) * 1e3:.0f} ms later (worst), {len(wrong)} named wrongly"
    )
    assert not wrong, wrong
    assert max(stopped) < STOPPING
