"""The events of a match as they are written, from the files alone: nobody who plays has to tell whoever records."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from app.records.events import AnyEvent, read_event
from app.records.files import EVENTS_FILE
from app.records.rounds import rounds_of

_LOOK: Final = 1.0
"""So often a new round is looked for [s, wall]."""


@dataclass(slots=True)
class _TailedFile:
    path: Path
    read: int = 0
    """Bytes that were taken."""
    lines: int = 0
    waiting: deque[AnyEvent] = field(default_factory=deque)

    def fill(self) -> None:
        """Take the lines that are whole."""
        if self.path.stat().st_size <= self.read:
            return
        with self.path.open("rb") as file:
            file.seek(self.read)
            new = file.read()
        whole = new[: new.rfind(b"\n") + 1]
        self.read += len(whole)
        for line in whole.splitlines():
            self.lines += 1
            self.waiting.append(read_event(self.path, self.lines, line))


class RecordTail:
    """Events of all rounds in a folder in the order of their plant times, each once that is due."""

    def __init__(self, match: Path) -> None:
        """Of a match's folder, in which there may be nothing yet."""
        self._match = match
        self._files: dict[Path, _TailedFile] = {}
        self._due = 0.0

    def due(self, plant_time: float) -> Iterator[tuple[Path, AnyEvent]]:
        """Events up to a plant time [s] that were not given yet, each with the folder of its round.

        Raises:
            RecordError: a line is no event.
        """
        if time.monotonic() >= self._due:
            self._due = time.monotonic() + _LOOK
            for folder in rounds_of(self._match):
                self._files.setdefault(folder, _TailedFile(folder / EVENTS_FILE))
        for file in self._files.values():
            file.fill()
        while first := self._first(plant_time):
            folder, file = first
            yield folder, file.waiting.popleft()

    def _first(self, plant_time: float) -> tuple[Path, _TailedFile] | None:
        waiting = [(folder, file) for folder, file in self._files.items() if file.waiting]
        earliest = min(waiting, key=lambda one: one[1].waiting[0].plant_time, default=None)
        return earliest if earliest is not None and earliest[1].waiting[0].plant_time <= plant_time else None
