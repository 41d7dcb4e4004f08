"""A film of a game in WebM (VP9), which any browser plays: drawn from its recorded positions, at any time.

A process of its own draws, behind everything else: drawing takes a core and a half, and may be broken off.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Annotated, Final

from pydantic import Field, NonNegativeFloat, PositiveFloat

from app import UserError
from app.records.files import FILM_FILE, TRAJECTORY_FILE, check_output, recording
from hardware.frozen import FrozenFinite
from hardware.interfaces import HardwareError
from hardware.sim.bodies.scene import CAMERAS
from hardware.sim.plant.trajectory import TrajectoryFile

Point = tuple[float, float, float]
Side = Annotated[int, Field(ge=16, le=4096, multiple_of=2)]
FIELD_OF_VIEW: Final = 46.0
"""Of a view from anywhere, vertical [°]."""
SUFFIX: Final = ".webm"
"""Ends the name of every film."""
_MARK: Final = b"\x1aE\xdf\xa3"
"""Begins every film: that of EBML, which WebM is."""
ELSEWHERE: Final = "choose another file with --output of 'touchmove film'"
"""What can be done about a film that cannot be written; also about one that was to be drawn after a game."""
FARTHEST: Final = 100.0
"""That a view from anywhere, or its target, may be from the board [m]."""
_UNFINISHED: Final = ".part"
"""What a film is called while it is drawn, after its name."""


class Standpoint(FrozenFinite):
    """A view from anywhere: position and what is looked at, board frame [m]."""

    position: Point
    target: Point


class FilmWish(FrozenFinite):
    """What is to be drawn."""

    positions: Path
    """The game's ``positions.bin``."""
    output: Path
    """The film; one of the name is replaced, but nothing else."""
    camera: str | Standpoint = "film"
    """A view of the simulation, or one from anywhere."""
    width: Side = 640
    """[px]"""
    height: Side = 480
    """[px]"""
    begin: NonNegativeFloat = 0.0
    """So long after the first frame [s]."""
    length: PositiveFloat | None = None
    """No longer than this [s]; None: to the end."""
    fine: bool = False
    """Smooth edges and shadows, for three times the time."""


Progress = Callable[[float, float], None]
"""Told how much of a film is drawn, and how much there is [s]."""


class FilmFailed(UserError):
    """A film could not be drawn; says why."""


def positions_of(folder: Path) -> Path:
    """The recorded positions of a game's folder.

    Raises:
        UserError: there are none.
    """
    path = folder / TRAJECTORY_FILE
    if not path.is_file():
        raise UserError(
            f"there is nothing to film in {folder}: simulations that are drawn and filmed record positions, as "
            "'touchmove demo' does without --no-video and --no-cameras"
        )
    return path


def standpoint(text: str) -> str | Standpoint:
    """A view by its name, or ``X,Y,Z:X,Y,Z``: from where, at what; board frame [m].

    Raises:
        UserError: it is neither.
    """
    if text in CAMERAS:
        return text
    points = [part.split(",") for part in text.split(":")]
    try:
        (a, b, c), (d, e, f) = ((float(x), float(y), float(z)) for x, y, z in points)
    except ValueError:
        raise UserError(
            f"there is no view '{text}': choose {' or '.join(CAMERAS)}, or give viewpoint and target in metres, such "
            "as 0.5,-0.6,0.4:0,0,0.1"
        ) from None
    if not all(abs(value) <= FARTHEST for value in (a, b, c, d, e, f)):
        raise UserError(
            f"'{text}' does not lie within {FARTHEST:g} m of the board: give viewpoint and target in metres, such as "
            "0.5,-0.6,0.4:0,0,0.1"
        )
    if (a, b, c) == (d, e, f):
        raise UserError(f"'{text}' has its target at its viewpoint: give two different points")
    return Standpoint(position=(a, b, c), target=(d, e, f))


def default_output(folder: Path, camera: str | Standpoint) -> Path:
    """Where a film of a game lies unless it is said."""
    if camera == "film":
        return folder / FILM_FILE
    return folder / f"game-{camera if isinstance(camera, str) else 'view'}{SUFFIX}"


def draw_film(wish: FilmWish, progress: Progress) -> None:
    """Draw a film, in a process of its own; what was drawn is dropped if this is interrupted or fails.

    Raises:
        FilmFailed: nothing was recorded, or there is no OpenGL here.
        RecordError: the film cannot be written, or would replace what is no film.
    """
    if wish.output.suffix.lower() != SUFFIX and not wish.output.is_dir():
        raise FilmFailed(f"--output {wish.output}: a film is written as WebM: give its name the ending {SUFFIX}")
    check_output(wish.output, "a film", _MARK, "--output")
    try:
        if TrajectoryFile(wish.positions).span() is None:
            raise FilmFailed(f"{wish.positions} contains no frame yet: film the game once it has begun")
    except HardwareError as error:
        raise FilmFailed(str(error)) from error
    part = wish.output.with_name(wish.output.name + _UNFINISHED)
    unfinished = wish.model_copy(update={"output": part})
    with ExitStack() as leaving:
        leaving.callback(part.unlink, missing_ok=True)
        with _drawing(unfinished) as process:
            assert process.stdout is not None
            for line in process.stdout:
                done, whole = line.split()
                progress(float(done), float(whole))
            assert process.stderr is not None
            last = process.stderr.read().strip().splitlines()[-1:]
        if process.returncode != 0:
            raise FilmFailed(last[0] if last else f"the film's process ended with status {process.returncode}")
        with recording(wish.output, ELSEWHERE):
            part.replace(wish.output)


@contextmanager
def _drawing(wish: FilmWish) -> Iterator[subprocess.Popen[str]]:
    """The process that draws; ended in any case. Ctrl-C does not reach it: who waits for it decides."""
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "app.rig.simulation.film_process", wish.model_dump_json()],
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    with process:
        try:
            yield process
            process.wait()
        finally:
            process.kill()
