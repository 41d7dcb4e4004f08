"""What a dataset shall be: of which games, in which format, how often, from which views."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

from pydantic import Field

from hardware.frozen import FrozenFinite

Side = Annotated[int, Field(ge=64, le=4096, multiple_of=2)]
"""Of a picture [px]: even, as codecs want it, and no smaller than an encoder for AV1 takes."""


class DatasetFormat(StrEnum):
    """How episodes are written."""

    LEROBOT = "lerobot"
    """LeRobot's v3.0: Parquet and MP4, many episodes a file."""
    MCAP = "mcap"
    """One file an episode, for Foxglove, PlotJuggler and readers of one's own."""


class DatasetWish(FrozenFinite):
    """What is asked for."""

    source: Path
    """A game, a match, a campaign, or a folder of such."""
    output: Path
    """Folder of the dataset, which must not be there yet."""
    format: DatasetFormat = DatasetFormat.LEROBOT
    fps: Annotated[int, Field(ge=1, le=1000)] = 25
    """Frames a second of plant time; whole, as LeRobot's schema has it."""
    views: tuple[str, ...] = ("camera",)
    """Views that are drawn, as ``touchmove film --camera`` names them; empty: no pictures."""
    width: Side = 320
    """Of a picture [px]."""
    height: Side = 240
    """Of a picture [px]."""
    fine: bool = False
    """Smooth edges and shadows, for three times the time."""
    failures: bool = False
    """Also plies after which a piece stood wrong, or something else failed; ``next.success`` tells them."""
