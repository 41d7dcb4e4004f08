"""Where everything was, frame by frame, in a file from which a film can be drawn at any time.

The file begins with a line of JSON, ``TrajectoryHeader``. Records follow, each with its length and check sum, so that a
file that broke off is good up to there. A frame holds what changed since the one before: of a plant at rest, 17 bytes.

| bytes | of a record |
| --- | --- |
| 4 | length n of what follows the check sum, little-endian as all |
| 4 | CRC-32 of that |
| 1 | kind: 0 frame, 1 note |
| n - 1 | of a frame: tick (8), indices of all positions that changed (2 each), their values (4 each, floats) |
| n - 1 | of a note: JSON, such as how light and camera are from the next frame on |
"""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import PositiveFloat, PositiveInt, ValidationError

from hardware.frozen import Frozen
from hardware.interfaces import HardwareError

_HEAD: Final = struct.Struct("<II")
_TICK: Final = struct.Struct("<Q")
_FRAME, _NOTE = b"\0", b"\1"
_LONGEST_HEADER: Final = 1 << 20
_PER_CHANGE: Final = 2 + 4
"""Of an index and a value [bytes]."""


class TrajectoryHeader(Frozen):
    """What the frames are of."""

    format: Literal["touchmove trajectory 1"] = "touchmove trajectory 1"
    period: PositiveFloat
    """Of a tick [s]."""
    every: PositiveInt
    """Ticks from frame to frame while plant time runs."""
    positions: PositiveInt
    """Numbers in a frame: generalised positions of the world, in its model's order."""
    world: dict[str, Any]
    """The world's settings, from which its model can be made again."""


class TrajectoryFrame(NamedTuple):
    """Where everything was at a tick.

    Attributes:
        tick: of plant time.
        positions: shape (n,); in the same array for all frames of a file.
        note: what was noted last; None: nothing was.
        changed: whether a position or the note differs from the frame before.
    """

    tick: int
    positions: NDArray[np.float64]
    note: Mapping[str, Any] | None
    changed: bool


class TrajectoryWriter:
    """Writes a new file; ``OSError`` where that cannot be, as when one of the name is there."""

    def __init__(self, path: Path, header: TrajectoryHeader) -> None:
        self._file = path.open("xb", buffering=0)  # what is written is the system's, whatever becomes of this process
        self._file.write(header.model_dump_json().encode() + b"\n")
        self._last = np.full(header.positions, np.nan, dtype=np.float32)
        self._note = ""

    def keep(self, tick: int, positions: NDArray[np.float64], note: str = "") -> None:
        """Write a frame, and before it a note (JSON) where it is another one than before."""
        if note and note != self._note:
            self._note = note
            self._write(_NOTE + note.encode())
        now = positions.astype(np.float32)
        changed = np.flatnonzero(now != self._last).astype("<u2")
        self._write(_FRAME + _TICK.pack(tick) + changed.tobytes() + now[changed].astype("<f4").tobytes())
        self._last = now

    def close(self) -> None:
        """End the file."""
        self._file.close()

    def _write(self, body: bytes) -> None:
        self._file.write(_HEAD.pack(len(body), zlib.crc32(body)) + body)


class TrajectoryFile:
    """A file to read. Raises ``HardwareError`` if it is missing or none."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            with path.open("rb") as file:
                line = file.readline(_LONGEST_HEADER)
        except OSError as error:
            raise HardwareError(f"{path}: {error.strerror}") from error
        try:
            self.header = TrajectoryHeader.model_validate_json(line)
        except ValidationError as error:
            raise HardwareError(f"{path} holds no positions that a film can be drawn from") from error
        self._start = len(line)

    def frames(self) -> Iterator[TrajectoryFrame]:
        """All whole frames, in their order, up to where the file ends or is damaged."""
        positions, note, changed = np.full(self.header.positions, np.nan), None, True
        for body in self._records():
            if body[:1] == _NOTE:
                note, changed = json.loads(body[1:]), True
                continue
            count, left = divmod(len(body) - 1 - _TICK.size, _PER_CHANGE)
            if body[:1] != _FRAME or count < 0 or left:
                return
            start = 1 + _TICK.size
            indices = np.frombuffer(body, dtype="<u2", count=count, offset=start)
            if count and int(indices.max()) >= len(positions):
                return
            positions[indices] = np.frombuffer(body, dtype="<f4", count=count, offset=start + 2 * count)
            yield TrajectoryFrame(_TICK.unpack_from(body, 1)[0], positions, note, changed or count > 0)
            changed = False

    def span(self) -> tuple[int, int] | None:
        """Ticks of the first and the last frame; None: there is none."""
        first = last = None
        for frame in self.frames():
            first, last = first if first is not None else frame.tick, frame.tick
        return None if first is None or last is None else (first, last)

    def _records(self) -> Iterator[bytes]:
        with self.path.open("rb") as file:
            file.seek(self._start)
            while len(head := file.read(_HEAD.size)) == _HEAD.size:
                length, check = _HEAD.unpack(head)
                if length > _LONGEST_HEADER:
                    return
                body = file.read(length)
                if len(body) < length or zlib.crc32(body) != check:
                    return
                yield body
