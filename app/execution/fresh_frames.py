"""Pictures of the board while nothing moves over it."""

from __future__ import annotations

import math
from typing import Final

from app.execution.state import FRAME_AGE, Clearance, Devices
from app.rig.arm import Arm
from hardware.interfaces import Camera, Clock, Frame, HardwareError

PATIENCE: Final = 3.0
"""So long a fresh frame is waited for [s]."""


class FreshFrames:
    """Frames of a rig's camera, each exposed after the asking, with the arm at rest.

    Args:
        devices: of the rig; it has a camera.
    """

    def __init__(self, devices: Devices) -> None:
        assert devices.camera is not None
        self._camera: Camera = devices.camera
        self._clock: Clock = devices.clock
        self._arm: Arm = devices.arm
        self._guard = devices.guard
        self._last: Frame | None = None
        self._arrivals: int | None = None
        """So often a hand had come when the newest frame was asked for; None: one was there, as it did not go."""

    @property
    def last(self) -> Frame:
        """The newest frame."""
        assert self._last is not None, "nothing was looked at"
        return self._last

    @property
    def deep(self) -> bool:
        """Whether the newest frame has depth."""
        return self.last.depth is not None

    @property
    def looked_at(self) -> float:
        """When the newest frame was exposed [s]; long ago, if nothing was looked at."""
        return -math.inf if self._last is None else self._last.stamp

    def frame(self) -> Frame:
        """A frame exposed from now on, the arm being at rest, and, where somebody watches, no hand over the board; if
        one does not go for long, with it: see ``seen``.

        Raises:
            HardwareError: the camera gives none.
        """
        if self._guard is not None:
            self._arrivals = self._guard.arrivals if self._guard.wait_for_sight() else None
        self._arm.state()  # in pace fast: once plant time stands, so that the exposure's tick is decided
        since = self._clock.now()
        while True:
            frame = self._camera.read(FRAME_AGE)
            if frame.stamp >= since:
                self._last = frame
                return frame
            if self._clock.now() > since + PATIENCE:
                raise HardwareError(f"the camera gave no new picture within {PATIENCE:.0f} s: check its cable")
            self._clock.sleep(0.01)

    @property
    def seen(self) -> Clearance | None:
        """Up to which hand the newest frame shows the board; None: nothing was looked at."""
        return None if self._last is None else Clearance(self._arrivals)
