"""A RealSense camera on librealsense's own pipeline, with a camera of software behind it."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import numpy as np
import pyrealsense2 as rs
import pytest

from hardware.camera.framesets import pinhole_of
from hardware.camera.realsense import NoRealSense, RealSenseCamera, apply_options, choose_serial, exposure_time
from hardware.camera.settings import RealSenseSettings
from hardware.camera.software_device import DepthStream, SoftwareCamera
from hardware.interfaces import Frame, HardwareError
from tests.hardware.cameras import DEPTH, PINHOLE, Plugs, SoftwareRealSense, WallClock, colour_picture
from tests.waiting import PATIENCE


@pytest.fixture
def device(monkeypatch: pytest.MonkeyPatch) -> Iterator[SoftwareRealSense]:
    monkeypatch.setattr("hardware.camera.realsense.FIRST_FRAME", PATIENCE)
    with closing(SoftwareRealSense("8899")) as one:
        yield one


def read_on(camera: RealSenseCamera) -> None:
    """Read until that fails, or for long."""
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        camera.read(60.0)
        time.sleep(0.05)


def until_read(camera: RealSenseCamera) -> Frame:
    """The first frame that comes again."""
    deadline = time.monotonic() + PATIENCE
    while True:
        try:
            return camera.read(10.0)
        except HardwareError:
            assert time.monotonic() < deadline, "the camera did not come back"
            time.sleep(0.05)


def test_stamps_are_the_clocks_less_the_frames_age(device: SoftwareRealSense, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hardware.camera.realsense.SILENCE", PATIENCE)  # it is not lost, but its thread held up
    clock = WallClock()
    with closing(RealSenseCamera(RealSenseSettings(serial="8899"), clock, device.plugs)) as camera:
        before = clock.now()
        frame = camera.read(10.0)
        assert before - 10.0 < frame.stamp <= clock.now()
        assert camera.read(10.0).stamp >= frame.stamp
        assert frame.depth is not None
        assert np.unique(frame.depth).tolist() == [0.6000000238418579]


def test_a_pulled_camera_is_named_and_used_again_once_it_is_plugged_in(device: SoftwareRealSense) -> None:
    with closing(RealSenseCamera(RealSenseSettings(), WallClock(), device.plugs)) as camera:
        before = until_read(camera).stamp
        device.pull()
        with pytest.raises(NoRealSense, match="RealSense 8899 sends no pictures any more: check its cable"):
            read_on(camera)
        device.plug()
        after = until_read(camera).stamp
        assert after > before


@pytest.mark.parametrize("where", ["asked for", "set up"])
def test_a_camera_that_fails_while_it_comes_back_is_tried_again(
    device: SoftwareRealSense, monkeypatch: pytest.MonkeyPatch, where: str
) -> None:
    """librealsense has errors of its own for a device that is about to come or go."""
    failed: list[str] = []

    def fail_once(good: Any) -> Any:
        def asked(*arguments: Any) -> Any:
            if not failed:
                failed.append(where)
                raise RuntimeError("failed to set power state")
            return good(*arguments)

        return asked

    with closing(RealSenseCamera(RealSenseSettings(), WallClock(), device.plugs)) as camera:
        until_read(camera)
        if where == "asked for":
            monkeypatch.setattr(device.plugs, "query_devices", fail_once(device.plugs.query_devices))
        else:
            monkeypatch.setattr("hardware.camera.realsense.apply_options", fail_once(apply_options))
        device.pull()
        with pytest.raises(NoRealSense):
            read_on(camera)
        device.plug()
        assert until_read(camera).depth is not None
        assert failed == [where]


def test_settings_that_librealsense_cannot_set_are_told(
    device: SoftwareRealSense, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: Any) -> None:
        raise RuntimeError("xioctl failed")

    monkeypatch.setattr("hardware.camera.realsense.apply_options", fails)
    with pytest.raises(HardwareError, match=r"8899 does not take its settings \(xioctl failed\): plug it in again"):
        RealSenseCamera(RealSenseSettings(), WallClock(), device.plugs)


def test_a_camera_that_sends_nothing_is_refused(device: SoftwareRealSense, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hardware.camera.realsense.FIRST_FRAME", 0.3)
    device.sending.clear()
    with pytest.raises(HardwareError, match="8899 sends no pictures: plug it into a USB 3 port"):
        RealSenseCamera(RealSenseSettings(), WallClock(), device.plugs)


def test_a_mode_that_it_has_not_is_refused(device: SoftwareRealSense) -> None:
    with pytest.raises(HardwareError, match=r"8899 does not stream colour at 1920x1080 with depth at 848x480 and 30"):
        RealSenseCamera(RealSenseSettings(width=1920, height=1080), WallClock(), device.plugs)


def test_without_a_camera_the_sentence_says_so() -> None:
    with pytest.raises(NoRealSense, match="no RealSense camera is plugged in: check its cable"):
        RealSenseCamera(RealSenseSettings(), WallClock(), Plugs())


def test_serial_numbers_choose() -> None:
    assert choose_serial(None, ["1"]) == "1"
    assert choose_serial("2", ["1", "2"]) == "2"
    with pytest.raises(NoRealSense, match="several RealSense cameras: set serial to one of 1, 2"):
        choose_serial(None, ["1", "2"])
    with pytest.raises(NoRealSense, match="RealSense 3 is not plugged in, there are 1, 2"):
        choose_serial("3", ["1", "2"])
    with pytest.raises(NoRealSense, match="RealSense 3 is not plugged in, there is none at all"):
        choose_serial("3", [])


class Picture:
    """As far as stamps go."""

    def __init__(self, domain: Any, metadata: dict[Any, float]) -> None:
        self._domain, self._metadata = domain, metadata

    def get_frame_timestamp_domain(self) -> Any:
        return self._domain

    def get_timestamp(self) -> float:
        return 1500.0

    def supports_frame_metadata(self, key: Any) -> bool:
        return key in self._metadata

    def get_frame_metadata(self, key: Any) -> float:
        return self._metadata[key]


def test_only_stamps_of_the_systems_clock_count() -> None:
    domain, arrival = rs.timestamp_domain, rs.frame_metadata_value.time_of_arrival
    assert exposure_time(Picture(domain.global_time, {}), 9.0) == 1.5
    assert exposure_time(Picture(domain.system_time, {}), 9.0) == 1.5
    assert exposure_time(Picture(domain.hardware_clock, {arrival: 8500.0}), 9.0) == 8.5
    assert exposure_time(Picture(domain.hardware_clock, {}), 9.0) == 9.0


class Range:
    min, max = 1.0, 10000.0


class Sensor:
    """Options of a sensor, and what was set."""

    def __init__(self, *options: Any) -> None:
        self.options = options
        self.set: dict[Any, float] = {}

    def supports(self, option: Any) -> bool:
        return option in self.options

    def get_option_range(self, _option: Any) -> type[Range]:
        return Range

    def set_option(self, option: Any, value: float) -> None:
        self.set[option] = value


class Emitter(Sensor):
    """With a range that admits 0."""

    def get_option_range(self, _option: Any) -> Any:
        return type("Zero", (), {"min": 0.0, "max": 2.0})


def test_options_reach_the_sensors_that_have_them() -> None:
    option = rs.option
    colour = Emitter(option.enable_auto_exposure, option.exposure)
    depth = Emitter(option.depth_units, option.emitter_enabled, option.exposure, option.enable_auto_exposure)
    apply_options([depth, colour], RealSenseSettings(exposure=1.5e-4, emitter=False))
    assert depth.set == {option.emitter_enabled: 0.0}, "depth exposes by itself"
    assert colour.set == {option.enable_auto_exposure: 0.0, option.exposure: pytest.approx(1.5)}
    apply_options([colour], RealSenseSettings())
    assert colour.set[option.enable_auto_exposure] == 1.0
    with pytest.raises(HardwareError, match="exposure 20000 is outside the camera's range 1 to 10000"):
        apply_options([Sensor(option.exposure)], RealSenseSettings(exposure=2.0))
    with pytest.raises(HardwareError, match="has no setting gain: leave it out"):
        apply_options([Sensor(option.exposure)], RealSenseSettings(exposure=0.01, gain=16.0))


# ------------------------------------------------------------------------------------------------ framesets to frames


def test_depth_is_where_the_colour_sensor_sees_it() -> None:
    """A step in depth comes out where projection says: the sensor stands 15 mm to the right of the colour sensor."""
    unit, near, far, edge = DEPTH.unit, 500, 1000, 500
    depth = np.full((480, 848), far, np.uint16)
    depth[:, edge:] = near
    device = SoftwareCamera(PINHOLE, DEPTH)
    try:
        frame = device.frame(colour_picture(1), depth, 1.0)
    finally:
        device.close()
    assert frame.depth is not None
    row = frame.depth[240]
    pinhole = DEPTH.pinhole
    x = (edge - 0.5 - pinhole.cx) / pinhole.fx * near * unit + DEPTH.offset
    expected = x / (near * unit) * PINHOLE.fx + PINHOLE.cx
    assert np.flatnonzero(np.isclose(row, near * unit))[0] == pytest.approx(expected, abs=1.5)
    assert row[:100].tolist() == pytest.approx([far * unit] * 100)


def test_what_is_aligned_already_is_left_as_it_is() -> None:
    depth = np.zeros((480, 640), np.uint16)
    depth[::7, ::5] = 700
    device = SoftwareCamera(PINHOLE, DepthStream(PINHOLE, 1e-3))
    try:
        frame = device.frame(colour_picture(1), depth, 1.0)
    finally:
        device.close()
    assert frame.depth is not None
    np.testing.assert_array_equal(frame.depth, depth.astype(np.float32) * np.float32(1e-3))
    np.testing.assert_array_equal(frame.colour, colour_picture(1))


class Profile:
    """A stream's lens."""

    def __init__(self, k1: float) -> None:
        self.lens = rs.intrinsics()
        self.lens.width, self.lens.height = 640, 480
        self.lens.fx = self.lens.fy = 600.0
        self.lens.model, self.lens.coeffs = rs.distortion.inverse_brown_conrady, [k1, 0.0, 0.0, 0.0, 0.0]

    def as_video_stream_profile(self) -> Profile:
        return self

    def get_intrinsics(self) -> Any:
        return self.lens


def test_a_lens_that_distorts_is_refused() -> None:
    assert pinhole_of(Profile(0.001)).fx == 600.0
    with pytest.raises(HardwareError, match=r"distorted by 14\.\d px at the corners, at most 1 px is accepted"):
        pinhole_of(Profile(-0.08))
