"""The process of a simulated world behind EtherCAT devices in which faults are planted while it runs.

``python -P -m tests.hardware.drives.ethercat.faulty_world RUN_DIR FD``: on the open file FD it is told what to plant,
at once and so at any phase of the bus's cycle, and asked when the brakes closed after that.
"""

import random
import sys
import time
from collections.abc import Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from hardware.sim.emulated.ethercat.namespace import SLAVES_END, announce, make_network, set_link

STILL = 0.01
"""Servomotors that turn slower are at rest [rad/s]."""


def main(run_dir: Path, control: Connection) -> None:
    """Be the world until the other end of ``control`` is closed, or SIGTERM."""
    make_network()
    announce(run_dir)

    from hardware.drives.ethercat.settings import Device
    from hardware.parameters import load_parameters
    from hardware.sim.emulated.ethercat.devices import EtherCatDevices
    from hardware.sim.emulated.plant_drives import MotorCommand, MotorState, driven_world_of
    from hardware.sim.process.planted import PlantedKind
    from hardware.sim.process.settings import load_settings

    class FaultyDevices(EtherCatDevices):
        """Devices that are told by a test what becomes wrong with them."""

        begun = braked = rested = speed = fastest = share = 0.0
        place: int | None = None
        silent_until = 0.0
        draw = random.Random(1)

        @property
        def numbers(self) -> Sequence[int]:
            return (*super().numbers, control.fileno())

        def hear(self) -> None:
            super().hear()
            while control.poll():
                name, *rest = control.recv()
                if name == "report":
                    control.send((self.begun, self.braked, self.rested, self.speed))
                else:
                    getattr(self, name)(*rest)

        def begin(self, what: str, *rest: Any) -> None:
            """A fault begins."""
            self.begun, self.braked, self.rested, self.speed = time.monotonic(), 0.0, 0.0, self.fastest
            getattr(self, what)(*rest)

        def nothing(self) -> None:
            """The fault is the master's own."""

        def device(self, kind: str, number: int, amount: float) -> None:
            self.plant(PlantedKind(kind), number, amount)

        def mended(self, kind: str, number: int) -> None:
            self.mend(PlantedKind(kind), number)

        def jump(self, number: int, angle: float) -> None:
            self.drives[number - 1].flaws.jump = angle

        def drop(self, name: str) -> None:
            self.slaves[Device(name)].drop(4, 0x001A)

        def cut(self, place: int) -> None:
            self._reach(place)

        def link(self, up: bool) -> None:
            set_link(SLAVES_END, up=up)

        def bias(self, name: str, more: int) -> None:
            self.slaves[Device(name)].biased = more

        def lose(self, share: float, place: int | None) -> None:
            """A share of all frames, damaged before a device, or without a trace."""
            self.share, self.place = share, place

        def burst(self, seconds: float) -> None:
            """All frames, for so long."""
            self.silent_until = time.monotonic() + seconds

        def pass_on(self, frame: bytearray) -> bool:
            if time.monotonic() < self.silent_until:
                self.segment.losing = 1
            elif self.draw.random() < self.share:
                if self.place is None:
                    self.segment.losing = 1
                else:
                    self.segment.damaging, self.segment.damaged_before = 1, self.place
            return super().pass_on(frame)

        def act(self, now: float) -> MotorCommand:
            command = super().act(now)
            if command.braked and not self.braked:
                self.braked = now
            return command

        def sense(self, state: MotorState) -> None:
            super().sense(state)
            self.fastest = max(map(abs, state.velocity))
            if self.braked and not self.rested and self.fastest < STILL:
                self.rested = time.monotonic()

    settings = load_settings(run_dir)
    assert settings.ethercat is not None
    assert settings.drives is not None
    robot = load_parameters(settings.parameters_file)
    driven_world_of(run_dir, FaultyDevices(settings.ethercat, settings.drives, robot, SLAVES_END)).run()


if __name__ == "__main__":
    main(Path(sys.argv[1]), Connection(int(sys.argv[2])))
