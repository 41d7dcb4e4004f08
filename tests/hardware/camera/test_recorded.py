"""Frames that were recorded come back as they were, by their stamps or one by one."""

from __future__ import annotations

import shutil
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from hardware.camera.db3 import Db3Recorder, Db3Recording
from hardware.camera.factory import open_recorder
from hardware.camera.folder import FRAMES_FILE, FolderRecorder, FolderRecording
from hardware.camera.recorded import RecordedCamera, Recording
from hardware.interfaces import Frame, HardwareError, StaleFrame
from tests.hardware.cameras import PINHOLE, HandClock, made_up_frame

STAMPS = (4.0, 4.033, 9.5, 9.50088, 60.0)
"""Irregular, as frames between plies are."""


def record(path: Path, depth: bool = True) -> Recording:
    with closing(open_recorder(path)) as recorder:
        for number, stamp in enumerate(STAMPS):
            recorder.write(made_up_frame(10 * number, stamp, depth))
    return Db3Recording(path) if path.suffix == ".db3" else FolderRecording(path)


def same(frame: Frame, number: int, stamp: float, depth: bool = True) -> None:
    expected = made_up_frame(10 * number, stamp, depth)
    np.testing.assert_array_equal(frame.colour, expected.colour)
    assert frame.intrinsics == PINHOLE
    assert frame.stamp == pytest.approx(stamp, abs=1e-6)
    if expected.depth is None:
        assert frame.depth is None
    else:
        assert frame.depth is not None
        np.testing.assert_allclose(frame.depth, expected.depth, atol=1e-6)


@pytest.mark.parametrize("name", ["frames", "frames.db3"])
@pytest.mark.parametrize("depth", [True, False])
def test_frame_by_frame_all_come_back(tmp_path: Path, name: str, depth: bool) -> None:
    with closing(RecordedCamera(record(tmp_path / name, depth), None)) as camera:
        for number, stamp in enumerate(STAMPS):
            same(camera.read(0.0), number, stamp, depth)
        with pytest.raises(HardwareError, match="the recording has ended after 5 frames: open it again"):
            camera.read(0.0)


@pytest.mark.parametrize("name", ["frames", "frames.db3"])
def test_by_the_clock_frames_come_at_their_time(tmp_path: Path, name: str) -> None:
    clock = HandClock(100.0)
    with closing(RecordedCamera(record(tmp_path / name), clock)) as camera:
        assert camera.read(0.0).stamp == pytest.approx(100.0)
        clock.time = 105.49
        with pytest.raises(StaleFrame, match=r"is 5\.457 s old, at most 1\.000 s"):
            camera.read(1.0)
        clock.time = 105.6
        frame = camera.read(1.0)  # the fourth: the third is passed over
        assert frame.colour[0, 0, 0] == 30
        assert frame.stamp == pytest.approx(100.0 + 9.50088 - 4.0)
        clock.time = 156.5
        assert camera.read(1.0).colour[0, 0, 0] == 40
        clock.time = 200.0
        with pytest.raises(StaleFrame):
            camera.read(1.0)


def test_what_is_too_far_for_sixteen_bits_has_no_depth(tmp_path: Path) -> None:
    frame = made_up_frame(1, 0.0)
    assert frame.depth is not None
    frame.depth[0, :3] = 6.5535, 6.5536, np.inf
    with closing(FolderRecorder(tmp_path / "far")) as recorder:
        recorder.write(frame)
    shot = FolderRecording(tmp_path / "far").next()
    assert shot is not None
    depth = shot.load().depth
    assert depth is not None
    assert depth[0, :3].tolist() == pytest.approx([6.5535, 0.0, 0.0])


def test_a_recording_is_not_written_over(tmp_path: Path) -> None:
    for name in ("frames", "frames.db3"):
        record(tmp_path / name).close()
        with pytest.raises(HardwareError, match=r"already holds a recording|already exists"):
            open_recorder(tmp_path / name)
    with pytest.raises(HardwareError, match=r"there is no folder .*: create it first"):
        Db3Recorder(tmp_path / "none" / "a.db3")
    with pytest.raises(HardwareError, match=r"it must end in \.db3"):
        Db3Recorder(tmp_path / "a.mkv")


@pytest.mark.parametrize("name", ["frames", "frames.db3"])
def test_frames_of_another_camera_are_refused(tmp_path: Path, name: str) -> None:
    other = Frame(np.zeros((48, 64, 3), np.uint8), None, type(PINHOLE)(64, 48, 60.0, 60.0, 31.5, 23.5), 1.0)
    with closing(open_recorder(tmp_path / name)) as recorder:
        recorder.write(made_up_frame(0, 0.0))
        with pytest.raises(HardwareError, match=r"a frame with .*width=64.* does not belong to"):
            recorder.write(other)


def test_what_is_no_recording_is_named(tmp_path: Path) -> None:
    with pytest.raises(HardwareError, match=r"is not a recording: .*camera\.json cannot be read"):
        FolderRecording(tmp_path)
    with pytest.raises(HardwareError, match=r"there is no recording .*a\.db3: check the name"):
        Db3Recording(tmp_path / "a.db3")
    (tmp_path / "b.db3").write_bytes(b"nonsense" * 100)
    with pytest.raises(HardwareError, match=r"b\.db3 is not a recording that librealsense can play"):
        Db3Recording(tmp_path / "b.db3")
    record(tmp_path / "good").close()
    (tmp_path / "good" / "000001.png").unlink()
    with (
        closing(RecordedCamera(FolderRecording(tmp_path / "good"), None)) as camera,
        pytest.raises(HardwareError, match=r"000001\.png is missing or is not a picture"),
    ):
        camera.read(0.0)
    (tmp_path / "good" / FRAMES_FILE).write_text('{"stamp": "x"}\n', encoding="utf-8")
    with pytest.raises(HardwareError, match=r"good is not a recording: "):
        FolderRecording(tmp_path / "good")
    (tmp_path / "good" / FRAMES_FILE).write_text("", encoding="utf-8")
    with pytest.raises(HardwareError, match="the recording holds no frames"):
        RecordedCamera(FolderRecording(tmp_path / "good"), None)


def test_a_folder_that_cannot_be_written_any_more_is_told(tmp_path: Path) -> None:
    with closing(FolderRecorder(tmp_path / "gone")) as recorder:
        shutil.rmtree(tmp_path / "gone")
        with pytest.raises(HardwareError, match="gone cannot be written: No such file or directory"):
            recorder.write(made_up_frame(1, 1.0))
