"""A plain webcam through OpenCV: colour alone, no depth."""

import math
import threading
import time
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from hardware.camera.background import DeviceReader
from hardware.camera.settings import WebcamSettings
from hardware.interfaces import Clock, Frame, HardwareError, Intrinsics, StaleFrame

FIRST_FRAME: Final = 5.0
"""A camera that has sent nothing so long after its start does not work [s, wall]."""
RETRY: Final = 0.5
"""Between two tries to open a lost camera again [s, wall]."""


class WebcamCamera:
    """``Camera`` on whatever OpenCV can open. A thread keeps the newest picture.

    A video file is played at its own speed, over and over. Stamps are the clock's. Of ``intrinsics`` the principal
    point is taken to be the middle. Raises ``HardwareError`` if it cannot be opened, or sends nothing.
    """

    def __init__(self, settings: WebcamSettings, clock: Clock) -> None:
        self._settings = settings
        self._clock = clock
        self._reading = threading.Lock()
        self._last = -math.inf
        self._stamped: float | None = None
        self._capture = self._open()
        if self._capture is None:
            raise self._lost("cannot be opened")
        self._reader = DeviceReader[tuple[NDArray[np.uint8], float]]("webcam", self._run)
        first, _ = self._reader.start(FIRST_FRAME, self._lost("sends no pictures"))
        self.intrinsics = pinhole(first.shape[1], first.shape[0], settings)

    def read(self, max_age: float) -> Frame:
        """See ``Camera.read``. A picture's age counts from when the computer got it."""
        with self._reading:  # who plays and who watches for hands read in threads of their own
            picture, arrived = self._reader.newest()
            age = time.monotonic() - arrived
            if age > max_age:
                raise StaleFrame(age, max_age)
            if self._stamped != arrived:
                self._last, self._stamped = max(self._last, self._clock.now() - age), arrived
            stamp = self._last
        if picture.shape[:2] != (self.intrinsics.height, self.intrinsics.width):
            raise HardwareError(
                f"the webcam's pictures are {picture.shape[1]}x{picture.shape[0]} now, they were "
                f"{self.intrinsics.width}x{self.intrinsics.height}: start the program again"
            )
        colour = np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), dtype=np.uint8)
        return Frame(colour, None, self.intrinsics, stamp)

    def close(self) -> None:
        """See ``Camera.close``."""
        self._reader.end()

    # the thread

    def _run(self) -> None:
        capture, pause, closing = self._capture, self._pause(), self._reader.closing
        while not closing.is_set():
            if capture is None:
                capture = self._open()
                closing.wait(RETRY if capture is None else 0.0)
                continue
            there, picture = capture.read()
            if there:
                self._reader.put((np.asarray(picture, dtype=np.uint8), time.monotonic()))
                closing.wait(pause)
                continue
            capture.release()
            capture = None
            if not pause:
                self._reader.fail(self._lost("sends no pictures any more"))
        if capture is not None:
            capture.release()

    def _pause(self) -> float:
        """Between two pictures of a video file [s]; 0 for a camera, which comes at its own pace."""
        device = self._settings.device
        return 1.0 / self._settings.fps if isinstance(device, Path) and device.is_file() else 0.0

    def _open(self) -> cv2.VideoCapture | None:
        wanted = self._settings
        device = str(wanted.device) if isinstance(wanted.device, Path) else wanted.device
        capture = cv2.VideoCapture(device)
        if not capture.isOpened():
            return None
        if not self._pause():
            capture.set(cv2.CAP_PROP_FRAME_WIDTH, wanted.width)
            capture.set(cv2.CAP_PROP_FRAME_HEIGHT, wanted.height)
            capture.set(cv2.CAP_PROP_FPS, wanted.fps)
        return capture

    def _lost(self, what: str) -> HardwareError:
        return HardwareError(
            f"webcam {self._settings.device} {what}: check its cable and its number, and close other programs that use "
            "it; it is used again once it is back"
        )


def pinhole(width: int, height: int, settings: WebcamSettings) -> Intrinsics:
    """Intrinsics of pictures of this size [px], from the focal length or the horizontal field of view."""
    if settings.focal is not None:
        focal = settings.focal * width / settings.width
    else:
        assert settings.field_of_view_deg is not None, "the settings demand one of the two"
        focal = 0.5 * width / math.tan(0.5 * math.radians(settings.field_of_view_deg))
    return Intrinsics(width, height, focal, focal, 0.5 * (width - 1), 0.5 * (height - 1))
