"""Folders of games that are being played, which go with the game; of one whose worker was killed, soon after.

A folder belongs to whoever holds the lock on a file in it. The lock goes with its process, however that ends: what it
has left, a world that waits for another program included, is then ended and cleared away by whoever comes next.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import signal
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Final

from app.campaign.troubles import MachineTrouble

PREFIX: Final = "touchmove-game-"
_OWNER: Final = ".owner"


@contextmanager
def scratch_folder(seed: int) -> Iterator[Path]:
    """A folder for a game; gone afterwards, with whatever still runs in it.

    Raises:
        MachineTrouble: there is no room for one.
    """
    with ExitStack() as stack:
        try:
            folder = _owned(seed, stack)
        except OSError as error:
            raise MachineTrouble(f"no folder for a game can be made ({error.strerror})") from error
        yield folder


def _owned(seed: int, stack: ExitStack) -> Path:
    """A new folder of this process, which the end of the stack clears away."""
    clear_left_behind()
    folder = Path(tempfile.mkdtemp(prefix=f"{PREFIX}{seed}-"))
    stack.callback(_clear, folder)
    new = folder / f"{_OWNER}.new"
    owner = stack.enter_context(new.open("wb"))
    fcntl.flock(owner, fcntl.LOCK_EX)
    new.rename(folder / _OWNER)  # whoever finds it finds it locked
    return folder


def clear_left_behind() -> None:
    """End and clear away what killed workers of this user have left on this machine."""
    for folder in Path(tempfile.gettempdir()).glob(f"{PREFIX}*"):
        with suppress(OSError), (folder / _OWNER).open("rb") as owner:  # gone meanwhile, or somebody else's
            if folder.stat().st_uid == os.getuid():
                fcntl.flock(owner, fcntl.LOCK_EX | fcntl.LOCK_NB)
                _clear(folder)


def _clear(folder: Path) -> None:
    for pid in running_in(folder):
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    shutil.rmtree(folder, ignore_errors=True)


def running_in(folder: Path) -> list[int]:
    """Processes of this user that have something in a folder on their command line, but for this one."""
    mark, found = os.fsencode(folder.resolve()), []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal() and int(entry.name) != os.getpid():
            with suppress(OSError):
                if mark in (entry / "cmdline").read_bytes():
                    found.append(int(entry.name))
    return found
