"""The board's camera as one sees it who watches the table while the arm moves."""

import json
import threading
from pathlib import Path
from typing import Any

import numpy as np

from hardware.camera.software_device import SoftwareCamera
from hardware.interfaces import CameraClosed, DepthFrame, Frame, Intrinsics, RigGone, StaleFrame
from hardware.sim.clients import wire
from hardware.sim.clients.camera import connect_camera, depth_stream
from hardware.sim.render.d435 import GLANCE
from hardware.sim.render.renderer import frame_path, load_depth, load_pictures

_GLANCE = 0.1
"""How long a reader that was closed by another thread goes on waiting [s, wall]."""


class SimWatchCamera:
    """``Camera`` whose frames come at a steady rate, as a video camera's do, while plant time runs.

    Each ``read`` waits for the next frame, of its ``intrinsics``, and hands the last one back. In pace fast plant time
    stands from a frame's delivery until then, so what a reader does about a frame takes no plant time: its reading
    thread decides what the arm does before the next tick. A reader that pauses calls ``release``.
    """

    def __init__(
        self,
        run_dir: Path,
        interval: float = 1.0 / 30.0,
        depth: bool = True,
        colour_asleep: bool = True,
        *,
        glance: bool = False,
    ) -> None:
        """Connect to the world of a run directory, for a frame each ``interval`` of plant time [s].

        Args:
            run_dir: of the world; ``HardwareError`` where none answers, or it has no cameras.
            interval: from frame to frame [s]; kept as the nearest whole number of ticks.
            depth: whether frames have depth; ``ValueError`` where they would have neither depth nor colour.
            colour_asleep: whether frames have colour also while the camera was not woken up. With it a frame takes the
                renderer more than twice as long; False: there is depth alone while the arm moves.
            glance: depth alone, always, coarse, and as the left imager sees it, beside the colour sensor: what a frame
                costs then is a tenth.
        """
        if not (depth or colour_asleep):
            raise ValueError("a frame without colour and depth shows nothing: ask for one of them")
        self._link, answer = connect_camera(run_dir, "camera")
        view = answer["views"]["camera"]
        self._run_dir = run_dir
        self._period = float(answer["period"])
        ticks = max(1, round(interval / self._period))
        self.interval = ticks * self._period
        self.intrinsics = Intrinsics(**(view["depth"]["glance"] if glance else view["colour"]))
        self._depth, self._glance, self._unit = depth, glance, float(view["depth"]["unit"])
        self._device = SoftwareCamera(Intrinsics(**view["colour"]), depth_stream(view["depth"]) if depth else None)
        self._held = self._closed = self._watching = False
        self._reading, self._sending = threading.Lock(), threading.Lock()
        self._link.settimeout(_GLANCE)
        self._wish = {
            "camera": "camera", "watch_ticks": ticks, "depth": depth, "colour_asleep": colour_asleep, "glance": glance,
        }  # fmt: skip

    def wake(self, awake: bool) -> None:
        """Whether plant time shall run for this camera, also while nothing moves; pace real: no difference."""
        self._begin()
        self._tell({"wake": awake})

    def release(self) -> None:
        """Hand the last frame back, so that plant time goes on; may be called from any thread."""
        with self._sending:
            held, self._held = self._held, False
        if held:
            self._tell({"taken": True})

    def read(self, max_age: float = 0.25) -> Frame | DepthFrame:
        """See ``Camera.read``; waits for a frame however long plant time stands.

        It has depth alone if it was exposed while the camera was asleep and colour is not wanted then. Raises
        ``StaleFrame`` if it came later than ``max_age`` after its exposure, ``CameraClosed`` if the camera was closed,
        perhaps meanwhile, and ``HardwareError`` if the world is gone, or draws no pictures any more.
        """
        with self._reading:
            self._begin()
            self.release()
            answer = self._next()
            self._held = True
            exposed = int(answer["exposed"])
            frame = self._load(int(answer["slot"]), exposed * self._period, colour=bool(answer["colour"]))
        age = (int(answer["tick"]) - exposed) * self._period
        if age > max_age:
            raise StaleFrame(age, max_age)
        return frame

    def close(self) -> None:
        """Let the world go; a reader in another thread ends with ``CameraClosed``. A second call does nothing."""
        self._closed = True
        with self._reading:
            self._link.close()
            self._device.close()

    def _begin(self) -> None:
        """Frames come from the first use on: plant time would wait for a reader who is not there yet."""
        with self._sending:
            begun, self._watching = self._watching, True
        if not begun:
            self._tell(self._wish)

    def _next(self) -> dict[str, Any]:
        while not self._closed:
            try:
                message = self._link.recv(wire.LARGEST_MESSAGE)
            except TimeoutError:
                continue
            except OSError as error:
                raise RigGone(f"the world does not answer ({error.strerror}): see its log") from error
            return wire.understood(message)
        raise CameraClosed

    def _load(self, slot: int, stamp: float, *, colour: bool) -> Frame | DepthFrame:
        pinhole = self.intrinsics
        if self._glance:
            whole = load_depth(frame_path(self._run_dir, slot), GLANCE)
            return DepthFrame(whole * np.float32(self._unit), pinhole, stamp)
        picture, units = load_pictures(
            frame_path(self._run_dir, slot), pinhole.width, pinhole.height, depth=self._depth, colour=colour
        )
        frame = self._device.frame(picture, units, stamp)
        if colour or frame.depth is None:
            return frame
        return DepthFrame(frame.depth, frame.intrinsics, stamp)

    def _tell(self, message: dict[str, Any]) -> None:
        if self._closed:
            return
        try:
            with self._sending:
                self._link.send(json.dumps(message).encode())
        except OSError as error:
            raise RigGone(f"the world does not answer ({error}); its log is in the run directory") from error
