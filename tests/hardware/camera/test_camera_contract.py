"""Laws that every camera keeps: simulated, RealSense, webcam, and recordings of either kind."""

from __future__ import annotations

import inspect
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest

from hardware.camera.db3 import Db3Recording
from hardware.camera.factory import open_recorder
from hardware.camera.folder import FolderRecording
from hardware.camera.realsense import RealSenseCamera
from hardware.camera.recorded import RecordedCamera
from hardware.camera.settings import RealSenseSettings, WebcamSettings
from hardware.camera.webcam import WebcamCamera
from hardware.interfaces import Camera, CameraClosed, Frame, HardwareError, StaleFrame
from hardware.sim.clients.camera import SimCamera
from tests.hardware.cameras import HandClock, SoftwareRealSense, WallClock, colour_picture, made_up_frame
from tests.hardware.sim.process.test_world import Controller, WorldProcess, settings_for
from tests.waiting import PATIENCE, until

YOUNG = PATIENCE
"""Nothing is older than this here, however loaded the machine is [s]."""


@dataclass
class Subject:
    """A camera under test.

    Attributes:
        camera: itself.
        wait: lets some time pass, as the camera counts it.
        depth: whether its frames have depth.
    """

    camera: Camera
    wait: Callable[[], None]
    depth: bool


def simulated(folder: Path, stack: ExitStack) -> Subject:
    world = WorldProcess(folder / "world", settings_for(cameras=True), {})
    stack.callback(world.kill)
    stack.enter_context(Controller(world.run_dir))
    try:
        return Subject(SimCamera(world.run_dir), lambda: None, depth=True)
    except HardwareError as error:
        if "OpenGL" not in world.log:
            raise
        pytest.skip(str(error))


def realsense(_folder: Path, stack: ExitStack) -> Subject:
    patch = stack.enter_context(pytest.MonkeyPatch.context())
    for patience in ("FIRST_FRAME", "SILENCE"):  # it is not lost, but its thread held up
        patch.setattr(f"hardware.camera.realsense.{patience}", PATIENCE)
    device = stack.enter_context(closing(SoftwareRealSense()))
    camera = RealSenseCamera(RealSenseSettings(), WallClock(), device.plugs)
    return Subject(camera, lambda: time.sleep(0.1), depth=True)


def webcam(folder: Path, _stack: ExitStack) -> Subject:
    path = folder / "webcam.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 30.0, (640, 480))
    for number in range(5):
        writer.write(colour_picture(50 * number))
    writer.release()
    camera = WebcamCamera(WebcamSettings(device=path, field_of_view_deg=70.0), WallClock())
    return Subject(camera, lambda: time.sleep(0.1), depth=False)


def recorded(path: Path) -> Path:
    with closing(open_recorder(path)) as recorder:
        for number in range(5):
            recorder.write(made_up_frame(number, 7.0 + 0.5 * number))
    return path


def folder_of_frames(folder: Path, _stack: ExitStack) -> Subject:
    clock = HandClock(3.0)
    return Subject(
        RecordedCamera(FolderRecording(recorded(folder / "frames")), clock), lambda: clock.sleep(0.3), depth=True
    )


def db3(folder: Path, _stack: ExitStack) -> Subject:
    clock = HandClock(3.0)
    return Subject(
        RecordedCamera(Db3Recording(recorded(folder / "frames.db3")), clock), lambda: clock.sleep(0.3), depth=True
    )


@pytest.fixture(params=[simulated, realsense, webcam, folder_of_frames, db3], ids=lambda make: make.__name__)
def subject(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Subject]:
    with ExitStack() as stack:
        one = request.param(tmp_path, stack)
        stack.callback(one.camera.close)
        yield one


def test_a_camera_keeps_its_contract(subject: Subject) -> None:
    """One test for all laws, since opening some cameras takes seconds."""
    camera = subject.camera
    frames = [camera.read(YOUNG)]

    def renewed() -> bool:
        subject.wait()
        frames.append(camera.read(YOUNG))
        return len(frames) > 3 and frames[-1].stamp > frames[0].stamp

    until(renewed)
    for frame in frames:
        check(frame, subject.depth)
    stamps = [frame.stamp for frame in frames]
    assert stamps == sorted(stamps), "stamps never go backwards"
    assert not np.shares_memory(frames[-2].colour, frames[-1].colour)
    before = frames[-1].colour.copy()
    frames[-2].colour[:] = 0
    assert (frames[-1].colour == before).all(), "a reader's arrays are its own"

    subject.wait()
    with pytest.raises(StaleFrame, match=r"is \d+\.\d{3} s old, at most 0\.000 s is accepted") as stale:
        camera.read(0.0)
    assert stale.value.age > stale.value.limit == 0.0
    camera.read(YOUNG)  # a stale frame harms nobody

    camera.close()
    camera.close()
    with pytest.raises(CameraClosed, match="this camera is closed: open it again"):
        camera.read(YOUNG)


def check(frame: Frame, depth: bool) -> None:
    h, w = frame.intrinsics.height, frame.intrinsics.width
    assert frame.colour.shape == (h, w, 3)
    assert frame.colour.dtype == np.uint8
    assert frame.colour.flags.writeable
    assert frame.colour.std() > 5.0
    assert 0.0 < frame.intrinsics.cx < w
    assert 0.0 < frame.intrinsics.cy < h
    assert isinstance(frame.stamp, float)
    assert (frame.depth is not None) == depth
    if frame.depth is not None:
        assert frame.depth.shape == (h, w)
        assert frame.depth.dtype == np.float32
        assert np.isfinite(frame.depth).all()
        assert (frame.depth >= 0.0).all()
        assert (frame.depth > 0.1).mean() > 0.5


@pytest.mark.parametrize("kind", [SimCamera, RealSenseCamera, WebcamCamera, RecordedCamera])
def test_a_camera_has_few_verbs(kind: type) -> None:
    verbs = {name for name, _ in inspect.getmembers(kind, inspect.isfunction) if not name.startswith("_")}
    assert verbs == {"read", "close"}
