"""A game, a guard and a page read one camera, each in a thread of its own."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from typing import Any

import numpy as np
import pytest

from hardware.camera.realsense import RealSenseCamera
from hardware.camera.recorded import RecordedCamera, RecordedFrame
from hardware.camera.settings import RealSenseSettings, WebcamSettings
from hardware.camera.webcam import WebcamCamera
from hardware.interfaces import Camera, Frame
from tests.hardware.cameras import HandClock, SoftwareRealSense, WallClock, colour_picture, made_up_frame
from tests.waiting import PATIENCE

WAIT = 0.3
"""So long the second reader may hold up the first one [s, wall]: it may have to wait for it."""


class Counting:
    """As far as OpenCV's captures go: each picture tells its number."""

    def __init__(self, _device: object) -> None:
        self._number = 0

    def isOpened(self) -> bool:  # noqa: N802  # OpenCV's name
        return True

    def set(self, _what: int, _value: float) -> bool:
        return True

    def read(self) -> tuple[bool, np.ndarray]:
        time.sleep(0.02)
        self._number += 1
        return True, colour_picture(0) + np.uint8(self._number)

    def release(self) -> None:
        pass


class Recorded:
    """A recording in memory; the second frame is read while the first one is."""

    def __init__(self, between: Callable[[], None]) -> None:
        self._frames = iter([RecordedFrame(float(n), lambda n=n: self._load(n)) for n in range(3)])
        self._between = between

    def _load(self, number: int) -> Frame:
        if number == 0:
            self._between()
        return made_up_frame(number, float(number))

    def next(self) -> RecordedFrame | None:
        return next(self._frames, None)

    def close(self) -> None:
        pass


class Second:
    """A second reader, who comes while the first one reads."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self.camera: Camera | None = None
        self._thread = threading.Thread(target=self._read)

    def _read(self) -> None:
        assert self.camera is not None
        self.frames.append(self.camera.read(10.0))

    def comes(self) -> None:
        if self._thread.ident is None:
            self._thread.start()
            self._thread.join(WAIT)

    def read_too(self, camera: Camera) -> tuple[Frame, Frame]:
        """What the first one gets, and the second."""
        self.camera = camera
        first = camera.read(10.0)
        self._thread.join(PATIENCE)
        return first, self.frames[0]


@pytest.fixture(params=["webcam", "realsense"])
def live(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    monkeypatch.setattr("hardware.camera.webcam.cv2.VideoCapture", Counting)
    monkeypatch.setattr("hardware.camera.realsense.FIRST_FRAME", PATIENCE)
    if request.param == "webcam":
        with closing(WebcamCamera(WebcamSettings(device=3, focal=500.0), WallClock())) as camera:
            yield camera
        return
    with (
        closing(SoftwareRealSense("8899")) as device,
        closing(RealSenseCamera(RealSenseSettings(), WallClock(), device.plugs)) as camera,
    ):
        yield camera


def test_of_two_readers_who_has_the_older_picture_has_the_older_stamp(live: Any) -> None:
    second, newest = Second(), live._reader.newest

    def asked() -> Any:
        value = newest()
        if not second.frames:
            time.sleep(0.1)  # the next picture comes
            second.comes()
        return value

    live._reader.newest = asked
    first, other = second.read_too(live)
    older, newer = sorted((first, other), key=lambda frame: int(frame.colour[0, 0].max()))
    assert int(older.colour[0, 0].max()) < int(newer.colour[0, 0].max())
    assert older.stamp < newer.stamp


def test_a_recorded_picture_keeps_its_stamp_where_another_reader_goes_on() -> None:
    clock, second = HandClock(100.0), Second()

    def between() -> None:
        clock.time = 101.0
        second.comes()

    with closing(RecordedCamera(Recorded(between), clock)) as camera:
        first, other = second.read_too(camera)
    assert (int(first.colour[0, 0, 0]), first.stamp) == (0, 100.0)
    assert (int(other.colour[0, 0, 0]), other.stamp) == (1, 101.0)
