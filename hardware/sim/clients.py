"""Camera and clock of the simulated rig, as the app sees them."""

from __future__ import annotations

import json
import threading
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hardware.interfaces import Frame, HardwareError, Intrinsics, StaleFrame
from hardware.sim import wire
from hardware.sim.renderer import HEIGHT, WIDTH, frame_bytes, frame_path

FRAME_TIMEOUT = 30.0


class SimClock:
    """``Clock`` on plant time."""

    def __init__(self, run_dir: Path) -> None:
        """Connect to the world of a run directory."""
        self._link, answer = wire.connect(run_dir, "clock")
        self._link.settimeout(None)
        self._period = float(answer["period"])
        self._lock = threading.Lock()

    def now(self) -> float:
        """Plant time [s]."""
        with self._lock:
            return float(wire.ask(self._link, {})["tick"]) * self._period

    def sleep(self, duration: float) -> None:
        """Wait for plant time; in pace fast this makes it run."""
        ticks = int(np.ceil(duration / self._period))
        if ticks > 0:
            with self._lock:
                wire.ask(self._link, {"sleep_ticks": ticks})

    def close(self) -> None:
        """Let the world go."""
        self._link.close()


class FrameStream:
    """Frames of one view at fixed intervals of plant time, while it runs; for films."""

    def __init__(self, run_dir: Path, camera: str, ticks: int) -> None:
        """Subscribe: one frame each so many ticks."""
        self._link, answer = wire.connect(run_dir, "camera")
        self._slot = int(answer["slot"])
        self._path = frame_path(run_dir, self._slot)
        self._cancelled = False
        self._link.settimeout(0.2)
        self._link.send(json.dumps({"camera": camera, "slot": self._slot, "stream_ticks": ticks}).encode())

    def next(self) -> tuple[NDArray[np.uint8], int] | None:
        """The next frame, RGB (h, w, 3), and its tick; None when the stream was cancelled or the world has ended."""
        while not self._cancelled:
            try:
                message = self._link.recv(wire.LARGEST_MESSAGE)
                if not message:
                    return None
                pixels = np.fromfile(self._path, dtype=np.uint8, count=3 * WIDTH * HEIGHT)
                self._link.send(b'{"taken": true}')
            except TimeoutError:
                continue
            except OSError:
                return None
            return pixels.reshape(HEIGHT, WIDTH, 3), int(json.loads(message)["tick"])
        return None

    def cancel(self) -> None:
        """Let ``next`` return None, from another thread."""
        self._cancelled = True

    def close(self) -> None:
        """Let the world go."""
        self._link.close()


class SimCamera:
    """``Camera`` looking at the simulated board; every read exposes a new frame."""

    def __init__(self, run_dir: Path, camera: str = "camera", depth: bool = True) -> None:
        """Connect to the world of a run directory; ``camera`` is one of its views."""
        self._link, answer = wire.connect(run_dir, "camera")
        self._link.settimeout(FRAME_TIMEOUT)
        self._period = float(answer["period"])
        self._camera, self._depth, self._slot = camera, depth, int(answer["slot"])
        self.intrinsics = Intrinsics(**answer["intrinsics"][camera])
        self._path = frame_path(run_dir, self._slot)
        self._pixels: np.memmap[tuple[int], np.dtype[np.uint8]] | None = None

    def read(self, max_age: float = 0.25) -> Frame:
        """See ``Camera.read``."""
        answer = wire.ask(self._link, {"camera": self._camera, "slot": self._slot, "depth": self._depth})
        age = (int(answer["tick"]) - int(answer["exposed"])) * self._period
        if age > max_age:
            raise StaleFrame(age, max_age)
        if self._pixels is None:
            if self._path.stat().st_size != frame_bytes():
                raise HardwareError(f"the frame at {self._path} has not {frame_bytes()} bytes")
            self._pixels = np.memmap(self._path, dtype=np.uint8, mode="r", shape=(frame_bytes(),))
        count = WIDTH * HEIGHT
        colour = np.array(self._pixels[: 3 * count]).reshape(HEIGHT, WIDTH, 3)
        depth = None
        if self._depth:
            depth = np.array(self._pixels[3 * count :]).view(np.float32).reshape(HEIGHT, WIDTH)
        return Frame(colour, depth, self.intrinsics, int(answer["exposed"]) * self._period)

    def close(self) -> None:
        """Let the world go."""
        self._link.close()
