"""Camera and clock of the simulated rig, as the app sees them."""

import json
import math
import socket
import threading
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hardware.camera.software_device import DepthStream, SoftwareCamera
from hardware.interfaces import CameraClosed, Frame, HardwareError, Intrinsics, StaleFrame
from hardware.sim.clients import wire
from hardware.sim.render.renderer import HEIGHT, WIDTH, frame_path, load_pictures


class SimClock(wire.WorldClient):
    """``Clock`` on plant time. Threads may share it: while one sleeps, the others wait."""

    def __init__(self, run_dir: Path) -> None:
        super().__init__(run_dir, "clock")
        self._link.settimeout(None)
        self._lock = threading.Lock()

    def now(self) -> float:
        """Plant time [s]."""
        with self._lock:
            return float(wire.ask(self._link, {})["tick"]) * self._period

    def sleep(self, duration: float) -> None:
        """Wait for plant time, in whole ticks, rounded up; in pace fast this makes it run."""
        ticks = math.ceil(duration / self._period - 1e-6)  # so that n periods are n ticks
        if ticks > 0:
            with self._lock:
                wire.ask(self._link, {"sleep_ticks": ticks})


class FrameStream:
    """Frames of one view at fixed intervals of plant time, while it runs; for films."""

    def __init__(self, run_dir: Path, camera: str, ticks: int) -> None:
        """Subscribe: one frame at every multiple of so many ticks; raises as ``SimCamera``."""
        self._link, answer = connect_camera(run_dir, camera)
        self._path = frame_path(run_dir, int(answer["slot"]))
        self._cancelled = False
        self._link.settimeout(0.2)
        self._link.send(json.dumps({"camera": camera, "stream_ticks": ticks}).encode())

    def next(self) -> tuple[NDArray[np.uint8], int] | None:
        """The next frame, RGB (h, w, 3), and its tick.

        None when the stream was cancelled, the world has ended, or there are no pictures any more.
        """
        while not self._cancelled:
            try:
                message = self._link.recv(wire.LARGEST_MESSAGE)
                answer = json.loads(message) if message else {}
                if "exposed" not in answer:
                    return None
                pixels, _ = load_pictures(self._path, WIDTH, HEIGHT, depth=False)
                self._link.send(b'{"taken": true}')
            except TimeoutError:
                continue
            except OSError:
                return None
            return pixels, int(answer["exposed"])
        return None

    def cancel(self) -> None:
        """Let ``next`` return None, from another thread."""
        self._cancelled = True

    def close(self) -> None:
        """Let the world go."""
        self._link.close()


class SimCamera:
    """``Camera`` looking at the simulated board; every read exposes a new frame, of its ``intrinsics``.

    Pictures take the way of a real RealSense camera's: both sensors' own pictures through librealsense, which aligns
    depth to colour. Clean views of other cameras come as they are drawn.
    """

    def __init__(self, run_dir: Path, camera: str = "camera", depth: bool = True) -> None:
        """Connect to the world of a run directory, for one of its views, with depth or without.

        Raises ``HardwareError`` if no world answers, it has no such camera, or that has no depth.
        """
        self._link, answer = connect_camera(run_dir, camera)
        view = answer["views"][camera]
        if depth and view["depth"] is None:
            self._link.close()
            raise HardwareError(f"the view '{camera}' has no depth: ask for frames without it")
        self._period = float(answer["period"])
        self.intrinsics = Intrinsics(**view["colour"])
        self._wish = {"camera": camera, "depth": depth}
        self._path = frame_path(run_dir, int(answer["slot"]))
        self._device = SoftwareCamera(self.intrinsics, depth_stream(view["depth"]) if depth else None)

    def read(self, max_age: float = 0.25) -> Frame:
        """See ``Camera.read``."""
        if self._link.fileno() < 0:
            raise CameraClosed
        answer = wire.ask(self._link, self._wish)
        exposed = int(answer["exposed"])
        age = (int(answer["tick"]) - exposed) * self._period
        if age > max_age:
            raise StaleFrame(age, max_age)
        pinhole, stamp = self.intrinsics, exposed * self._period
        colour, units = load_pictures(self._path, pinhole.width, pinhole.height, depth=bool(self._wish["depth"]))
        return self._device.frame(colour, units, stamp)

    def close(self) -> None:
        """Let the world go."""
        self._link.close()
        self._device.close()


def depth_stream(description: dict[str, Any]) -> DepthStream:
    """The depth sensor of a view, as the world describes it."""
    pinhole = Intrinsics(**description["pinhole"])
    return DepthStream(pinhole, float(description["unit"]), float(description["offset"]))


def connect_camera(run_dir: Path, camera: str) -> tuple[socket.socket, dict[str, Any]]:
    """The socket of a camera's client and the world's answer; ``HardwareError`` if there is none, or no such camera."""
    link, answer = wire.connect(run_dir, "camera")
    views = answer["views"]
    if camera not in views:
        link.close()
        raise HardwareError(f"the world has no camera '{camera}': there are {', '.join(views)}")
    return link, answer
