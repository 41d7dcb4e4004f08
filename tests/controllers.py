"""Controllers that a test starts from a rig file, as a person would, and commands given to them."""

from __future__ import annotations

import contextlib
import json
import secrets
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from controller.wire.client import ControllerClient
from controller.wire.errors import ControllerBusy
from tests.waiting import PATIENCE

TOUCHMOVE = [sys.executable, "-P", "-m", "app.cli"]


def free_port() -> int:
    """A port that nobody has, below those from which the kernel hands out, so that nobody gets it meanwhile."""
    while True:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one, contextlib.suppress(OSError):
            one.bind(("127.0.0.1", secrets.choice(range(20_000, 32_000))))
            return int(one.getsockname()[1])


def connects(client: ControllerClient) -> bool:
    """Whether the lease of the client before is over."""
    try:
        client.connect()
    except ControllerBusy:
        return False
    return True


class Controller:
    """``touchmove controller --rig FILE``, perhaps in a network of its own."""

    def __init__(self, rig: Path, within: tuple[str, ...] = ()) -> None:
        self.rig = rig
        self.log = rig.parent / "controller.log"
        self._ready = len(self.said())
        with self.log.open("ab") as log:
            self.process = subprocess.Popen(
                [*within, *TOUCHMOVE, "controller", "--rig", str(rig)],
                stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True,
            )  # fmt: skip
        self.wait_for("ready: clients connect to")

    def said(self) -> str:
        return self.log.read_text() if self.log.exists() else ""

    def wait_for(self, words: str) -> None:
        deadline = time.monotonic() + PATIENCE
        ended = False  # asked before the log is read: what a program says last is in it then
        while words not in self.said()[self._ready :]:
            assert not ended, self.said()
            assert time.monotonic() < deadline, self.said()
            time.sleep(0.02)
            ended = self.process.poll() is not None

    def end(self, number: int = signal.SIGINT) -> int:
        if self.process.poll() is None:
            self.process.send_signal(number)
        return self.process.wait(PATIENCE)


def touchmove(*arguments: str, within: tuple[str, ...] = ()) -> tuple[int, str, str]:
    done = subprocess.run([*within, *TOUCHMOVE, *arguments], capture_output=True, text=True, check=False)
    return done.returncode, done.stdout, done.stderr


def status(rig: Path) -> dict[str, Any]:
    code, out, err = touchmove("controller", "status", "--rig", str(rig), "--json")
    assert code == 0, err
    return dict(json.loads(out))
