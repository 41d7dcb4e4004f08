"""Frames of a camera that several read, each once as it comes: for whoever watches."""

import threading
import time
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hardware.interfaces import Camera, CameraClosed, Frame, HardwareError

PICTURE_AGE: Final = 1.0
"""Nobody is shown an older picture as if it were of now [s]."""
_AGAIN: Final = 0.004
"""How soon a camera that had no newer frame is asked again [s]."""
_MENDED: Final = 0.2
"""The same of one that has none to show [s]."""


class SteadyFrames:
    """``GuardFrames`` of a camera that also others read, and that stays open: each frame once, as it comes.

    Plant time runs by itself where there is such a camera, so that nobody has to be woken up.
    """

    def __init__(self, camera: Camera) -> None:
        self._camera, self._stamp = camera, float("-inf")
        self._closed = threading.Event()

    def read(self, max_age: float) -> Frame:
        """See ``GuardFrames.read``; waits for a frame that was not read before, and raises as ``Camera.read``."""
        while not self._closed.is_set():
            frame = self._camera.read(max_age)
            if frame.stamp > self._stamp:
                self._stamp = frame.stamp
                return frame
            time.sleep(_AGAIN)
        raise CameraClosed

    def wake(self, awake: bool) -> None:
        """See ``GuardFrames.wake``."""

    def release(self) -> None:
        """See ``GuardFrames.release``."""

    def close(self) -> None:
        """A reader in another thread ends with ``CameraClosed``."""
        self._closed.set()


class CameraPictures:
    """``FilmSource`` of a camera that also others read: its newest picture, so many a second.

    Args:
        camera: stays open when this is closed.
        rate: pictures a second [1/s]; None: as many as the camera gives.
        period: of a tick [s].
    """

    def __init__(self, camera: Camera, rate: float | None, period: float) -> None:
        self._frames, self._period = SteadyFrames(camera), period
        self._pause = 0.0 if rate is None else 1.0 / rate
        self._cancelled = threading.Event()

    def next(self) -> tuple[NDArray[np.uint8], int] | None:
        """See ``FilmSource.next``; None also where the camera was closed. One that was held up or unplugged is waited
        for.
        """
        while not self._cancelled.wait(self._pause):
            try:
                frame = self._frames.read(PICTURE_AGE)
            except CameraClosed:
                return None
            except HardwareError:
                self._cancelled.wait(_MENDED)
                continue
            return frame.colour, round(frame.stamp / self._period)
        return None

    def cancel(self) -> None:
        """See ``FilmSource.cancel``."""
        self._cancelled.set()
        self._frames.close()

    def close(self) -> None:
        """See ``FilmSource.close``."""
        self.cancel()
