"""Frames in librealsense's own recordings (``.db3``), written by its recorder and read by its playback."""

import gc
import queue
import threading
import weakref
from collections import deque
from functools import partial
from pathlib import Path
from typing import Any, Final

import pyrealsense2 as rs

from hardware.camera.folder import DEPTH_UNIT, whole_units
from hardware.camera.framesets import FrameMaker
from hardware.camera.recorded import RecordedFrame
from hardware.camera.software_device import DepthStream, Join, SoftwareDevice
from hardware.interfaces import Frame, HardwareError, Intrinsics

TOGETHER_MS: Final = 20.0
"""Colour and depth that were exposed within this belong together: a little more than half a period [ms]."""
_KINDS: Final = (rs.stream.color, rs.stream.depth)
_AHEAD: Final = 8
_WAIT: Final = 0.1
"""[s, wall]"""


class Db3Recorder:
    """Writes frames of any camera into a ``.db3`` file; raises ``HardwareError`` if it exists, or cannot be written."""

    def __init__(self, path: Path) -> None:
        if path.suffix != ".db3":
            raise HardwareError(f"{path} is not a name for a librealsense recording: it must end in .db3")
        if path.exists():
            raise HardwareError(f"{path} already exists: choose another name")
        if not path.parent.is_dir():
            raise HardwareError(f"there is no folder {path.parent}: create it first")
        self._path = path
        self._device: SoftwareDevice | None = None
        self._recorder: Any = None
        self._sensors: list[Any] = []
        self._like: tuple[Intrinsics, bool] | None = None

    def write(self, frame: Frame) -> None:
        """Add a frame; depth is kept in units of 0.1 mm, up to 6.55 m. Raises ``HardwareError`` if it is of another
        camera than the first one, or the file cannot be written.
        """
        like = frame.intrinsics, frame.depth is not None
        if self._device is None:
            self._begin(*like)
        elif like != self._like:
            raise HardwareError(f"a frame with {frame.intrinsics} does not belong to the recording {self._path}")
        assert self._device is not None, "it was just begun"
        depth = None if frame.depth is None else whole_units(frame.depth, DEPTH_UNIT)
        self._device.push(frame.colour, depth, frame.stamp)

    def close(self) -> None:
        """Finish the file; a second call does nothing."""
        while self._sensors:
            sensor = self._sensors.pop()
            sensor.stop()
            sensor.close()
        self._recorder = None
        gc.collect()  # librealsense writes the end of the file when its recorder is freed

    def _begin(self, pinhole: Intrinsics, depth: bool) -> None:
        self._like = pinhole, depth
        self._device = SoftwareDevice(pinhole, DepthStream(pinhole, DEPTH_UNIT) if depth else None)
        try:
            self._recorder = rs.recorder(str(self._path), self._device.device)
        except RuntimeError as error:
            raise HardwareError(f"{self._path} cannot be written: {error}: choose another file") from error
        for sensor in self._recorder.query_sensors():
            sensor.open(sensor.get_stream_profiles())
            sensor.start(rs.frame_queue(1))
            self._sensors.append(sensor)


class Db3Recording:
    """``Recording`` of a ``.db3`` file, ours or one of a RealSense camera.

    librealsense reads the file in a thread of its own, only a few pictures ahead. Raises ``HardwareError`` if there is
    none, or it cannot be read.
    """

    def __init__(self, path: Path) -> None:
        if not path.is_file():
            raise HardwareError(f"there is no recording {path}: check the name")
        self._path = path
        self._context = rs.context()
        self._ahead: queue.Queue[Any] = queue.Queue(_AHEAD)
        self._closing = threading.Event()
        self._maker, self._join = FrameMaker(), Join()
        try:
            self._playback = self._context.load_device(str(path))
            self._playback.set_real_time(False)
            self._sensors = self._playback.query_sensors()
            # also at the program's end: librealsense's thread must not call into an interpreter that is gone
            self._end = weakref.finalize(self, _end, self._sensors, self._closing)
            streams = [(sensor, sensor.get_stream_profiles()) for sensor in self._sensors]
            kinds = [profile.stream_type() for _sensor, profiles in streams for profile in profiles]
            self._waiting: dict[Any, deque[Any]] = {kind: deque() for kind in kinds if kind in _KINDS}
            for sensor, profiles in streams:
                wanted = [profile for profile in profiles if profile.stream_type() in _KINDS]
                if wanted:
                    sensor.open(wanted)
            self._playback.pause()  # until all sensors listen: else the first pictures of some would be lost
            for sensor in self._sensors:
                if sensor.get_active_streams():
                    sensor.start(partial(_take_in, self._ahead, self._closing))
            self._playback.resume()
        except RuntimeError as error:
            raise HardwareError(f"{path} is not a recording that librealsense can play: {error}") from error
        if rs.stream.color not in self._waiting:
            self.close()
            raise HardwareError(f"{path} holds no colour pictures: record colour as well")

    def next(self) -> RecordedFrame | None:
        """See ``Recording``."""
        while (pictures := self._pair()) is None:
            stopped = (
                self._playback.current_status() == rs.playback_status.stopped
            )  # before looking: nothing comes later
            try:
                picture = self._ahead.get(timeout=_WAIT)
            except queue.Empty:
                if stopped:
                    return None
                continue
            self._waiting[picture.profile.stream_type()].append(picture)
        frameset = self._join.frameset(pictures)
        stamp = float(frameset.get_color_frame().get_timestamp()) * 1e-3
        return RecordedFrame(stamp, lambda: self._maker.make(frameset, stamp))

    def close(self) -> None:
        """See ``Recording``."""
        self._end()

    def _pair(self) -> list[Any] | None:
        """The next pictures that belong together; those without a companion are passed over."""
        while all(self._waiting.values()):
            heads = [waiting[0] for waiting in self._waiting.values()]
            stamps = [head.get_timestamp() for head in heads]
            if max(stamps) - min(stamps) <= TOGETHER_MS:
                return [waiting.popleft() for waiting in self._waiting.values()]
            min(self._waiting.values(), key=lambda waiting: float(waiting[0].get_timestamp())).popleft()
        return None


def _take_in(ahead: queue.Queue[Any], closing: threading.Event, picture: Any) -> None:
    """Called by librealsense's thread; keeps it waiting while enough pictures are there."""
    picture.keep()
    while not closing.is_set():
        try:
            ahead.put(picture, timeout=_WAIT)
        except queue.Full:
            continue
        return


def _end(sensors: list[Any], closing: threading.Event) -> None:
    """Stop the playback."""
    closing.set()
    for sensor in sensors:
        if sensor.get_active_streams():
            sensor.stop()
            sensor.close()
