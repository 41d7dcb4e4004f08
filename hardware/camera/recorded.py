"""Recorded frames played as a camera: by their stamps as time passes, or one at each read."""

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

from hardware.interfaces import CameraClosed, Clock, Frame, HardwareError, StaleFrame


@dataclass(frozen=True, slots=True)
class RecordedFrame:
    """One recorded frame that is not read yet: most are passed over when time runs on."""

    stamp: float
    """Of exposure, as recorded [s]."""
    load: Callable[[], Frame]


class Recording(Protocol):
    """Frames in their order."""

    def next(self) -> RecordedFrame | None:
        """The next frame, None behind the last one; raises ``HardwareError`` if the recording is damaged."""

    def close(self) -> None:
        """Give files back."""


class RecordedCamera:
    """``Camera`` that plays a recording, which is closed with it.

    Frames come by the clock: the first one is exposed now, and stamps are the clock's. None: each read gives the next
    frame with the stamp it was recorded with, which is never too old. Raises ``HardwareError`` if the recording is
    empty.
    """

    def __init__(self, recording: Recording, clock: Clock | None) -> None:
        self._recording = recording
        self._clock = clock
        self._count = 0
        self._reading = threading.Lock()
        self._open = True
        first = recording.next()
        if first is None:
            recording.close()
            raise HardwareError("the recording holds no frames: record again")
        self._current = first
        self._begin = clock.now() - first.stamp if clock is not None else 0.0
        self._more: RecordedFrame | None = first

    def read(self, max_age: float) -> Frame:
        """See ``Camera.read``; behind its end a recording has no frames, or only old ones."""
        with self._reading:  # who plays and who watches for hands read in threads of their own
            return self._read(max_age)

    def _read(self, max_age: float) -> Frame:
        if not self._open:
            raise CameraClosed
        if self._clock is None:
            return self._step()
        now = self._clock.now() - self._begin
        while self._more is not None and self._more.stamp <= now:
            self._current, self._more = self._more, self._recording.next()
        age = now - self._current.stamp
        if age > max_age:
            raise StaleFrame(age, max_age)
        return replace(self._current.load(), stamp=self._current.stamp + self._begin)

    def close(self) -> None:
        """See ``Camera.close``."""
        with self._reading:
            if self._open:
                self._open = False
                self._recording.close()

    def _step(self) -> Frame:
        if self._more is None:
            raise HardwareError(f"the recording has ended after {self._count} frames: open it again to see it again")
        current, self._count = self._more, self._count + 1
        self._more = self._recording.next()
        return current.load()
