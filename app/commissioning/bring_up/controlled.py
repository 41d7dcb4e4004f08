"""The rig's own controller as a process of a step: started for it, and ended with the arm on its brakes."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

from app import UserError
from app.commissioning.operate import STATUS, operate
from app.rig.devices import Rig
from app.rig.factory import open_rig
from app.rig.rig_file import RigFile
from app.rig.simulation.processes import last_words, log_of
from controller.wire.client import ControllerClient
from controller.wire.errors import ControllerError
from hardware.interfaces import HardwareError

_START: Final = 120.0
"""A controller compiles its law at its first start, and a simulated world draws its pictures [s, wall]."""
_END: Final = 30.0
"""It stops the arm, brakes and writes its records [s, wall]."""
_LOG: Final = "commission"

Progress = Callable[[str], None]


@contextmanager
def controller_of(name: str, rig: RigFile, progress: Progress) -> Iterator[None]:
    """The controller of a rig file, which nobody else runs; ``UserError``: it does not start."""
    rig.run_dir.mkdir(mode=0o700, parents=True, exist_ok=True)
    log = log_of(_LOG, rig.run_dir)
    progress(f"starting the controller of {name}")
    with log.open("wb") as said:
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "app.cli", "controller", "--rig", name],
            stdin=subprocess.DEVNULL, stdout=said, stderr=said, start_new_session=True,
        )  # fmt: skip
    try:
        _await(process, name, lambda: last_words(log))
        yield
    finally:
        process.terminate()  # it stops the arm and brakes, then ends
        try:
            process.wait(_END)
        except subprocess.TimeoutExpired:
            process.kill()  # the drives' watchdogs brake
            process.wait()


def _await(process: subprocess.Popen[bytes], name: str, last: Callable[[], str | None]) -> None:
    deadline = time.monotonic() + _START
    while True:
        if process.poll() is not None:
            raise UserError(last() or f"the controller of {name} did not start")
        try:
            operate(STATUS, name)
        except UserError:
            if time.monotonic() > deadline:
                raise
            time.sleep(0.2)
        else:
            return


@contextmanager
def arm_of(name: str, rig: RigFile, progress: Progress) -> Iterator[tuple[Rig, ControllerClient]]:
    """The rig's devices behind its own controller; the arm holds. Afterwards it stands on its brakes.

    Raises:
        UserError: the controller does not start, or a device fails.
    """
    with controller_of(name, rig, progress):
        try:
            with open_rig(rig, progress) as devices:
                client = getattr(devices, "client", None)
                assert isinstance(client, ControllerClient)
                yield devices, client
        except (HardwareError, ControllerError) as error:
            raise UserError(str(error)) from error
