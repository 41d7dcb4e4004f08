"""Processes that another program started: watched and ended like children, though they are none."""

import contextlib
import os
import select
import signal
import subprocess
from pathlib import Path
from typing import Final

ENDED: Final = 1
"""Status of an adopted process that has ended: its real one went to its parent."""


class Adopted:
    """A running process that is no child of ours; what stays its own, even if its number is given away, is its handle.

    Raises ``ProcessLookupError`` if there is no process of that number.
    """

    def __init__(self, pid: int) -> None:
        self.pid = pid
        self._handle = os.pidfd_open(pid)

    def poll(self) -> int | None:
        """Exit status, ``ENDED`` once it has, None while it runs."""
        return ENDED if self._over(0.0) else None

    def terminate(self) -> None:
        """Ask it to end."""
        self._send(signal.SIGTERM)

    def kill(self) -> None:
        """End it."""
        self._send(signal.SIGKILL)

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end; raises ``subprocess.TimeoutExpired``."""
        if not self._over(timeout):
            raise subprocess.TimeoutExpired(f"process {self.pid}", timeout or 0.0)
        return ENDED

    def __del__(self) -> None:
        with contextlib.suppress(AttributeError, OSError):  # never opened, or the interpreter is ending
            os.close(self._handle)

    def _over(self, timeout: float | None) -> bool:
        return bool(select.select([self._handle], [], [], timeout)[0])

    def _send(self, number: int) -> None:
        with contextlib.suppress(ProcessLookupError):  # it has ended meanwhile
            signal.pidfd_send_signal(self._handle, number)


Process = subprocess.Popen[bytes] | Adopted
"""One of a rig, whoever has started it."""


def adopt(pid: int, part_of_command: str) -> Adopted | None:
    """The process of that number, if it still runs and its command line holds a part that tells it from others."""
    try:
        found = Adopted(pid)
        return found if part_of_command.encode() in Path(f"/proc/{pid}/cmdline").read_bytes() else None
    except (ProcessLookupError, FileNotFoundError):
        return None
