"""How long a world waits for its controller, on a clock that is a number, and how it knows that one is gone."""

from __future__ import annotations

import json
import socket
from pathlib import Path
from types import SimpleNamespace

import pytest

from controller.wire.sockets import LOCKSTEP_SILENCE
from hardware.interfaces import Command
from hardware.sim.clients import wire
from hardware.sim.process import services
from hardware.sim.process.connections import Visitors
from hardware.sim.process.services import DriveService

COMMAND = wire.pack_command(Command((0.0, 0.0, 0.0), 0.0, brake=True, enable=False, busy=True))


class House:
    """A world's door, its drives, and a controller that has given its first command."""

    def __init__(self, run_dir: Path, monkeypatch: pytest.MonkeyPatch, *, lockstep: bool) -> None:
        self.now = 1000.0
        monkeypatch.setattr(services, "time", SimpleNamespace(monotonic=lambda: self.now))
        self.drives = DriveService({"period": 0.001, "lockstep": lockstep}, first=90.0, linger=10.0)
        self._visitors = Visitors(run_dir, {"servo": self.drives})
        self.controller = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with wire.socket_address(run_dir) as address:
            self.controller.connect(address)
        self.listen()
        self.controller.send(json.dumps({"role": "servo"}).encode())
        self.listen()
        self.controller.send(COMMAND)
        self.listen()

    def listen(self) -> None:
        self._visitors.listen(0.0)

    def close(self) -> None:
        self.controller.close()
        self._visitors.close()

    def waits(self, seconds: float) -> bool:
        """Whether a controller that says nothing for so long is still waited for."""
        self.now = 1000.0 + seconds
        return not self.drives.silent


@pytest.mark.parametrize(
    ("lockstep", "waited", "lost"), [(False, 1.9, 2.1), (True, LOCKSTEP_SILENCE + 1.0, 60.0)], ids=["real", "fast"]
)
def test_in_pace_fast_a_controller_may_wait_for_its_client(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lockstep: bool, waited: float, lost: float
) -> None:
    """For as long as it does, and a moment to tell of a client that it has lost."""
    house = House(tmp_path, monkeypatch, lockstep=lockstep)
    assert house.drives.take() is not None
    assert house.waits(waited)
    assert not house.waits(lost)
    house.close()


@pytest.mark.parametrize("lockstep", [False, True])
def test_a_controller_that_is_gone_is_not_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lockstep: bool
) -> None:
    house = House(tmp_path, monkeypatch, lockstep=lockstep)
    assert house.drives.controller is not None
    house.controller.close()  # as the kernel does for a program that is killed
    house.listen()
    assert house.drives.controller is None
    house.close()
