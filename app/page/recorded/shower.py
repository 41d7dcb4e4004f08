"""What the page shows of recorded games: made when it is asked for, packed, and kept while nothing changes."""

from __future__ import annotations

import asyncio
import gzip
import hashlib
import sys
from collections import OrderedDict
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Self

from app import UserError
from app.analysis.kept import ANALYSIS_FILE
from app.page.recorded.catalogue import RecordPlace, match_of_record
from app.records.files import EVENTS_FILE, FILM_FILE, RecordError
from app.records.robot import ROBOT_FILE
from app.records.telemetry import TELEMETRY_FILE

JSON: Final = "application/json"
HTML: Final = "text/html; charset=utf-8"
LARGEST: Final = 1 << 25
"""Of all that is kept, packed [bytes]."""
LEVEL: Final = 6
"""Of packing, as gzip counts it."""
PATIENCE: Final = 120.0
"""What is not made by then is not made [s, wall]."""
MOST: Final = 16
"""Wishes at once, one of them being made."""
MAKER: Final = "app.page.recorded.maker"


@dataclass(frozen=True, slots=True)
class Made:
    """An answer."""

    packed: bytes
    """By gzip."""
    kind: str
    """Its media type."""
    tag: str
    """Changes with its content."""

    @classmethod
    def of(cls, content: bytes, kind: str) -> Self:
        """Of what is answered."""
        tag = hashlib.blake2b(content, digest_size=12).hexdigest()
        return cls(gzip.compress(content, LEVEL, mtime=0), kind, f'"{tag}"')


class TooMuchWanted(UserError):
    """More is asked for than can be made soon."""


class RecordShower:
    """Makes answers about records, one after the other; what was made of the same files before is there already."""

    def __init__(self) -> None:
        self._kept: OrderedDict[tuple[object, ...], Made] = OrderedDict()
        self._making = asyncio.Lock()
        self._wanted = 0

    async def record(self, place: RecordPlace) -> Made:
        """``record.json``.

        Raises:
            TooMuchWanted: as the others.
            RecordError: it cannot be read.
        """
        files = tuple(place.folder / name for name in (EVENTS_FILE, ROBOT_FILE, FILM_FILE, ANALYSIS_FILE))
        wanted = ("record", str(place.folder), place.id, str(place.number), "sets up" if place.sets_up else "")
        return await self._made(wanted, files, JSON, lambda: _run(*wanted))

    async def robot(self, folder: Path | None, tick: float) -> Made:
        """``robot.json`` of the record in a folder; None: of the usual robot. With ticks of so long [s].

        Raises:
            RecordError: what the record says of it cannot be read.
        """
        files = () if folder is None else (folder / ROBOT_FILE,)
        name = "" if folder is None else str(folder)
        return await self._made(("robot", tick), files, JSON, lambda: _run("robot", name, str(tick)))

    async def telemetry(self, place: RecordPlace, since: float, until: float) -> Made:
        """``telemetry.json`` of a span of plant time [s].

        Raises:
            RecordError: there is none, or it cannot be read.
        """
        match = match_of_record(place.folder)
        files = (place.folder / EVENTS_FILE, *sorted(match.glob(f"{Path(TELEMETRY_FILE).stem}*.mcap")))
        wanted = ("telemetry", str(place.folder), str(since), str(until))
        return await self._made(wanted, files, JSON, lambda: _run(*wanted))

    async def report(self, place: RecordPlace) -> Made:
        """``report.html``.

        Raises:
            RecordError: the record cannot be read.
        """
        files = tuple(place.folder / name for name in (EVENTS_FILE, ROBOT_FILE, ANALYSIS_FILE))
        return await self._made(("report",), files, HTML, lambda: _run("report", str(place.folder)))

    async def _made(
        self, what: tuple[object, ...], files: tuple[Path, ...], kind: str, make: Callable[[], Awaitable[bytes]]
    ) -> Made:
        """Made of files, unless it was made of the same ones before."""
        if self._wanted >= MOST:
            raise TooMuchWanted(f"{MOST} such requests are already running: try again in a moment")
        self._wanted += 1
        try:
            return await self._made_in_turn(what, files, kind, make)
        finally:
            self._wanted -= 1

    async def _made_in_turn(
        self, what: tuple[object, ...], files: tuple[Path, ...], kind: str, make: Callable[[], Awaitable[bytes]]
    ) -> Made:
        async with self._making:
            key = (*what, *((file, _version(file)) for file in files))
            if (kept := self._kept.get(key)) is not None:
                self._kept.move_to_end(key)
                return kept
            content = await make()
            made = self._kept[key] = await asyncio.to_thread(Made.of, content, kind)
            while len(self._kept) > 1 and sum(len(one.packed) for one in self._kept.values()) > LARGEST:
                self._kept.popitem(last=False)
            return made


def _version(file: Path) -> tuple[int, int] | None:
    try:
        status = file.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size


async def _run(*wanted: str) -> bytes:
    """Have something made by a process of its own, which does not outlive the wish.

    Raises:
        RecordError: it cannot be made; the message is the sentence that the process said.
    """
    maker = await asyncio.create_subprocess_exec(
        sys.executable, "-P", "-m", MAKER, *wanted, stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
    )  # fmt: skip
    try:
        made, said = await asyncio.wait_for(maker.communicate(), PATIENCE)
    except TimeoutError as error:
        raise RecordError(f"the {wanted[0]} was not made within {PATIENCE:g} s: is the record very long?") from error
    finally:
        if maker.returncode is None:
            maker.kill()
            await maker.wait()
    if maker.returncode == 0:
        return made
    if maker.returncode == 2:
        raise RecordError(said.decode(errors="replace").strip())
    raise RuntimeError(f"{MAKER} {' '.join(wanted)} ended with {maker.returncode}: {said.decode(errors='replace')}")
