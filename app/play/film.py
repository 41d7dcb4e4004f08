"""A short film of the game in WebM (VP9), which any browser plays."""

from __future__ import annotations

import os
import threading
from fractions import Fraction
from pathlib import Path

import av

from app.records import RecordError, recording
from app.records.film import BEGINS
from app.terminal.shown import FilmSource

TIME_BASE = Fraction(1, 1000)
NICE = 10
"""The film's thread steps back behind everything else [steps of the scheduler's niceness]."""


class Film:
    """Takes frames from a stream in a thread of its own and encodes them, up to a length."""

    def __init__(self, source: FilmSource, path: Path, longest: float, tick: float) -> None:
        """Start filming.

        Args:
            source: of the pictures; closed at the end.
            path: the file to write.
            longest: the film ends after this much plant time [s].
            tick: length of a tick [s].
        """
        self._path = path
        self._longest, self._tick = longest, tick
        self._stream = source
        self._error: RecordError | None = None
        self._thread = threading.Thread(target=self._film, name="film", daemon=True)
        self._thread.start()

    def _film(self) -> None:
        try:
            with recording(self._path):
                self._encode()
        except RecordError as error:
            self._error = error
        finally:
            self._stream.close()

    def _encode(self) -> None:
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICE)  # of this thread alone, on Linux
        with av.open(str(self._path), "w", format="webm") as container:
            stream = container.add_stream("libvpx-vp9", rate=25)
            stream.pix_fmt, stream.bit_rate = "yuv420p", 800_000
            stream.time_base = TIME_BASE
            stream.options = {"deadline": "realtime", "cpu-used": "8", "row-mt": "0"}
            first: int | None = None
            while (shot := self._stream.next()) is not None:
                picture, tick = shot
                if first is None:
                    first = tick
                    stream.height, stream.width = picture.shape[:2]
                    container.metadata[BEGINS] = f"{tick * self._tick:.5f}"
                seconds = (tick - first) * self._tick
                if seconds > self._longest:
                    break
                frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
                frame.pts, frame.time_base = round(seconds / TIME_BASE), TIME_BASE
                container.mux(stream.encode(frame))
            container.mux(stream.encode(None))

    def finish(self) -> Path | None:
        """End the film; the file's path, None when not a single frame was taken.

        Raises:
            RecordError: it could not be written.
        """
        self._stream.cancel()
        self._thread.join(30.0)
        if self._error is not None:
            raise self._error
        return self._path if self._path.exists() else None
