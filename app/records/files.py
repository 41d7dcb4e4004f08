"""Files of a record: nothing written is lost, and a full disk is one clear sentence."""

from __future__ import annotations

import errno
import fcntl
import json
import os
import re
import stat
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path
from typing import Final

from app import UserError

EVENTS_FILE = "events.jsonl"
FILM_FILE: Final = "game.webm"
"""In the folder of a match: its first minute, filmed in a simulation."""
TRAJECTORY_FILE: Final = "positions.bin"
"""Beside it: where everything was in a simulation, from which films are drawn (``hardware.sim.plant.trajectory``)."""
ROUND_FOLDER: Final = re.compile(r"(?P<kind>game|set-up)-(?P<number>\d{1,6})")
"""Names of folders in that of a match: its later games, and what was set up for them."""
GAMES: Final = Path("games")
"""Where records of games lie unless another folder is named."""
GAME: Final = "game"
"""Name of a record where other things of the same game are beside it, as a campaign keeps it."""
AGAIN: Final = "-again"
"""Ends the name of a game that was played once more."""
_FULL = {errno.ENOSPC: "no space left on the device", errno.EDQUOT: "the disk quota is used up"}


class RecordError(UserError):
    """A file of the record cannot be written or read."""


class NotWritten(RecordError):
    """A file could not be written.

    Attributes:
        trouble: which and why, without what can be done about it: that may depend on what was written before.
    """

    def __init__(self, trouble: str, remedy: str) -> None:
        super().__init__(f"{trouble}: {remedy}")
        self.trouble = trouble


_ELSEWHERE: Final = "choose another folder with --out"
_BEGINNING: Final = 4096
"""Of a file: so much says what kind it is [bytes]."""
_ROOM: Final = 1 << 24
"""What a simulation may need for its model, its state and its pictures [bytes]; with less it is not begun."""


def full_disk(folder: Path) -> str | None:
    """What there is to say of a disk without room for a simulation in a folder; None: it has room."""
    path = folder / ".room"
    try:
        with path.open("wb") as file:
            os.posix_fallocate(file.fileno(), 0, _ROOM)
    except OSError as error:
        if error.errno not in _FULL:
            return None
        return (
            f"the disk at {_disk_of(folder)} has less than {_ROOM >> 20} MiB left for {folder}: "
            f"free some space or {_ELSEWHERE}"
        )
    finally:
        with suppress(OSError):
            path.unlink()
    return None


def _disk_of(path: Path) -> Path:
    """Where the file system of a path is mounted."""
    return next(one for one in (path, *path.absolute().parents) if one.is_mount())


@contextmanager
def recording(path: Path, remedy: str = _ELSEWHERE) -> Iterator[None]:
    """Turn a failure of the file system into a sentence about ``path``; for any file of a record, also a video.

    Args:
        path: what is written.
        remedy: what a person can do about it.

    Raises:
        NotWritten: the disk is full, or the path cannot be written.
    """
    try:
        yield
    except OSError as error:
        if error.errno in _FULL:
            path = path.absolute()
            full = f"{path}: {_FULL[error.errno]} (the disk at {_disk_of(path)})"
            raise NotWritten(full, f"free some space or {remedy}") from error
        raise NotWritten(f"{path}: {error.strerror or error}", remedy) from error


