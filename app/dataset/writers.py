"""What writes episodes, whatever the format."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from app.dataset.demonstrations import Demonstration
from app.records.robot import RobotRecord

Shown = Mapping[str, NDArray[np.uint8]]
"""Of one frame: RGB (height, width, 3) by the name of the view."""


class EpisodeWriter(Protocol):
    """Takes episodes frame by frame, and keeps none of them in memory."""

    def begin(self, episode: Demonstration, robot: RobotRecord | None) -> None:
        """An episode, and what it was played on, where that is known."""

    def show(self, frame: int, shown: Shown) -> None:
        """What is seen at its next frame, from 0."""

    def end(self) -> None:
        """All of its frames were shown, where pictures are wanted."""

    def close(self) -> None:
        """There are no more episodes: the dataset is whole."""

    def drop(self) -> None:
        """There is no use for what was written: let go of the files."""


def folder_size(folder: Path) -> int:
    """Of all files in a folder [bytes]."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
