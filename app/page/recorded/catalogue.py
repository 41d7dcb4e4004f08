"""The recorded games in a folder: which there are, and what each of them is, at a glance."""

from __future__ import annotations

import json
import stat
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

from app.page.recorded.game_fold import UNDECIDED
from app.records.files import EVENTS_FILE, FILM_FILE, ROUND_FOLDER
from app.records.telemetry import TELEMETRY_FILE

MOST: Final = 500
"""Of the newest records so many are listed."""


@dataclass(frozen=True, slots=True)
class RecordPlace:
    """A record: how the page's addresses name it, and where it lies."""

    id: str
    """One part of an address, for any name of a folder."""
    folder: Path
    """With its events."""
    number: int
    """Of the game in its match, from 1."""
    sets_up: bool
    """No game, but what was set up for one."""


class Catalogue:
    """Finds the records below some folders; each holds matches, or is one.

    Args:
        folders: of matches; of two records with one name that of the first counts.
    """

    def __init__(self, *folders: Path) -> None:
        self._folders = list(folders)
        self._known: dict[Path, tuple[tuple[int, int], dict[str, Any]]] = {}
        self._ids: dict[Path, str] = {}

    def add(self, match: Path) -> None:
        """A match that may lie elsewhere; nothing is done where it lies in one of the folders."""
        if match not in self._folders and match.parent not in self._folders:
            self._folders.append(match)

    def places(self) -> dict[str, RecordPlace]:
        """All records by name, the newest match first."""
        found: dict[str, RecordPlace] = {}
        for folder in self._folders:
            for match in sorted(_matches(folder), key=_begun, reverse=True):
                for place in _rounds(match):
                    found.setdefault(place.id, place)
        return found

    def find(self, record: str) -> RecordPlace | None:
        """The record of a name; None: there is none. No name leads elsewhere than to a record that is listed."""
        return self.places().get(record)

    def id_of(self, folder: Path) -> str:
        """Name of the record in a folder, also of one that is only about to be made."""
        if (known := self._ids.get(folder)) is not None:
            return known
        for place in self.places().values():
            if place.folder == folder:
                self._ids[folder] = place.id
                return place.id
        return _id(match_of_record(folder), folder)

    def games(self) -> list[dict[str, Any]]:
        """What ``GET /games`` answers."""
        shown = []
        for place in [*self.places().values()][:MOST]:
            file = place.folder / EVENTS_FILE
            try:
                status = file.stat()
                key = (status.st_mtime_ns, status.st_size)
                known = self._known.get(place.folder)
                if known is None or known[0] != key:
                    known = self._known[place.folder] = key, _glance(file)
            except OSError:  # it was taken away meanwhile, or others have locked it
                continue
            shown.append({
                "id": place.id, "number": place.number, "sets_up": place.sets_up, **known[1],
                "film": (place.folder / FILM_FILE).is_file(),
                "telemetry": telemetry_file(place.folder).is_file(),
            })  # fmt: skip
        return shown


def match_of_record(folder: Path) -> Path:
    """Folder of the match that a record belongs to: its own, or the one around it."""
    return folder.parent if ROUND_FOLDER.fullmatch(folder.name) else folder


def telemetry_file(folder: Path) -> Path:
    """The telemetry of a record: that of its match."""
    return match_of_record(folder) / TELEMETRY_FILE


def _matches(folder: Path) -> Iterator[Path]:
    """The matches in a folder, or the folder itself if it is one."""
    if _is_match(folder):
        yield folder
    else:
        yield from (one for one in _inside(folder) if _is_match(one))


def _is_match(folder: Path) -> bool:
    return any(_modified(one / EVENTS_FILE) is not None for one in (folder, *_later(folder)))


def _later(match: Path) -> list[Path]:
    """Folders of the rounds after the first."""
    return [one for one in _inside(match) if ROUND_FOLDER.fullmatch(one.name)]


def _inside(folder: Path) -> list[Path]:
    """What is in a folder; nothing in one that is none, or that others have locked."""
    try:
        return list(folder.iterdir())
    except OSError:
        return []


def _modified(file: Path) -> float | None:
    """When a file was changed last [s since 1970]; None: it is none, or cannot be reached."""
    try:
        status = file.stat()
    except OSError:
        return None
    return status.st_mtime if stat.S_ISREG(status.st_mode) else None


def _begun(match: Path) -> float:
    """When the last record of a match was written last."""
    return max((_modified(one / EVENTS_FILE) or 0.0 for one in (match, *_later(match))), default=0.0)


def _rounds(match: Path) -> Iterator[RecordPlace]:
    """The records of a match, in their order."""
    rounds = []
    for folder in (match, *_later(match)):
        found = ROUND_FOLDER.fullmatch(folder.name) if folder != match else None
        number = 1 if found is None else int(found["number"])
        sets_up = found is not None and found["kind"] != "game"
        rounds.append(RecordPlace(_id(match, folder), folder, number, sets_up))
    for place in sorted(rounds, key=lambda one: (one.number, not one.sets_up)):
        if _modified(place.folder / EVENTS_FILE) is not None:
            yield place


def _id(match: Path, folder: Path) -> str:
    """A name in one part of an address: no stroke, no dot alone, and nothing that a browser would write otherwise."""
    names = (match.name,) if folder == match else (match.name, folder.name)
    return "~".join(quote(name, safe="").replace("%", "=").replace("~", "=7E") for name in names) or "~"


def _glance(file: Path) -> dict[str, Any]:
    """What the list says of a record, without reading all of it closely; null where it cannot be read."""
    lines = file.read_bytes().splitlines()
    first, last = _object(lines[:1]), _object(lines[-1:]) or _object(lines[-2:-1])  # the last one may be cut off
    ended = last.get("event") == "end"
    return {
        "white": _text(first, "white"), "black": _text(first, "black"), "began": _text(first, "wall_time"),
        "start": _text(first, "fen"), "plies": _plies(last),
        "result": _text(last, "result") if ended else UNDECIDED, "reason": _text(last, "reason") if ended else None,
    }  # fmt: skip


def _plies(last: dict[str, Any]) -> int:
    """How many count after the last event; the steps of a ply say which it will be."""
    plies = last.get("ply")
    return max(0, plies - (last.get("event") == "step")) if isinstance(plies, int) else 0


def _text(event: dict[str, Any], name: str) -> str | None:
    """A field that is text, and can be sent as such."""
    found = event.get(name)
    return found.encode(errors="replace").decode() if isinstance(found, str) else None


def _object(lines: list[bytes]) -> dict[str, Any]:
    try:
        found = json.loads(lines[0]) if lines else None
    except (ValueError, RecursionError):  # the latter: nested more deeply than Python reads
        found = None
    return found if isinstance(found, dict) else {}
