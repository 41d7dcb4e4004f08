"""Servo buses of every kind, each before the same simulated arm, for tests of what all of them have in common."""

from __future__ import annotations

import functools
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Final, TypeVar

import pytest

from hardware.drives.ethercat.bus import EtherCatServoBus
from hardware.drives.ethercat.settings import EtherCatSettings
from hardware.drives.moteus.bus import MoteusServoBus
from hardware.drives.moteus.settings import MoteusSettings, PinSettings
from hardware.drives.settings import DriveSettings
from hardware.interfaces import (
    BusLost,
    Command,
    DriveStatus,
    DriveTrouble,
    HardwareError,
    Measurement,
    Pace,
    ServoBus,
    Triple,
    fault_of,
)
from hardware.parameters import DEFAULT_FILE, load_parameters
from hardware.realtime import real_time
from hardware.sim.clients.bus import SimServoBus
from hardware.sim.emulated.ethercat import namespace
from hardware.sim.emulated.moteus.devices import PORT
from hardware.sim.process.inner_bus import InnerServoBus
from hardware.sim.process.server import World
from hardware.sim.process.settings import WorldSettings, keep_settings
from tests.hardware.drives.ethercat.privileges import require_privileges
from tests.waiting import PATIENCE

ALL_KINDS: Final = ("sim-fast", "sim-real", "inside", "moteus", "ethercat")
LOCKSTEP: Final = ("sim-fast", "inside")
"""Their time waits, so that nobody who uses them has to be punctual."""
DRIVES: Final = DriveSettings()
ROBOT: Final = DRIVES.robot(load_parameters())
MOTEUS: Final = MoteusSettings(brakes=PinSettings(id=4, aux=2, pin=1))
ETHERCAT: Final = EtherCatSettings(interface=namespace.MASTER_END)
REST: Final = Command((0.0, 0.0, 0.0), 0.0, brake=True, enable=False, busy=False)
POWERED: Final = Command((0.0, 0.0, 0.0), 0.0, brake=True, enable=True, busy=True)
FREE: Final = Command((0.0, 0.0, 0.0), 0.0, brake=False, enable=True, busy=True)
ENDED: Final = DriveStatus.FAULT | DriveStatus.WATCHDOG | DriveStatus.OVERSPEED
OF_TIME: Final = (
    DriveTrouble.NO_REPLY, DriveTrouble.NOT_OPERATIONAL, DriveTrouble.FRAMES_LOST, DriveTrouble.TORQUE_NOT_FOLLOWED,
    DriveTrouble.WATCHDOG_DEAD, DriveTrouble.OUT_OF_STEP,
)  # fmt: skip
"""Faults that no law here asks for, and that devices have which do not run when it is their turn."""
T = TypeVar("T")
Opened = TypeVar("Opened", bound=ServoBus)


class HeldUp(Exception):
    """This machine did not let the test, or the devices, run for longer than a watchdog waits."""


def held_up(said: Measurement) -> bool:
    """The devices, or this process, did not run for longer than the watchdog waits: nobody's fault here."""
    bitten = said.status & DriveStatus.WATCHDOG and not said.status & DriveStatus.FAULT
    return bool(bitten) or fault_of(said.status) == (0, DriveTrouble.NO_REPLY)


def world_settings(
    folder: Path, pace: Pace, moteus: MoteusSettings | None = None, ethercat: EtherCatSettings | None = None
) -> WorldSettings:
    """The world before each bus, with the same period and watchdog."""
    drive = ROBOT.drive
    text = DEFAULT_FILE.read_text(encoding="utf-8")
    for name in ("tick", "watchdog_ticks", "encoder_bits"):
        text = re.sub(rf"(?m)^{name} = \S+", f"{name} = {getattr(drive, name)}", text)
    parameters = folder / "parameters.toml"
    parameters.write_text(text, encoding="utf-8")
    return WorldSettings(
        pieces=(), home=(0.0, 0.075, 0.325), pace=pace, cameras=False, linger=20.0, parameters_file=parameters,
        realtime=pace is Pace.REAL,  # where the system grants it; otherwise a test begins anew when it was held up
        drives=None if moteus is None and ethercat is None else DRIVES, moteus=moteus, ethercat=ethercat,
    )  # fmt: skip


