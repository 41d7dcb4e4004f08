"""Pictures of a record by their names: only its own are ever opened, whatever an event calls them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

from app.records.game import FRAMES

_PICTURE: Final = re.compile(re.escape(FRAMES) + r"/ply-(\d+)\.jpg")


def frame_file(folder: Path, ply: int, name: str | None) -> Path | None:
    """The picture that an event names, if it is one of the record's own and there; without a name, that of its ply."""
    name = name or f"{FRAMES}/ply-{ply:03d}.jpg"
    path = folder / name
    return path if _PICTURE.fullmatch(name) and path.is_file() else None
