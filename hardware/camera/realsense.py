"""A RealSense camera: found by its serial number, read in a thread of its own, found again after it was unplugged."""

import math
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final

import pyrealsense2 as rs

from hardware.camera.background import DeviceReader
from hardware.camera.framesets import FrameMaker
from hardware.camera.settings import RealSenseSettings
from hardware.interfaces import Clock, Frame, HardwareError, StaleFrame

FIRST_FRAME: Final = 5.0
"""A camera that has sent nothing so long after its start does not work [s, wall]."""
SILENCE: Final = 1.0
"""A camera that sends nothing for so long is lost, and looked for again [s, wall]."""
RETRY: Final = 0.25
"""Between two looks for a lost camera [s, wall]."""
EXPOSURE_UNIT: Final = 1e-4
"""In which librealsense counts a colour sensor's exposure [s]."""


class NoRealSense(HardwareError):
    """The camera is not there."""


@dataclass(frozen=True, slots=True)
class _Pair:
    """A frameset and when it was exposed [s, system clock]."""

    frameset: Any
    exposed: float


class RealSenseCamera:
    """``Camera`` on a RealSense device. A thread keeps the newest pair; who reads aligns it.

    A frame's stamp is the clock's now less the frame's age by the system clock. Devices are looked for in
    librealsense's ``context``; None: a new one. In tests it holds a software device. Raises ``NoRealSense`` if it is
    not plugged in, or there are several and none is named, and ``HardwareError`` if it does not stream as it is asked
    to.
    """

    def __init__(self, settings: RealSenseSettings, clock: Clock, context: Any = None) -> None:
        self._settings = settings
        self._clock = clock
        self._context = context if context is not None else rs.context()
        self._serial = choose_serial(settings.serial, _serials(self._context))
        self._maker, self._making = FrameMaker(), threading.Lock()
        self._exposed = -math.inf
        self._made: tuple[_Pair, Frame] | None = None
        self._pipeline = self._start()  # here, so that a wrong setting is told at once
        self._reader = DeviceReader[_Pair]("realsense", self._run)
        silent = f"RealSense {self._serial} sends no pictures: plug it into a USB 3 port, and close other programs "
        self._reader.start(FIRST_FRAME, HardwareError(f"{silent}that use it"))

    def read(self, max_age: float) -> Frame:
        """See ``Camera.read``. While the camera is unplugged this raises; afterwards it works again."""
        with self._making:  # who plays and who watches for hands read in threads of their own
            newest = self._reader.newest()
            age = time.time() - newest.exposed
            if age > max_age:
                raise StaleFrame(age, max_age)
            if self._made is None or self._made[0] is not newest:
                stamp = self._clock.now() - max(age, 0.0)
                if self._made is not None:
                    stamp = max(stamp, self._made[1].stamp)
                self._made = newest, self._maker.make(newest.frameset, stamp)
            frame = self._made[1]
        depth = None if frame.depth is None else frame.depth.copy()
        return Frame(frame.colour.copy(), depth, frame.intrinsics, frame.stamp)

    def close(self) -> None:
        """See ``Camera.close``."""
        self._reader.end()
        self._made = None

    # the thread

    def _run(self) -> None:
        """Take framesets until the camera is closed; when they stop coming, look for the camera again."""
        pipeline: Any = self._pipeline
        while not self._reader.closing.is_set():
            if pipeline is None:
                pipeline = self._restart()
            elif not self._take(pipeline):
                _stop(pipeline)
                pipeline = None
                self._reader.fail(self._lost())
        if pipeline is not None:
            _stop(pipeline)

    def _take(self, pipeline: Any) -> bool:
        """Wait for the next pair and keep it; False: none came."""
        deadline = time.monotonic() + SILENCE
        while time.monotonic() < deadline and not self._reader.closing.is_set():
            try:
                there, frameset = pipeline.try_wait_for_frames(100)
            except RuntimeError:  # librealsense noticed first that the device is gone
                return False
            if there and frameset.size() == 2:
                self._keep(frameset)
                return True
        return self._reader.closing.is_set()

    def _keep(self, frameset: Any) -> None:
        frameset.keep()
        arrived = time.time()
        exposed = min(exposure_time(frameset.get_color_frame(), arrived), arrived)
        self._exposed = max(exposed, self._exposed)
        self._reader.put(_Pair(frameset, self._exposed))

    def _restart(self) -> Any:
        """A new pipeline if the camera is there again, else None after a while."""
        if self._serial in _serials(self._context):
            try:
                return self._start()
            except HardwareError as error:
                self._reader.fail(error)
        self._reader.closing.wait(RETRY)
        return None

    def _lost(self) -> HardwareError:
        return NoRealSense(
            f"RealSense {self._serial} sends no pictures any more: check its cable; it is used again once it is "
            "plugged in"
        )

    def _start(self) -> Any:
        wanted = self._settings
        config = rs.config()
        config.enable_device(self._serial)
        config.enable_stream(rs.stream.depth, wanted.depth_width, wanted.depth_height, rs.format.z16, wanted.fps)
        config.enable_stream(rs.stream.color, wanted.width, wanted.height, rs.format.rgb8, wanted.fps)
        pipeline = rs.pipeline(self._context)
        try:
            profile = pipeline.start(config)
        except RuntimeError as error:
            raise HardwareError(
                f"RealSense {self._serial} does not stream colour at {wanted.width}x{wanted.height} with depth at "
                f"{wanted.depth_width}x{wanted.depth_height} and {wanted.fps} pictures a second ({error}): choose a "
                "mode that it supports, and a USB 3 port"
            ) from error
        try:
            apply_options(profile.get_device().query_sensors(), wanted)
        except HardwareError:
            _stop(pipeline)
            raise
        except RuntimeError as error:  # librealsense's own: the device went, or was not ready yet
            _stop(pipeline)
            raise HardwareError(
                f"RealSense {self._serial} does not take its settings ({error}): plug it in again"
            ) from error
        return pipeline