class Bench:
    """A bus of one kind, opened when it is asked for, and again after it was closed."""

    def __init__(self, kind: str, new_folder: Callable[[], Path]) -> None:
        self.kind, self.told = kind, list[str]()
        self._new_folder, self._opened = new_folder, ExitStack()
        self._bus: ServoBus | None = None
        self._world: subprocess.Popen[bytes] | None = None
        self.home: Triple = (0.0, 0.0, 0.0)

    @property
    def is_open(self) -> bool:
        return self._bus is not None

    @property
    def bus(self) -> ServoBus:
        if self._bus is None:
            self._bus = self._open()
            self.home = self._bus.exchange(REST).angle
        return self._bus

    def forget(self) -> None:
        """The bus was closed."""
        self._bus = None
        self._opened.close()

    # what a test does

    def exchange(self, command: Command) -> Measurement:
        """Raises ``HeldUp`` if a watchdog has bitten that nobody wanted."""
        try:
            said = self.bus.exchange(command)
        except BusLost as error:
            if self.kind != "ethercat":
                raise
            raise HeldUp from error  # slaves that did not run for so long do not pass frames on
        silent = said.status & DriveStatus.WATCHDOG
        late = said.status & DriveStatus.FAULT and fault_of(said.status)[1] in OF_TIME
        lost = said.status & DriveStatus.FAULT and self.told and "communication was lost" in self.told[-1]
        if (silent or late or lost) and not self.bus.lockstep:
            raise HeldUp
        return said

    def run(self, command: Command, exchanges: int) -> list[Measurement]:
        return [self.exchange(command) for _ in range(exchanges)]

    def run_for(self, command: Command, ticks: int) -> list[Measurement]:
        """Exchanges until so many ticks have passed: on a busy machine each of them may take several."""
        said = [self.exchange(command)]
        while said[-1].tick < said[0].tick + ticks:
            said.append(self.exchange(command))
        return said

    def until(self, command: Command, holds: Callable[[Measurement], object], exchanges: int = 2000) -> Measurement:
        for _ in range(exchanges):
            said = self.exchange(command)
            if holds(said):
                return said
        pytest.fail(f"{self.kind}: {said}, {self.told}")

    def rest(self) -> Measurement:
        """Disabled and at rest, without a fault."""
        self.until(REST, lambda said: not said.status & ENDED)
        return self.until(REST, lambda said: max(map(abs, said.velocity)) < 0.01)

    def enable(self) -> Measurement:
        """Enabled on the brakes."""
        self.rest()
        return self.until(POWERED, lambda said: said.status & DriveStatus.ENABLED)

    def go_home(self) -> None:
        """Where the arm was at the start, on its brakes and enabled."""
        said = self.enable()
        for _ in range(3000):
            off = [aim - at for aim, at in zip(self.home, said.angle, strict=True)]
            if max(map(abs, off)) < 0.02 and max(map(abs, said.velocity)) < 0.05:
                break
            one, two, three = (-1.1 + 60.0 * e - 1.5 * v for e, v in zip(off, said.velocity, strict=True))
            said = self.exchange(FREE._replace(torque=(one, two, three)))
        else:
            pytest.fail(f"{self.kind} does not come home: {said}, {self.told}")
        self.until(POWERED, lambda said: said.status & DriveStatus.BRAKED and max(map(abs, said.velocity)) < 0.01)
        self.run(POWERED, 60)

    def calmly(self, test: Callable[[], T]) -> T:
        """Do it until this machine does not disturb it; the arm begins at home."""
        with ExitStack() as undisturbed:
            if not self.bus.lockstep:  # as a controller on a bus has it
                undisturbed.enter_context(real_time("the test", 80, serial=self.kind == "moteus"))
            for _ in range(20):
                try:
                    self.go_home()
                    return test()
                except HeldUp:
                    self._calm_down()
        pytest.fail("this machine is held up again and again")

    def _calm_down(self) -> None:
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline:
            try:
                if not self.bus.exchange(REST).status & ENDED:
                    return
            except BusLost:
                if self._world is not None and self._world.poll() is not None:
                    pytest.fail(f"the world behind {self.kind} has ended with status {self._world.returncode}")
                time.sleep(0.01)

    # opening

    def _open(self) -> ServoBus:
        folder = self._new_folder()
        if self.kind == "inside":
            world = World(folder, world_settings(folder, Pace.FAST))
            self._opened.enter_context(world.open())
            return InnerServoBus(world)
        if self.kind.startswith("sim"):
            pace = Pace.FAST if self.kind == "sim-fast" else Pace.REAL
            self._start(folder, world_settings(folder, pace), "app.cli", "world", "--run-dir")
            return SimServoBus(folder)
        if self.kind == "moteus":
            world_of = world_settings(folder, Pace.REAL, moteus=MOTEUS)
            process = self._start(folder, world_of, "app.cli", "world", "--run-dir")
            at = MOTEUS.model_copy(update={"port": folder / PORT})
            return as_soon_as_there(process, lambda: MoteusServoBus(DRIVES, at, ROBOT, self.told.append))
        require_privileges()
        world_of = world_settings(folder, Pace.REAL, ethercat=ETHERCAT)
        process = self._start(folder, world_of, "hardware.sim.emulated.ethercat.process")
        enter = functools.partial(namespace.within_network, namespace.network_pid(folder))
        return as_soon_as_there(process, lambda: EtherCatServoBus(ETHERCAT, DRIVES, ROBOT, enter, self.told.append))

    def _start(self, folder: Path, settings: WorldSettings, *module: str) -> subprocess.Popen[bytes]:
        keep_settings(settings, folder)
        process = subprocess.Popen([sys.executable, "-P", "-m", *module, str(folder)], env=os.environ)
        self._world = process
        self._opened.callback(process.wait)
        self._opened.callback(process.kill)
        return process


def as_soon_as_there(process: subprocess.Popen[bytes], open_bus: Callable[[], Opened]) -> Opened:
    """A bus, once the devices of a process that has just begun answer."""
    deadline = time.monotonic() + PATIENCE
    while True:
        try:
            return open_bus()
        except HardwareError:
            if time.monotonic() > deadline or process.poll() is not None:
                raise
            time.sleep(0.1)