def make(folder: Path) -> None:
    """Make a folder and those above it, where they are missing; ``OSError``: it cannot be made."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError as error:
        raise FileExistsError(error.errno, "this is a file, and a folder is needed") from error


def check_folder(folder: Path, remedy: str = _ELSEWHERE) -> None:
    """Make a folder, and see before the work is done whether files can be made in it.

    Raises:
        RecordError: they cannot.
    """
    with recording(folder, remedy):
        make(folder)
        tempfile.TemporaryFile(dir=folder).close()


def check_output(path: Path, kind: str, mark: bytes, option: str = "--out") -> None:
    """See before the work is done whether a file that a person may name can be written; its folder is made.

    It may replace its like, or an empty file, but nothing else: what lies there may be the only copy of a game.

    Args:
        path: of the file.
        kind: what is written, such as "a film".
        mark: what all files of the kind contain, near their beginning.
        option: that names the file.

    Raises:
        RecordError: it cannot be written, or is of another kind.
    """
    remedy = f"choose another file with {option}"
    with recording(path, remedy):
        if path.is_dir():
            raise RecordError(f"{path} is a folder: name a file in it with {option}")
        if path.exists() and not path.is_file():  # a device or a pipe would be replaced as well
            raise RecordError(f"{path} is not an ordinary file: {remedy}")
        if path.exists():
            with path.open("rb") as file:
                beginning = file.read(_BEGINNING)
            if beginning and mark not in beginning:
                raise RecordError(f"{path} exists and is not {kind}: {remedy}")
    check_folder(path.parent, remedy)


def new_folder(parent: Path, now: datetime) -> Path:
    """Make a folder named after a time in UTC in the folder of all games, which is made if it is missing.

    Where that name is taken, ``-2``, ``-3``, ... follow it.

    Raises:
        RecordError: it cannot be made.
    """
    name = now.strftime("%Y-%m-%dT%H-%M-%SZ")
    with recording(parent):
        make(parent)
    number = 1
    while True:
        folder = parent / (name if number == 1 else f"{name}-{number}")
        with recording(folder):
            try:
                folder.mkdir()
            except FileExistsError:
                number += 1
                continue
            _sync_folder(parent)
        return folder


def write_atomically(path: Path, content: str | bytes, remedy: str = _ELSEWHERE) -> None:
    """Replace a file as a whole: a reader, also after a crash, finds the old content or the new one.

    ``remedy`` is what a person can do where that fails.

    Raises:
        RecordError: it cannot be written; the old file is as it was.
    """
    part = path.with_name(path.name + ".part")
    with recording(path, remedy):
        try:
            with part.open("wb") as file:
                file.write(content.encode() if isinstance(content, str) else content)
                file.flush()
                os.fsync(file.fileno())
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
        _sync_folder(path.parent)


def whole_lines(content: bytes) -> tuple[list[bytes], bytes]:
    """The lines of a log of JSON objects, and what is left out at its end: a last line that is none.

    A crash may cut the last line short, and a computer that loses its power may leave anything in its place.
    """
    lines = content.split(b"\n")
    if not lines[-1]:
        lines.pop()
    if not lines:
        return [], b""
    return (lines, b"") if is_object(lines[-1]) else (lines[:-1], lines[-1] or b"\n")


def is_object(content: bytes) -> bool:
    """Whether this is a JSON object; what one of our programs has written and is none, was damaged since."""
    try:
        return isinstance(json.loads(content), dict)
    except (ValueError, RecursionError):
        return False


def make_folder(folder: Path) -> None:
    """Make the folder of a game whose record begins later.

    Raises:
        RecordError: it cannot be made, or holds a game already.
    """
    with recording(folder):
        make(folder)
        if (folder / EVENTS_FILE).exists():
            raise _occupied(folder / EVENTS_FILE)


def _occupied(path: Path) -> RecordError:
    return RecordError(f"{path} already holds the record of another game: choose another folder with --out")


class LineLog:
    """A file that only grows, line by line; a thread writes to the disk what nobody waits for."""

    def __init__(self, path: Path, *, go_on: bool = False) -> None:
        """Open a log.

        Args:
            path: the file.
            go_on: it holds lines already, and a last one that cannot be read is taken back.

        Raises:
            RecordError: it cannot be opened, or holds something already.
        """
        self.path = path
        self._wanted = threading.Event()
        """Something is to be synced, or the log is being closed."""
        self._syncer: threading.Thread | None = None
        self._closing = False
        self._failed: OSError | None = None
        """Why the last lines may not be on the disk."""
        with recording(path):
            self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
            self._size = os.fstat(self._file).st_size
            _sync_folder(path.parent)
        self._lock()
        if go_on:
            with recording(path):
                self._mend(path.read_bytes())
        elif self._size:
            self.close()
            raise _occupied(path)

    def _lock(self) -> None:
        """One program at a time; the lock goes with the process."""
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            self.close()
            raise RecordError(f"{self.path} is being written by another program: wait for it, or end it") from error

    def _mend(self, content: bytes) -> None:
        """Take back a last line that was cut short or garbled, or end one that is whole but for its end."""
        lines, left_out = whole_lines(content)
        self._size = sum(len(line) + 1 for line in lines)
        if left_out:
            self._take_back()
        elif self._size > len(content):
            self._write(b"\n", durable=True)

    def append(self, line: str, *, durable: bool = True) -> None:
        """Write one line, which no death of this process loses.

        Args:
            line: without its end.
            durable: wait until it is on the disk, so that no power cut loses it either; else it is there soon, within
                some ten milliseconds as a rule.

        Raises:
            RecordError: it cannot be written; the lines before it stay, and what was written of it is taken back. Or
                an earlier line has not come to the disk.
            ValueError: the log is closed.
        """
        if self._file < 0:
            raise ValueError(f"{self.path} is closed")
        data = line.encode() + b"\n"
        with recording(self.path):
            if self._failed is not None:
                raise self._failed
            try:
                self._write(data, durable)
            except OSError:
                self._take_back()
                raise
        self._size += len(data)

    def close(self) -> None:
        """Close the file; a second call does nothing."""
        if self._syncer is not None:
            self._closing = True
            self._wanted.set()
            self._syncer.join()
            self._syncer = None
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def _write(self, data: bytes, durable: bool) -> None:
        rest = memoryview(data)
        while rest:  # a disk that fills up takes a part of the line first and refuses the next write
            rest = rest[os.write(self._file, rest) :]
        if durable:
            os.fsync(self._file)
        else:
            if self._syncer is None:
                self._syncer = threading.Thread(target=self._sync, name=f"sync {self.path.name}", daemon=True)
                self._syncer.start()
            self._wanted.set()

    def _sync(self) -> None:
        while self._wanted.wait() and not self._closing:
            self._wanted.clear()
            try:
                os.fsync(self._file)
            except OSError as error:
                self._failed = error

    def _take_back(self) -> None:
        if stat.S_ISREG(os.fstat(self._file).st_mode):  # a device cannot be cut, and keeps nothing
            os.ftruncate(self._file, self._size)


def _sync_folder(folder: Path) -> None:
    """Make new names in a folder durable."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
