"""A short film of the game in WebM (VP9), which any browser plays."""

from __future__ import annotations

import threading
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from numpy.typing import NDArray

from app.records import RecordError, recording
from hardware.sim.clients import FrameStream
from hardware.sim.renderer import HEIGHT, WIDTH

FRAME_TICKS = 45
"""One frame each 45 ticks of 0.88 ms: 25 a second, as fast as life."""
RATE = 25


class Film:
    """Takes frames from a stream in a thread of its own and encodes them, up to a length."""

    def __init__(self, run_dir: Path, path: Path, longest: float) -> None:
        """Start filming.

        Args:
            run_dir: of the running world.
            path: the file to write.
            longest: the film ends after this much plant time [s].
        """
        self._path = path
        self._frames = int(longest * RATE)
        self._stream = FrameStream(run_dir, "film", FRAME_TICKS)
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
        with av.open(str(self._path), "w", format="webm") as container:
            stream = container.add_stream("libvpx-vp9", rate=RATE)
            stream.pix_fmt = "yuv420p"
            stream.bit_rate = 1_200_000
            stream.time_base = Fraction(1, RATE)
            stream.options = {"deadline": "realtime", "cpu-used": "8", "row-mt": "0"}
            stream.width, stream.height = WIDTH, HEIGHT
            for index in range(self._frames):
                picture = self._stream.next()
                if picture is None:
                    break
                container.mux(stream.encode(_video_frame(picture, index)))
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


def _video_frame(picture: NDArray[np.uint8], index: int) -> av.VideoFrame:
    frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
    frame.pts, frame.time_base = index, Fraction(1, RATE)
    return frame
