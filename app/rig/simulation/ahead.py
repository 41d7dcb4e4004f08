"""Processes of a simulated rig that are started before it is known what they run on, so that they load meanwhile.

Each waits, once it has loaded, for a line on its standard input: then its settings lie in the run directory. Where
none comes it is not wanted any more, or whoever has started it is gone, and it ends.
"""

import os
import signal
import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Final

from app.records.files import GAMES, new_folder
from app.records.game import utc_now
from app.settings.defaults import SIMULATED, Drives, Processes, RigSection, Settings
from hardware.interfaces import Pace

_COMMANDS: Final = {
    "simulation": ("world", "--controlled"),
    "world": ("world",),
    "controller": ("controller",),
}


class _Waiting:
    """A process that loads, and waits."""

    def __init__(self, name: str, run_dir: Path, *, drawn: bool) -> None:
        self._name, self._said = name, tempfile.TemporaryFile()  # noqa: SIM115 - until it is told
        pictures = ("--drawn",) if drawn and name != "controller" else ()
        command = (*_COMMANDS[name], "--run-dir", str(run_dir), "--ahead", *pictures)
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", "app.cli", *command], stdin=subprocess.PIPE, stdout=self._said,
            stderr=self._said, start_new_session=True,
        )  # fmt: skip

    def tell(self, log: Path) -> None:
        """Its settings are there; what it has said so far, as where it could not load, goes to its log."""
        assert self.process.stdin is not None
        with suppress(BrokenPipeError), self.process.stdin as told:  # one that has ended is found out by its status
            told.write(b"\n")
        with self._said as said, log.open("ab") as file:
            said.seek(0)
            file.write(said.read())

    def cancel(self) -> None:
        """End it, and what it has started."""
        with suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        assert self.process.stdin is not None
        self.process.stdin.close()
        self._said.close()


class RigAhead:
    """The processes of a simulation of our own, started ahead.

    Attributes:
        folder: of the game that they are for: that of the settings, or one made for it.
    """

    def __init__(self, settings: Settings) -> None:
        """Start those that the settings ask for, which may be none."""
        self.folder, self._made = settings.out, settings.out is None
        self._waiting: dict[str, _Waiting] = {}
        names = _names(settings.rig)
        if not names:
            return
        if self.folder is None:
            self.folder = new_folder(GAMES, utc_now())
        self._run_dir = (self.folder / "run").resolve()
        self._waiting = {name: _Waiting(name, self._run_dir, drawn=settings.rig.cameras) for name in names}

    def take(self, name: str, run_dir: Path, log: Path) -> subprocess.Popen[bytes] | None:
        """The process of a name, which goes on now; None: none was started for this run directory."""
        if name not in self._waiting or run_dir != self._run_dir:
            return None
        waiting = self._waiting.pop(name)
        waiting.tell(log)
        return waiting.process

    def cancel(self) -> None:
        """End those that nobody has taken, and drop a folder that nobody has used; a second call does nothing."""
        while self._waiting:
            self._waiting.popitem()[1].cancel()
        if self._made and self.folder is not None:
            with suppress(OSError):  # there is something in it, or it is gone
                self.folder.rmdir()


def _names(section: RigSection) -> tuple[str, ...]:
    """Of the processes of a simulation of our own; none where they need a network first, or it is asked for rarely."""
    if section.name != SIMULATED or section.drives is not Drives.SIM:
        return ()
    if section.pace is not Pace.FAST:
        return "world", "controller"
    return ("simulation",) if section.processes is Processes.TOGETHER else ()
