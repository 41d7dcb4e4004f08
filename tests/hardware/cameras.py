"""What the cameras' tests share: a clock, made-up pictures, and a RealSense camera of software."""

from __future__ import annotations

import gc
import threading
import time
from typing import Any

import numpy as np
import pyrealsense2 as rs
from numpy.typing import NDArray

from hardware.camera.software_device import DepthStream, SoftwareDevice
from hardware.interfaces import Frame, Intrinsics

PINHOLE = Intrinsics(640, 480, 600.0, 600.0, 319.5, 239.5)
DEPTH = DepthStream(Intrinsics(848, 480, 450.0, 450.0, 423.5, 239.5), 1e-3, 0.015)


class WallClock:
    """Plant time of a lab: passes as wall time does."""

    def __init__(self) -> None:
        self._start = time.monotonic() - 100.0

    def now(self) -> float:
        return time.monotonic() - self._start

    def sleep(self, duration: float) -> None:
        time.sleep(duration)


class HandClock:
    """Time that a test moves."""

    def __init__(self, now: float = 0.0) -> None:
        self.time = now

    def now(self) -> float:
        return self.time

    def sleep(self, duration: float) -> None:
        self.time += duration


def colour_picture(number: int, pinhole: Intrinsics = PINHOLE) -> NDArray[np.uint8]:
    """A picture that tells its number, and which way round it is."""
    picture = np.zeros((pinhole.height, pinhole.width, 3), np.uint8)
    picture[..., 0] = number
    picture[..., 1] = np.arange(pinhole.width) % 256
    picture[..., 2] = (np.arange(pinhole.height) % 256)[:, None]
    return picture


def made_up_frame(number: int, stamp: float, depth: bool = True) -> Frame:
    """A frame whose depth grows from left to right, with a hole."""
    metres = None
    if depth:
        row = (np.rint(np.linspace(5000.0, 9000.0, PINHOLE.width)) * 1e-4).astype(np.float32)
        metres = np.repeat(row[None, :], PINHOLE.height, axis=0)
        metres[10:20, 10:20] = 0.0
    return Frame(colour_picture(number), metres, PINHOLE, stamp)


class Plugs(rs.context):
    """A computer to which a software camera can be plugged, and from which it can be pulled."""

    def __init__(self, *devices: SoftwareDevice) -> None:
        super().__init__()
        self.plugged = True
        self._infos: list[Any] = []
        # a context keeps weak references to what was added; the list that its callback gets keeps them alive
        self.set_devices_changed_callback(lambda change: self._infos.append(change.get_new_devices()))
        for one in devices:
            one.device.add_to(self)

    def query_devices(self) -> Any:
        return super().query_devices() if self.plugged else []


class SoftwareRealSense:
    """A RealSense camera that sends made-up pictures until it is pulled."""

    def __init__(self, serial: str = "1234") -> None:
        self.device = SoftwareDevice(PINHOLE, DEPTH, serial)
        self.plugs = Plugs(self.device)
        self.sending = threading.Event()
        self.sending.set()
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._send)
        self._thread.start()

    def pull(self) -> None:
        self.plugs.plugged = False
        self.sending.clear()

    def plug(self) -> None:
        self.plugs.plugged = True
        self.sending.set()

    def _send(self) -> None:
        number = 0
        depth = np.full((DEPTH.pinhole.height, DEPTH.pinhole.width), 600, np.uint16)
        while not self._ending.wait(0.03):
            if self.sending.is_set():
                number = (number + 1) % 256
                self.device.push(colour_picture(number), depth, time.time())

    def close(self) -> None:
        self._ending.set()
        self._thread.join()
        gc.collect()
