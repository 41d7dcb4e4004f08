"""Cameras of a simulated world that runs: its board's camera, and the stream of pictures that a film is made of."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from hardware.interfaces import Camera, Pace
from hardware.sim.clients.camera import FrameStream, SimCamera

FRAME_TICKS: Final = {Pace.FAST: 45, Pace.REAL: 135}
"""A frame each so many ticks of 0.88 ms: 25 a second; in pace real 8, to leave the cores to the plant's ticks."""


def board_camera(run_dir: Path) -> Camera:
    """The camera that looks at the board, of the world of a run directory.

    Raises:
        HardwareError: no world answers there, or it draws no pictures.
    """
    return SimCamera(run_dir)


def film_stream(run_dir: Path, pace: Pace) -> FrameStream:
    """Pictures of the whole scene for a film, at a steady rate of plant time. Raises as ``board_camera``."""
    return FrameStream(run_dir, "film", FRAME_TICKS[pace])
