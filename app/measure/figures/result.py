"""What a figure consists of: numbers, the bars they must hold, and pictures."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from pydantic import JsonValue

from app import UserError

Picture = Figure


Progress = Callable[[str], None]  # told what is being done


class Bar(NamedTuple):
    """A number with the range it must lie in; both ends belong to it."""

    value: float
    unit: str
    low: float = -math.inf
    high: float = math.inf

    @property
    def holds(self) -> bool:
        """Whether it lies there."""
        return self.low <= self.value <= self.high

    def as_json(self) -> dict[str, JsonValue]:
        """An open end is null."""
        low, high = (end if math.isfinite(end) else None for end in (self.low, self.high))
        return {"value": self.value, "unit": self.unit, "low": low, "high": high, "holds": self.holds}


class FigureResult(NamedTuple):
    """A figure as computed."""

    title: str
    bars: Mapping[str, Bar]  # by name; what the figure must show
    numbers: Mapping[str, JsonValue]  # everything else worth keeping, with units in the names
    pictures: Mapping[str, Picture]  # by suffix of the file's name; the main one has none

    @property
    def holds(self) -> bool:
        """Whether all bars hold."""
        return all(bar.holds for bar in self.bars.values())


class FolderUnusable(UserError):
    """Pictures cannot be written where they were asked for."""

    def __init__(self, folder: Path, reason: str) -> None:
        super().__init__(f"pictures cannot be written to {folder}: {reason}; choose another folder with --out")


def save(name: str, result: FigureResult, folder: Path) -> dict[str, JsonValue]:
    """Write ``figure-NAME.png`` and, beside it, what is returned as ``figure-NAME.json``, to a folder made if missing.

    Raises:
        FolderUnusable: the folder cannot be written.
    """
    pictures = {f"figure-{name}{suffix}.png": picture for suffix, picture in result.pictures.items()}
    content: dict[str, JsonValue] = {
        "figure": name,
        "title": result.title,
        "holds": result.holds,
        "pictures": list(pictures),
        "bars": {key: bar.as_json() for key, bar in result.bars.items()},
        "numbers": dict(result.numbers),
    }
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for file, picture in pictures.items():
            # a file is the same on every run: no date, no version in it
            FigureCanvasAgg(picture)
            picture.savefig(folder / file, metadata={"Software": None})
        (folder / f"figure-{name}.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise FolderUnusable(folder, error.strerror or str(error)) from error
    return content
