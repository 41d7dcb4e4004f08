"""Pictures of a simulated game at given ticks, drawn from its recorded positions as a film is, at any time.

A process of its own draws them, as it does films, and is never further ahead than a pipe holds.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Generator, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import NonNegativeInt

from app.rig.simulation.film import FilmFailed, Side, Standpoint
from hardware.frozen import FrozenFinite
from hardware.interfaces import HardwareError
from hardware.sim.plant.trajectory import TrajectoryFile

Pictures = tuple[NDArray[np.uint8], ...]
"""Of one tick: RGB (height, width, 3) of each view; good until the next ones are taken."""


class PicturesWish(FrozenFinite):
    """What is to be drawn."""

    positions: Path
    """The game's ``positions.bin``."""
    ticks: tuple[NonNegativeInt, ...]
    """Of recorded frames, never falling."""
    views: tuple[str | Standpoint, ...]
    """Views of the simulation, or from anywhere."""
    width: Side
    """[px]"""
    height: Side
    """[px]"""
    fine: bool = False
    """Smooth edges and shadows, for three times the time."""


def recorded_ticks(positions: Path) -> NDArray[np.int64]:
    """Ticks of all frames of ``positions.bin``, rising.

    Raises:
        FilmFailed: there are none, or it is no such file.
    """
    try:
        ticks = np.array([frame.tick for frame in TrajectoryFile(positions).frames()], dtype=np.int64)
    except HardwareError as error:
        raise FilmFailed(str(error)) from error
    if not len(ticks):
        raise FilmFailed(f"{positions} holds no frame: nothing can be drawn of this game")
    return ticks


def draw_pictures(wish: PicturesWish) -> Generator[Pictures]:
    """Pictures of each tick, one after the other.

    Raises:
        FilmFailed: there is no OpenGL here, or the positions are not of such a world.
    """
    shape = (len(wish.views), wish.height, wish.width, 3)
    size = len(wish.views) * wish.height * wish.width * 3
    with _drawing(wish) as process:
        assert process.stdout is not None
        for _ in wish.ticks:
            content = process.stdout.read(size)
            if len(content) < size:
                raise FilmFailed(_why(process))
            yield tuple(np.frombuffer(content, dtype=np.uint8).reshape(shape))


def _why(process: subprocess.Popen[bytes]) -> str:
    assert process.stderr is not None
    last = process.stderr.read().decode(errors="replace").strip().splitlines()[-1:]
    return last[0] if last else f"the process that draws ended with status {process.wait()}"


@contextmanager
def _drawing(wish: PicturesWish) -> Iterator[subprocess.Popen[bytes]]:
    """The process that draws; ended in any case. Ctrl-C does not reach it: who waits for it decides."""
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "app.rig.simulation.picture_process"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
    )  # fmt: skip
    with process:
        try:
            assert process.stdin is not None
            with (
                suppress(BrokenPipeError),
                process.stdin as told,
            ):  # why it has ended is found where pictures are missed
                told.write(wish.model_dump_json().encode())
            yield process
        finally:
            process.kill()
