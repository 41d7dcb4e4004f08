"""Emulated moteus controllers in a process of their own, whose motors never turn; faults are planted on request."""

from __future__ import annotations

import dataclasses
import math
import multiprocessing
import select
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from typing import NamedTuple

from hardware.drives.moteus.registers import Mode
from hardware.drives.moteus.settings import MoteusSettings
from hardware.realtime import real_time
from hardware.sim.emulated.moteus.devices import PORT, MoteusDevices
from hardware.sim.emulated.moteus.injected import Injected
from hardware.sim.emulated.plant_drives import MotorState
from tests.waiting import PATIENCE

STILL = MotorState(0, (0.1, 0.2, 0.3), (0.0, 0.0, 0.0), 0.0, (0.0, 0.0))


class Since(NamedTuple):
    """Since when the arm is in some state (``time.monotonic``) [s]; no number: it is not."""

    idle: float
    """No servomotor gives a torque of its own: stopped, shorted, or seized by its watchdog."""
    braked: float
    """Power-off brakes are closed."""


def emulate(control: Connection, run_dir: Path, settings: MoteusSettings) -> None:
    """Serve the master, and the test, in real time where the system grants it."""
    with real_time("the emulator", 90):
        serve(control, run_dir, settings)


def serve(control: Connection, run_dir: Path, settings: MoteusSettings) -> None:
    """Until the test says "end"; else it says "since", or the arguments of ``plant``."""
    devices = MoteusDevices(run_dir, settings)
    devices.sense(STILL)
    control.send(None)
    since = Since(time.monotonic(), time.monotonic())
    while True:
        ready = select.select([*devices.numbers, control], [], [], 0.001)[0]
        if control in ready:
            asked = control.recv()
            if asked == "end":
                devices.close()
                return
            if asked == "since":
                control.send(since)
            else:
                plant(devices, *asked)
                control.send(time.monotonic())
        if len(ready) > (control in ready):
            devices.hear()
        now = time.monotonic()
        command = devices.act(now)
        devices.sense(STILL)
        driven = any(one.mode is Mode.POSITION for one in devices.controllers[:3])
        since = Since(_since(since.idle, not driven, now), _since(since.braked, command.braked, now))


def plant(devices: MoteusDevices, place: int | None, attribute: str, value: object) -> None:
    """Set an attribute of a controller's ``Injected``; without a place, all of them to what they usually are."""
    if place is not None:
        setattr(devices.controllers[place].injected, attribute, value)
        return
    for controller in devices.controllers:
        for field in dataclasses.fields(Injected):
            setattr(controller.injected, field.name, field.default)


def _since(before: float, holds: bool, now: float) -> float:
    return (now if math.isnan(before) else before) if holds else math.nan


class Emulator(NamedTuple):
    """What a test sees of the process."""

    port: Path
    control: Connection
    end: Callable[[], None]
    """The process ends, and the port is gone."""

    def plant(self, attribute: str, place: int, value: object) -> float:
        """Plant a fault in a controller; when that was [s]."""
        return self._ask(place, attribute, value)

    def heal(self) -> None:
        """No fault is planted any more."""
        self._ask(None, "", None)

    def _ask(self, *request: object) -> float:
        self.control.send(request)
        at: float = self.control.recv()
        return at

    def since(self) -> Since:
        """Since when the arm is idle and braked."""
        self.control.send("since")
        since: Since = self.control.recv()
        return since


@contextmanager
def emulated(run_dir: Path, settings: MoteusSettings) -> Iterator[Emulator]:
    """Controllers behind the pseudo-terminal of a folder."""
    context = multiprocessing.get_context("spawn")
    control, theirs = context.Pipe()
    process = context.Process(target=emulate, args=(theirs, run_dir, settings), daemon=True)
    process.start()
    theirs.close()  # an emulator that ends is noticed at once

    def end() -> None:
        if process.is_alive():
            control.send("end")
            process.join(PATIENCE)

    try:
        assert control.poll(PATIENCE), "the emulator does not start"
        control.recv()
        yield Emulator(run_dir / PORT, control, end)
    finally:
        end()
        process.kill()