def choose_serial(wanted: str | None, present: list[str]) -> str:
    """The serial number of the camera to use: the wanted one, or whichever is there, of all that are plugged in.

    Raises ``NoRealSense`` if it is not there, or there are several and none is wanted.
    """
    listed = ", ".join(present)
    if wanted is not None and wanted not in present:
        there = f"there are {listed}" if present else "there is none at all"
        raise NoRealSense(f"RealSense {wanted} is not plugged in, {there}: check its cable and the serial number")
    if wanted is not None:
        return wanted
    if not present:
        raise NoRealSense("no RealSense camera is plugged in: check its cable, and that this user may use USB devices")
    if len(present) > 1:
        raise NoRealSense(f"there are several RealSense cameras: set serial to one of {listed}")
    return present[0]


def exposure_time(picture: Any, arrived: float) -> float:
    """When a picture of librealsense's was exposed, given when it was handed out [s, system clock].

    Stamps of the system's clock, or of the device's own fitted to it, say so. Others only order pictures: then it is
    when the computer got it.
    """
    if picture.get_frame_timestamp_domain() != rs.timestamp_domain.hardware_clock:
        return float(picture.get_timestamp()) * 1e-3
    arrival = rs.frame_metadata_value.time_of_arrival
    if picture.supports_frame_metadata(arrival):
        return float(picture.get_frame_metadata(arrival)) * 1e-3
    return arrived


def apply_options(sensors: list[Any], wanted: RealSenseSettings) -> None:
    """Set exposure, gain and emitter where sensors have them; raises ``HardwareError`` if one is out of range."""
    for sensor in sensors:
        if sensor.supports(rs.option.emitter_enabled):
            _set(sensor, rs.option.emitter_enabled, 1.0 if wanted.emitter else 0.0)
        if sensor.supports(rs.option.depth_units):
            continue  # the depth sensor: it exposes by itself
        if sensor.supports(rs.option.enable_auto_exposure):
            _set(sensor, rs.option.enable_auto_exposure, 1.0 if wanted.exposure is None else 0.0)
        if wanted.exposure is not None:
            _set(sensor, rs.option.exposure, wanted.exposure / EXPOSURE_UNIT)
        if wanted.gain is not None:
            _set(sensor, rs.option.gain, wanted.gain)


def _set(sensor: Any, option: Any, value: float) -> None:
    if not sensor.supports(option):
        raise HardwareError(f"this RealSense camera has no setting {option.name}: leave it out")
    span = sensor.get_option_range(option)
    if not span.min <= value <= span.max:
        raise HardwareError(
            f"{option.name} {value:g} is outside the camera's range {span.min:g} to {span.max:g}: choose a value "
            "within it"
        )
    sensor.set_option(option, value)


def _serials(context: Any) -> list[str]:
    """Of the devices that are there; one that goes or comes at this very moment is not."""
    number, found = rs.camera_info.serial_number, list[str]()
    with suppress(RuntimeError):  # librealsense met a device that it could not ask
        for device in context.query_devices():
            if device.supports(number):
                found.append(device.get_info(number))
    return found


def _stop(pipeline: Any) -> None:
    try:
        pipeline.stop()
    except RuntimeError:
        return  # the device is gone, and its pipeline with it
