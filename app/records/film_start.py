"""When the film of a game begins: the film itself says so, and whoever shows it finds the moment of a frame."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import av
from av.error import FFmpegError

BEGINS: Final = "PLANT_TIME"
"""Tag of a film: plant time of its first frame [s]; WebM writes the names of tags in capitals."""


def film_begins(path: Path) -> float | None:
    """Plant time of a film's first frame [s]; None: it does not say so, or cannot be read (yet)."""
    try:
        with av.open(str(path)) as container:
            return float(container.metadata[BEGINS])
    except (FFmpegError, KeyError, ValueError):
        return None
