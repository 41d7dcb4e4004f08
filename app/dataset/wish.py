"""What a dataset shall be: of which games, in which format, how often, from which views.

Without Pydantic: the command line has its defaults from here, and ``--help`` would take twice as long.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Final

SIDES: Final = (64, 4096)  # least and most of a picture's sides [px]: an encoder for AV1 takes no smaller ones
RATES: Final = (1, 1000)  # least and most frames a second: the controller, of which signals are, runs at 1 kHz


class DatasetFormat(StrEnum):
    """How episodes are written."""

    LEROBOT = "lerobot"
    """LeRobot's v3.0: Parquet and MP4, many episodes a file."""
    MCAP = "mcap"
    """One file an episode, for Foxglove, PlotJuggler and readers of one's own."""


@dataclass(frozen=True, kw_only=True)
class DatasetWish:
    """What is asked for.

    Raises:
        ValueError: of a size or rate that no dataset can have.
    """

    source: Path
    """A game, a match, a campaign, or a folder of such."""
    output: Path
    """Folder of the dataset, which must not be there yet."""
    format: DatasetFormat = DatasetFormat.LEROBOT
    fps: int = 25
    """Frames a second of plant time; whole, as LeRobot's schema has it; within ``RATES``."""
    views: tuple[str, ...] = ("camera",)
    """Views that are drawn, as ``touchmove film --camera`` names them; empty: no pictures."""
    width: int = 320
    """Of a picture [px]; even, as codecs want it, and within ``SIDES``."""
    height: int = 240
    """Likewise."""
    fine: bool = False
    """Smooth edges and shadows, for three times the time."""
    failures: bool = False
    """Also plies after which a piece stood wrong, or something else failed; ``next.success`` tells them."""

    def __post_init__(self) -> None:
        for side in (self.width, self.height):
            if not SIDES[0] <= side <= SIDES[1] or side % 2:
                raise ValueError(f"a side of {side} px cannot be, sides are even, from {SIDES[0]} to {SIDES[1]} px")
        if not RATES[0] <= self.fps <= RATES[1]:
            raise ValueError(f"{self.fps} frames a second cannot be, there are {RATES[0]} to {RATES[1]}")
