"""Folders of a match: the first game lies in the match's own, set-ups and further games beside its files."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

from app.records.files import EVENTS_FILE

_ROUND: Final = re.compile(r"(game|set-up)-(\d+)")


def match_folder(folder: Path) -> Path:
    """The folder of the match that a round belongs to: its own, or the one above."""
    folder = folder.resolve()
    return folder.parent if _ROUND.fullmatch(folder.name) and (folder.parent / EVENTS_FILE).is_file() else folder


def rounds_of(match: Path) -> tuple[Path, ...]:
    """Folders of the rounds of a match that have a record: the first game's, then set-ups and games by their number."""
    found = [(1, 1, match)] if (match / EVENTS_FILE).is_file() else []
    for inner in sorted(match.iterdir()) if match.is_dir() else ():
        name = _ROUND.fullmatch(inner.name)
        if name is not None and (inner / EVENTS_FILE).is_file():
            found.append((int(name[2]), int(name[1] == "game"), inner))
    return tuple(folder for _, _, folder in sorted(found))
