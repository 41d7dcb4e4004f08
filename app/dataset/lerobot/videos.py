"""Videos of one view, filled with episodes one behind the other, up to a size and a length.

Each file is encoded in one go, picture by picture: nothing is kept but what the encoder looks ahead.
"""

from __future__ import annotations

import os
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from typing import Final

import av
import numpy as np
from av.container import OutputContainer
from av.video.stream import VideoStream
from numpy.typing import NDArray

from app.dataset.lerobot.schema import CODEC, ENCODER, GROUP, PIXELS, PRESET, QUALITY
from app.dataset.lerobot.shards import MIB, FilePlace
from app.records.files import RecordError, recording
from hardware.realtime import scheduling_kept

_LONGEST: Final = 1000.0
"""Of a video [s]: LeRobot's reader compares times as numbers of 32 bits, to 0.1 ms, which from 1024 s on they do not
tell apart."""
QUIET: Final = {"SVT_LOG": "1"}
"""Of the environment: the encoder says what went wrong, and nothing else."""


class VideoShards:
    """Episodes of one view, one behind the other in videos of a steady rate.

    Args:
        root: of the dataset.
        template: of the files' names.
        key: of the view's feature.
        size: width and height [px].
        fps: frames a second.
        largest: of a file [MiB].
        chunk_size: files in a folder.
    """

    def __init__(
        self, root: Path, template: str, key: str, size: tuple[int, int], fps: int, largest: float, chunk_size: int
    ) -> None:
        os.environ.update(QUIET)
        self._root, self._template, self._key, self._size, self._fps = root, template, key, size, fps
        self._largest, self._chunk_size = largest * MIB, chunk_size
        self._shard: FilePlace | None = None
        self._container: OutputContainer | None = None
        self._stream: VideoStream | None = None
        self._path = root
        self._frames = self._coded = self._bytes = 0

    def place(self, frames: int) -> tuple[FilePlace, float]:
        """Where the next episode of so many frames goes: which file, and from when on in it [s]."""
        if self._shard is None:
            self._begin(FilePlace())
        elif self._frames and self._is_full(frames):
            self.close()
            self._begin(self._shard.after(self._chunk_size))
        assert self._shard is not None
        return self._shard, self._frames / self._fps

    def put(self, picture: NDArray[np.uint8]) -> None:
        """The next picture, RGB (height, width, 3); raises ``RecordError`` where it cannot be written."""
        frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
        frame.pts, frame.time_base = self._frames, Fraction(1, self._fps)
        self._frames += 1
        self._mux(frame)

    def close(self) -> None:
        """End the file; a second call does nothing."""
        if self._container is None:
            return
        try:
            self._mux(None)
        finally:
            container, self._container = self._container, None
            with recording(self._path):
                container.close()

    def drop(self) -> None:
        """Leave the file as it is, also where there is no room for its end."""
        with suppress(RecordError):
            self.close()

    def _is_full(self, frames: int) -> bool:
        if (self._frames + frames) / self._fps > _LONGEST:
            return True
        return bool(self._coded) and self._bytes / self._coded * (self._frames + frames) >= self._largest

    def _begin(self, shard: FilePlace) -> None:
        self._path = shard.path(self._root, self._template, video_key=self._key)
        options = {"g": str(GROUP), "crf": str(QUALITY), "preset": str(PRESET), **ENCODER}
        with recording(self._path):
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._container = av.open(str(self._path), "w", format="mp4", options={"movflags": "faststart"})
            self._stream = self._container.add_stream(CODEC, self._fps, options=options)
        self._stream.width, self._stream.height = self._size
        self._stream.pix_fmt = PIXELS
        self._shard, self._frames, self._coded, self._bytes = shard, 0, 0, 0

    def _mux(self, frame: av.VideoFrame | None) -> None:
        assert self._container is not None
        assert self._stream is not None
        # SVT-AV1 gives the thread that begins to encode SCHED_FIFO 99, where it is root's
        with recording(self._path), scheduling_kept():
            for packet in self._stream.encode(frame):
                self._coded += 1
                self._bytes += packet.size
                self._container.mux(packet)
