"""Lets what comes at a serial port reach a real-time loop in time, whatever else this computer does.

The bytes of serial ports (USB adapters as well as pseudo-terminals) are handed to their reader by the kernel's unbound
workers, ``kworker/u…`` (``flush_to_ldisc`` of ``drivers/tty/tty_buffer.c``). Those are ordinary threads: a busy program
keeps them waiting for milliseconds, and so the loop, whatever its own priority. Measured in a game behind emulated
moteus controllers on two processors: 0.8 % of all ticks missed so, 0.2 % with workers in real time.

New workers come as the kernel needs them. So a small process of its own looks once a second, which costs the loop
nothing, and lets them be ordinary again when the loop, or its process, has ended.
"""

from __future__ import annotations

import contextlib
import os
import select
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

PROCESSES = Path("/proc")
NAME: Final = "kworker/u"
"""What the names of unbound workers begin with; others serve one processor alone, and no serial port."""
AGAIN: Final = 1.0
"""New ones are looked for so often [s]."""
_READY: Final = "ready"
_PATIENCE: Final = 10.0  # for the process to begin [s]


@contextlib.contextmanager
def hurried(priority: int) -> Iterator[None]:
    """The kernel's unbound workers have SCHED_FIFO with this priority, 1 to 99, for as long as the block lasts.

    Raises ``OSError`` where the system does not let us. Those that somebody else has promoted are left as they are.
    """
    watcher = subprocess.Popen(
        [sys.executable, "-P", "-m", __name__, str(priority)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        start_new_session=True,  # Ctrl-C is for the loop, which ends it
    )  # fmt: skip
    with watcher:
        assert watcher.stdout is not None
        said = watcher.stdout.readline().strip() if select.select([watcher.stdout], [], [], _PATIENCE)[0] else ""
        if said != _READY:
            watcher.kill()
            raise OSError(0, said or "the process that promotes them does not begin", NAME)
        try:
            yield
        finally:
            watcher.communicate()


def workers() -> set[int]:
    """Process ids of the kernel's unbound workers that are there; none in a container that does not see them."""
    found = set()
    for process in PROCESSES.iterdir():
        if process.name.isdecimal():
            with contextlib.suppress(OSError):  # it has ended meanwhile
                if (process / "comm").read_text(errors="replace").startswith(NAME):
                    found.add(int(process.name))
    return found


class Promotion:
    """Workers that were ordinary, and have a real-time priority until ``end``."""

    def __init__(self, priority: int) -> None:
        self._priority, self._promoted = os.sched_param(priority), set[int]()

    def look(self) -> None:
        """Promote those that are ordinary; raises ``PermissionError`` where that is not granted."""
        for worker in workers():
            with contextlib.suppress(ProcessLookupError):
                if os.sched_getscheduler(worker) == os.SCHED_OTHER:
                    os.sched_setscheduler(worker, os.SCHED_FIFO, self._priority)
                    self._promoted.add(worker)

    def end(self) -> None:
        """Let them be ordinary again; a number that somebody else has by now is nobody's concern."""
        for worker in self._promoted & workers():
            with contextlib.suppress(ProcessLookupError):
                os.sched_setscheduler(worker, os.SCHED_OTHER, os.sched_param(0))


def main() -> None:
    """The process: promotes until its standard input ends."""
    promotion = Promotion(int(sys.argv[1]))
    try:
        promotion.look()
        print(_READY, flush=True)
        while not select.select([sys.stdin], [], [], AGAIN)[0]:
            promotion.look()
    except PermissionError as error:
        print(error.strerror, flush=True)
    finally:
        promotion.end()


if __name__ == "__main__":
    main()
