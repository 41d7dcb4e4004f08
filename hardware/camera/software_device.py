"""A RealSense camera made of software: pictures are put in, librealsense's own framesets come out.

Simulated and recorded pictures take the way of a real camera's through it. Framesets are joined by hand, since
librealsense's syncer loses pairs whose stamps do not come at a steady rate.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pyrealsense2 as rs
from numpy.typing import NDArray

from hardware.camera.framesets import FrameMaker
from hardware.interfaces import Frame, HardwareError, Intrinsics

FPS = 30
_WAIT_MS = 1000


@dataclass(frozen=True, slots=True)
class DepthStream:
    """A depth sensor beside the colour sensor, looking the same way."""

    pinhole: Intrinsics
    unit: float
    """Depth is a whole number of these [m]."""
    offset: float = 0.0
    """From the colour sensor to it, to the right [m]."""


class SoftwareDevice:
    """Colour and, if wanted, depth: ``device`` is librealsense's, which a pipeline finds by its serial number."""

    def __init__(self, colour: Intrinsics, depth: DepthStream | None, serial: str = "0") -> None:
        self.device = rs.software_device()
        self.device.register_info(rs.camera_info.serial_number, serial)
        self.device.register_info(rs.camera_info.name, "software camera")
        self._number = 0
        self._depth: tuple[Any, Any] | None = None
        if depth is not None:
            sensor = self.device.add_sensor("Stereo Module")
            sensor.add_read_only_option(rs.option.depth_units, depth.unit)
            self._depth = sensor, sensor.add_video_stream(_stream(rs.stream.depth, depth.pinhole))
            self._unit = depth.unit
        sensor = self.device.add_sensor("RGB Camera")
        self._colour = sensor, sensor.add_video_stream(_stream(rs.stream.color, colour))
        if depth is not None and self._depth is not None:
            self._depth[1].register_extrinsics_to(self._colour[1], _aside(depth.offset))
        self.device.create_matcher(rs.matchers.dlr_c if depth is not None else rs.matchers.default)

    def push(self, colour: NDArray[np.uint8], depth: NDArray[np.uint16] | None, stamp: float) -> None:
        """Put a pair of pictures in, exposed at a stamp [s]; who has started the sensors gets them.

        Colour is RGB, shape (h, w, 3); depth in units, shape (h', w'), must be there if the device has depth.
        """
        self._number += 1
        if self._depth is not None:
            if depth is None:
                raise ValueError("this device has depth: give a depth picture with each colour picture")
            self._put(*self._depth, depth, stamp, self._unit)
        self._put(*self._colour, colour, stamp, 0.0)

    def streams(self) -> list[tuple[Any, Any]]:
        """Sensors with the profile of their stream, depth first."""
        return [part for part in (self._depth, self._colour) if part is not None]

    def _put(self, sensor: Any, profile: Any, pixels: NDArray[Any], stamp: float, unit: float) -> None:
        frame = rs.software_video_frame()
        frame.pixels = np.ascontiguousarray(pixels)
        frame.bpp = pixels.itemsize * (pixels.shape[2] if pixels.ndim == 3 else 1)
        frame.stride = frame.bpp * pixels.shape[1]
        frame.timestamp, frame.domain = 1e3 * stamp, rs.timestamp_domain.system_time
        frame.frame_number, frame.depth_units = self._number, unit
        frame.profile = profile.as_video_stream_profile()
        sensor.on_video_frame(frame)


class SoftwareCamera:
    """A software device whose pictures are taken out again at once, as librealsense's framesets, made into frames."""

    def __init__(self, colour: Intrinsics, depth: DepthStream | None) -> None:
        self._device = SoftwareDevice(colour, depth)
        self._queues = []
        for sensor, profile in self._device.streams():
            queue = rs.frame_queue(1)
            sensor.open(profile)
            sensor.start(queue)
            self._queues.append(queue)
        self._join, self._maker = Join(), FrameMaker()

    def frame(self, colour: NDArray[np.uint8], depth: NDArray[np.uint16] | None, stamp: float) -> Frame:
        """The frame of what is put in as of ``SoftwareDevice.push``; raises ``HardwareError`` if a picture was lost."""
        self._device.push(colour, depth, stamp)
        pictures = []
        for queue in self._queues:
            there, picture = queue.try_wait_for_frame(_WAIT_MS)
            if not there:
                raise HardwareError("librealsense lost a picture of a software camera: start the program again")
            pictures.append(picture)
        return self._maker.make(self._join.frameset(pictures), stamp)

    def close(self) -> None:
        """Stop the sensors; a second call does nothing."""
        while self._queues:
            self._queues.pop()
            sensor, _profile = self._device.streams()[len(self._queues)]
            sensor.stop()
            sensor.close()


class Join:
    """Makes one frameset of single pictures."""

    def __init__(self) -> None:
        self._pictures: list[Any] = []
        self._done = rs.frame_queue(1)
        self._block = rs.processing_block(self._compose)
        self._block.start(self._done)

    def frameset(self, pictures: list[Any]) -> Any:
        """A frameset of these pictures; raises ``HardwareError`` if librealsense does not make it."""
        self._pictures = pictures
        self._block.invoke(pictures[-1])
        there, joined = self._done.try_wait_for_frame(_WAIT_MS)
        self._pictures = []
        if not there:
            raise HardwareError("librealsense did not join two pictures: start the program again")
        return joined.as_frameset()

    def _compose(self, _picture: Any, source: Any) -> None:
        source.frame_ready(source.allocate_composite_frame(self._pictures))


def _stream(kind: Any, pinhole: Intrinsics) -> Any:
    lens = rs.intrinsics()
    lens.width, lens.height, lens.model = pinhole.width, pinhole.height, rs.distortion.none
    lens.fx, lens.fy, lens.ppx, lens.ppy = pinhole.fx, pinhole.fy, pinhole.cx, pinhole.cy
    lens.coeffs = [0.0] * 5
    stream = rs.video_stream()
    stream.type, stream.uid, stream.fps, stream.intrinsics = kind, int(kind), FPS, lens
    stream.width, stream.height = pinhole.width, pinhole.height
    stream.fmt, stream.bpp = (rs.format.z16, 2) if kind == rs.stream.depth else (rs.format.rgb8, 3)
    return stream


def _aside(offset: float) -> Any:
    """From a sensor that stands so far to the right of another, to that one."""
    extrinsics = rs.extrinsics()
    extrinsics.rotation = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    extrinsics.translation = [offset, 0.0, 0.0]
    return extrinsics
