"""What the page shows of recorded games: made when it is asked for, packed, and kept while nothing changes."""

from __future__ import annotations

import gzip
import hashlib
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Self

from app.page.live.hub import encoded
from app.page.recorded.catalogue import RecordPlace
from app.page.recorded.record import record_shown
from app.records.events import read_events
from app.records.files import EVENTS_FILE
from hardware.table import TableSettings

JSON: Final = "application/json"
LARGEST: Final = 1 << 25
"""What is kept, packed [bytes]."""
LEVEL: Final = 6
"""Of packing, as gzip counts it."""


@dataclass(frozen=True, slots=True)
class Made:
    """An answer.

    Attributes:
        packed: by gzip.
        kind: its media type.
        tag: changes with its content.
    """

    packed: bytes
    kind: str
    tag: str

    @classmethod
    def of(cls, content: bytes, kind: str) -> Self:
        """Of what is answered."""
        tag = hashlib.blake2b(content, digest_size=12).hexdigest()
        return cls(gzip.compress(content, LEVEL, mtime=0), kind, f'"{tag}"')


Key = tuple[str, Path, tuple[int, int]]


class RecordShower:
    """Makes answers about records; its methods take long and are called one at a time.

    Args:
        table: of a record that lies in a folder.
    """

    def __init__(self, table: Callable[[Path], TableSettings]) -> None:
        self._table = table
        self._kept: OrderedDict[Key, Made] = OrderedDict()

    def record(self, place: RecordPlace) -> Made:
        """``record.json``.

        Raises:
            RecordError: it cannot be read.
        """

        def make() -> bytes:
            events = read_events(place.folder / EVENTS_FILE)
            return encoded(record_shown(place, events, self._table(place.folder))).encode()

        return self._made("record", place.folder / EVENTS_FILE, JSON, make)

    def _made(self, what: str, file: Path, kind: str, make: Callable[[], bytes]) -> Made:
        """Made of a file, unless it was made of the same one before."""
        status = file.stat()
        key = what, file, (status.st_mtime_ns, status.st_size)
        if (kept := self._kept.get(key)) is not None:
            self._kept.move_to_end(key)
            return kept
        made = self._kept[key] = Made.of(make(), kind)
        while len(self._kept) > 1 and sum(len(one.packed) for one in self._kept.values()) > LARGEST:
            self._kept.popitem(last=False)
        return made
