"""The process that draws a film: ``python -m app.rig.simulation.film_process WISH``. Says on stdout how far it is.

It ends with the one that listens: then nobody reads what it says.
"""

from __future__ import annotations

import atexit
import gc
import math
import os
import queue
import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Final

import av
import numpy as np
from av.error import FFmpegError
from numpy.typing import NDArray

from app.records import RecordError, recording
from app.records.film_start import BEGINS
from app.rig.simulation.film import ELSEWHERE, FIELD_OF_VIEW, FilmWish, Standpoint
from hardware.interfaces import HardwareError
from hardware.sim.plant.trajectory import TrajectoryFile, TrajectoryFrame
from hardware.sim.process.construction import Construction
from hardware.sim.process.settings import WorldSettings
from hardware.sim.render.drawing import SceneDrawer
from hardware.sim.render.quality import FILM, LOOK
from hardware.sim.render.rasteriser import FreeView
from hardware.sim.render.settings import SceneState

NICE: Final = 15
"""Films step back behind everything else, also behind pictures of a game [steps of the scheduler's niceness]."""
TELL_EVERY: Final = 0.5
"""How often it says how far it is [s of film]."""
SEEN: Final = 1e-4
"""What moves by less than this [m, rad, parts of a quaternion] looks the same: a pixel is more than a millimetre."""
STILL_EVERY: Final = 1.0
"""How often a picture is repeated while nothing moves [s of film]: players can jump to any of these."""
TIME_BASE: Final = Fraction(1, 1000)
BIT_RATE: Final = 800_000
"""Of a film of 640×480 pixels; others in proportion [bit/s]."""
_AHEAD: Final = 4
"""Pictures that are drawn and not encoded yet, at most."""
_FIRST_SIZE: Final = 640 * 480

Picture = tuple[NDArray[np.uint8], float]
"""RGB (h, w, 3), and when it is seen [s]."""


@dataclass(slots=True)
class Encoder:
    """Encodes pictures in a thread of its own, beside the drawing of the next ones."""

    path: Path
    wish: FilmWish
    begins: float
    """Plant time of the first picture [s]."""
    error: Exception | None = None
    _pictures: queue.Queue[Picture | None] = field(default_factory=lambda: queue.Queue(_AHEAD))
    _thread: threading.Thread = field(init=False)

    def __post_init__(self) -> None:
        self._thread = threading.Thread(target=self._run, name="encoder", daemon=True)
        self._thread.start()

    def put(self, picture: Picture | None) -> None:
        """Take the next picture; None: there is none, and the film is ended.

        Raises:
            RecordError: it cannot be written.
            FFmpegError: it cannot be encoded.
        """
        while self._thread.is_alive():
            try:
                self._pictures.put(picture, timeout=0.2)
                break
            except queue.Full:
                continue
        if picture is None:
            self._thread.join()
        if self.error is not None:
            raise self.error

    def _run(self) -> None:
        try:
            with recording(self.path, ELSEWHERE):
                self._encode()
        except Exception as error:  # whoever draws raises it: else the film would end here, and be called done
            self.error = error

    def _encode(self) -> None:
        with av.open(str(self.path), "w", format="webm") as container:
            stream = container.add_stream("libvpx-vp9", rate=25)
            stream.width, stream.height = self.wish.width, self.wish.height
            stream.pix_fmt = "yuv420p"
            stream.bit_rate = round(BIT_RATE * self.wish.width * self.wish.height / _FIRST_SIZE)
            stream.time_base = TIME_BASE
            stream.options = {"deadline": "realtime", "cpu-used": "8", "row-mt": "0"}
            container.metadata[BEGINS] = f"{self.begins:.5f}"
            while (shot := self._pictures.get()) is not None:
                frame = av.VideoFrame.from_ndarray(shot[0], format="rgb24")
                frame.pts, frame.time_base = round(shot[1] / TIME_BASE), TIME_BASE
                container.mux(stream.encode(frame))
            container.mux(stream.encode(None))


def draw(wish: FilmWish) -> None:
    """Draw the film; prints how much is drawn and how much there is [s], line by line.

    Raises:
        RecordError: it cannot be written.
        HardwareError: the positions cannot be read or are not of such a world, or there is no OpenGL.
    """
    file = TrajectoryFile(wish.positions)
    construction = Construction.of(WorldSettings.model_validate(file.header.world))
    model = construction.model(looks=True)
    if model.nq != file.header.positions:
        raise HardwareError(f"{wish.positions} is from a world with different joints: use the version that recorded it")
    period, (first, last) = file.header.period, _part(file, wish)
    drawer, view, quality = SceneDrawer(model), view_of(wish.camera), LOOK if wish.fine else FILM
    encoder, drawn = Encoder(wish.output, wish, first * period), None
    whole, told, seconds, shown = (last - first) * period, 0.0, 0.0, 0.0
    for frame in _seen(file, first, last):
        seconds = (frame.tick - first) * period
        if drawn is None or not _alike(frame, drawn):
            drawn = frame._replace(positions=frame.positions.copy())  # all frames of a file share the array
            drawer.arrange(frame.positions, None if frame.note is None else SceneState.model_validate(frame.note))
            picture = drawer.see(view, wish.width, wish.height, quality)
            shown = -math.inf
        if seconds - shown >= STILL_EVERY:
            encoder.put((picture, seconds))
            shown = seconds
        if seconds >= told:
            told = seconds + TELL_EVERY
            print(f"{seconds:.2f} {whole:.2f}", flush=True)
    if seconds > shown:
        encoder.put((picture, seconds))
    encoder.put(None)
    drawer.close()
    print(f"{whole:.2f} {whole:.2f}", flush=True)


def _alike(frame: TrajectoryFrame, drawn: TrajectoryFrame) -> bool:
    """Whether two frames look the same: an arm at rest trembles by micrometres, which no picture shows."""
    return frame.note == drawn.note and bool(np.abs(frame.positions - drawn.positions).max() < SEEN)


def _part(file: TrajectoryFile, wish: FilmWish) -> tuple[int, int]:
    """Ticks of the first and the last frame of the part that is wanted."""
    span, period = file.span(), file.header.period
    if span is None:
        raise HardwareError(f"{file.path} holds no frame")
    begin = span[0] + math.floor(wish.begin / period)
    end = span[1] if wish.length is None else min(span[1], begin + math.floor(wish.length / period))
    ticks = [frame.tick for frame in file.frames() if begin <= frame.tick <= end]
    if not ticks:
        lasts = (span[1] - span[0]) * period
        raise HardwareError(f"nothing was recorded after {wish.begin:g} s: {file.path} lasts {lasts:.1f} s")
    return ticks[0], ticks[-1]


def _seen(file: TrajectoryFile, first: int, last: int) -> Iterator[TrajectoryFrame]:
    """The frames of a part."""
    for frame in file.frames():
        if frame.tick > last:
            return
        if frame.tick >= first:
            yield frame


def view_of(camera: str | Standpoint) -> str | FreeView:
    """A view as the renderer knows it."""
    if isinstance(camera, str):
        return camera
    return FreeView(camera.position, camera.target, math.radians(FIELD_OF_VIEW))


def main() -> int:
    """Entry of the process: the wish as JSON."""
    os.nice(NICE)
    atexit.register(gc.freeze)  # as of the command line
    try:
        draw(FilmWish.model_validate_json(sys.argv[1]))
    except BrokenPipeError:  # who listened is gone
        return 1
    except (RecordError, HardwareError, ValueError, FFmpegError) as error:
        print(" ".join(str(error).split()), file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
