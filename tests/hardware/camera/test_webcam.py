"""A webcam through OpenCV: what is lost is told and found again; its pinhole; and the factory of cameras."""

from __future__ import annotations

import math
import time
from contextlib import closing
from pathlib import Path

import cv2
import numpy as np
import pytest

from hardware.camera.factory import open_camera, open_recorder
from hardware.camera.realsense import NoRealSense
from hardware.camera.recorded import RecordedCamera
from hardware.camera.settings import (
    FolderSettings,
    NoCameraSettings,
    Play,
    RealSenseSettings,
    RecordingSettings,
    WebcamSettings,
)
from hardware.camera.webcam import WebcamCamera, pinhole
from hardware.interfaces import HardwareError
from tests.hardware.cameras import HandClock, WallClock, colour_picture, made_up_frame
from tests.waiting import PATIENCE


def video(path: Path, frames: int = 3) -> Path:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 30.0, (640, 480))
    for _ in range(frames):
        writer.write(np.full((480, 640, 3), (10, 100, 200), np.uint8))  # BGR
    writer.release()
    return path


class Device:
    """As far as OpenCV's captures go: pictures until the cable is pulled."""

    plugged = True
    opened = 0

    def __init__(self, _device: object) -> None:
        Device.opened += 1

    def isOpened(self) -> bool:  # noqa: N802  # OpenCV's name
        return Device.plugged

    def set(self, _what: int, _value: float) -> bool:
        return True

    def read(self) -> tuple[bool, np.ndarray | None]:
        time.sleep(0.01)
        return (True, colour_picture(1)) if Device.plugged else (False, None)

    def release(self) -> None:
        pass


def test_colours_are_rgb(tmp_path: Path) -> None:
    settings = WebcamSettings(device=video(tmp_path / "a.avi"), focal=500.0, width=640, height=480)
    with closing(WebcamCamera(settings, WallClock())) as camera:
        frame = camera.read(10.0)
        assert frame.colour[240, 320].tolist() == pytest.approx([200, 100, 10], abs=4)
        assert frame.intrinsics == camera.intrinsics == pinhole(640, 480, settings)


def test_a_pulled_webcam_is_named_and_used_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hardware.camera.webcam.cv2.VideoCapture", Device)
    monkeypatch.setattr("hardware.camera.webcam.RETRY", 0.05)
    with closing(WebcamCamera(WebcamSettings(device=3, focal=500.0), WallClock())) as camera:
        before = camera.read(10.0).stamp
        Device.plugged = False
        with pytest.raises(HardwareError, match="webcam 3 sends no pictures any more: check its cable and its number"):
            read_on(camera)
        Device.plugged = True
        deadline = time.monotonic() + PATIENCE
        while True:
            try:
                assert camera.read(10.0).stamp > before
                break
            except HardwareError:
                assert time.monotonic() < deadline, "the camera did not come back"
                time.sleep(0.02)


def read_on(camera: WebcamCamera) -> None:
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        camera.read(60.0)
        time.sleep(0.01)


def test_a_webcam_that_is_not_there_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(HardwareError, match=r"none\.avi cannot be opened: check its cable and its number"):
        WebcamCamera(WebcamSettings(device=tmp_path / "none.avi", focal=500.0), WallClock())
    monkeypatch.setattr("hardware.camera.webcam.FIRST_FRAME", 0.1)
    monkeypatch.setattr("hardware.camera.webcam.cv2.VideoCapture", type("Mute", (Device,), {"read": mute}))
    with pytest.raises(HardwareError, match="webcam 0 sends no pictures"):
        WebcamCamera(WebcamSettings(focal=500.0), WallClock())


def mute(_device: Device) -> tuple[bool, None]:
    time.sleep(0.01)
    return False, None


def test_the_pinhole_follows_the_size_that_comes() -> None:
    wide = WebcamSettings(width=1280, height=720, focal=1000.0)
    assert pinhole(640, 360, wide).fx == 500.0
    angle = WebcamSettings(field_of_view_deg=90.0)
    assert pinhole(640, 480, angle).fx == pytest.approx(320.0 / math.tan(math.pi / 4.0))
    assert pinhole(640, 480, angle).cx == 319.5


def test_the_factory_opens_what_the_settings_name(tmp_path: Path) -> None:
    clock = HandClock(100.0)
    assert open_camera(NoCameraSettings(), clock) is None
    for name, settings in (("a", FolderSettings), ("b.db3", RecordingSettings)):
        path = tmp_path / name
        with closing(open_recorder(path)) as recorder:
            recorder.write(made_up_frame(1, 5.0))
            recorder.write(made_up_frame(2, 6.0))
        for play, stamp in ((Play.FRAMES, 5.0), (Play.CLOCK, clock.now())):
            camera = open_camera(settings(path=path, play=play), clock)
            assert isinstance(camera, RecordedCamera)
            with closing(camera):
                assert camera.read(10.0).stamp == pytest.approx(stamp)
    webcam = open_camera(WebcamSettings(device=video(tmp_path / "c.avi"), focal=500.0), clock)
    assert isinstance(webcam, WebcamCamera)
    webcam.close()
    with pytest.raises(NoRealSense, match="RealSense 0000 is not plugged in"):
        open_camera(RealSenseSettings(serial="0000"), clock)
