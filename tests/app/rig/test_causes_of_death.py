"""A process of a simulated rig has ended: which one was it, and what is said of it."""

from __future__ import annotations

import errno
import json
import os
import re
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import pytest

from app.records.files import full_disk
from app.rig.devices import EndState
from app.rig.simulation.adopted import Adopted
from app.rig.simulation.sim import SimRig
from controller.wire.errors import ControllerLost
from hardware.sim.process.settings import END_FILE


@dataclass
class Ended:
    """A process with a status; None: it runs."""

    status: int | None
    pid: int = 0

    def poll(self) -> int | None:
        return self.status

    def wait(self, timeout: float | None = None) -> int:
        if self.status is None:
            raise subprocess.TimeoutExpired("world", timeout or 0.0)
        return self.status


def sentence(folder: Path, world: int | None, controller: int | None) -> str | None:
    rig = object.__new__(SimRig)
    rig._run_dir, rig._open, rig._cause = folder, True, None
    rig._connected = False
    rig._processes = {"world": Ended(world), "controller": Ended(controller)}  # type: ignore[dict-item]
    return rig.failure()


KILLED = -signal.SIGKILL


@pytest.mark.parametrize(
    ("world", "controller", "said"),
    [
        (None, None, None),
        (KILLED, None, "the simulated world has ended: it was killed (SIGKILL)"),
        (KILLED, 2, "the simulated world has ended: it was killed (SIGKILL)"),
        (None, KILLED, "the controller has ended: it was killed (SIGKILL)"),
        (0, KILLED, "the controller has ended: it was killed (SIGKILL)"),
        (2, KILLED, "the controller has ended: it was killed (SIGKILL)"),
        (2, 2, "the simulated world has ended: no more steps"),
        (0, 2, "the controller has ended: no law"),
        (0, 0, "the simulated world has ended: no more steps"),
        (3, None, "the simulated world has ended: no more steps"),
    ],
)
def test_who_was_killed_counts_for_more_than_who_ended_with_it(
    tmp_path: Path, world: int | None, controller: int | None, said: str | None
) -> None:
    (tmp_path / "world.log").write_text("a note\nno more steps\n", encoding="utf-8")
    (tmp_path / "controller.log").write_text("no law\n", encoding="utf-8")
    assert sentence(tmp_path, world, controller) == said


def test_who_could_say_nothing_as_the_disk_is_full_is_spoken_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert sentence(tmp_path, 1, None) == "the simulated world has ended: exit status 1"

    def full(*_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "posix_fallocate", full)
    wanted = (
        rf"the simulated world has ended: the disk at /\S* has less than 16 MiB left for {re.escape(str(tmp_path))}: "
        "free some space or choose another folder with --out"
    )
    assert re.fullmatch(wanted, sentence(tmp_path, 1, None) or "")


def test_a_disk_with_room_and_a_folder_that_is_gone_are_no_full_disk(tmp_path: Path) -> None:
    assert full_disk(tmp_path) is None
    assert not list(tmp_path.iterdir())
    assert full_disk(tmp_path / "none") is None


@dataclass
class Ending(Ended):
    """A process whose connections are gone, and which has ended once that is waited for."""

    def poll(self) -> int | None:
        return None

    def wait(self, timeout: float | None = None) -> int:
        self.poll = lambda: self.status  # type: ignore[method-assign]
        return super().wait(timeout)

    def terminate(self) -> None:
        """As told already."""


class Lost:
    """A client that does not hear its controller's last word."""

    asked = False

    def shutdown(self) -> None:
        self.asked = True
        raise ControllerLost

    def close(self) -> None:
        return None


@pytest.mark.parametrize(("status", "cause"), [
    (0, None),
    (1, "the simulation has ended: exit status 1"),
    (KILLED, "the simulation has ended: it was killed (SIGKILL)"),
])  # fmt: skip
def test_who_ends_well_a_moment_after_its_last_word_was_lost_was_told_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, status: int, cause: str | None
) -> None:
    lost = Lost()
    monkeypatch.setattr("app.rig.simulation.sim.world_pid", lambda _run_dir: None if lost.asked else 1)
    rig = object.__new__(SimRig)
    rig._run_dir, rig._open, rig._cause, rig._connected = tmp_path, True, None, True
    rig._processes = {"simulation": cast(Any, Ending(status))}
    rig._devices = rig.client = cast(Any, lost)
    rig._rig = cast(Any, None)
    rig.close()
    assert rig._cause == cause


@pytest.mark.parametrize("good", [True, False])
def test_the_last_word_of_who_was_adopted_may_be_lost_but_not_its_last_state(tmp_path: Path, good: bool) -> None:
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as process:

        class Deaf:
            """A client whose controller ends as it should, and is not heard."""

            def shutdown(self) -> None:
                if good:
                    state = {"at_rest": True, "braked": True, "arm_speed": 0.0}
                    (tmp_path / END_FILE).write_text(json.dumps(state), encoding="utf-8")
                process.communicate(b"\n")
                raise ControllerLost

            def close(self) -> None:
                return None

        rig = object.__new__(SimRig)
        rig._run_dir, rig._open, rig._cause, rig._connected = tmp_path, True, None, True
        rig._processes = {"simulation": Adopted(process.pid)}
        rig._devices = cast(Any, Deaf())
        rig._rig, rig.client = cast(Any, None), cast(Any, Deaf())
        left = rig.close()
    assert (rig._cause is None) is good
    assert left == (EndState(True, 0.0) if good else None)
