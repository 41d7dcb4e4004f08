"""A folder that appears as a whole, or not at all."""

from __future__ import annotations

import fcntl
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from app.records.files import RecordError, recording

_LOCK: Final = ".being-written"
"""In a folder that is not whole: locked while somebody writes it, so that one that was left behind is known."""


@contextmanager
def appearing(output: Path) -> Iterator[Path]:
    """A folder beside ``output``, which takes its name once all went well; else nothing is left of it.

    One that was left behind by a program that was killed is written anew.

    Raises:
        RecordError: there is something of that name, somebody else writes it, or it cannot be made.
    """
    output = output.absolute()
    if output.exists():
        raise RecordError(f"{output} is there already: choose another folder with --out, or delete it")
    part = output.with_name(f"{output.name}.part")
    lock = _claim(part)
    try:
        yield part
        with recording(output):
            (part / _LOCK).unlink()
            part.rename(output)
    finally:
        shutil.rmtree(part, ignore_errors=True)
        os.close(lock)


def _claim(part: Path) -> int:
    """Make the folder anew, and be the only one who writes it; the lock goes with the process."""
    with recording(part):
        if part.exists() and not (part / _LOCK).exists():
            raise RecordError(f"{part} is there, and no dataset left unfinished: delete it, or choose another --out")
        part.mkdir(parents=True, exist_ok=True)
        lock = os.open(part / _LOCK, os.O_CREAT | os.O_RDWR, 0o644)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        os.close(lock)
        raise RecordError(
            f"{part} is being written by another program: wait for it, or choose another --out"
        ) from error
    for left in part.iterdir():
        if left.name != _LOCK:
            shutil.rmtree(left) if left.is_dir() else left.unlink()
    return lock
