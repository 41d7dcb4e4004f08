"""Depth as the calibration corrects it: frames whose distances are multiplied by a factor."""

from dataclasses import replace
from typing import TypeVar

import numpy as np

from app.rig.devices import GuardFrames
from hardware.interfaces import Camera, DepthFrame, Frame

_F = TypeVar("_F", bound=Frame | DepthFrame)


def scaled_camera(camera: Camera, factor: float) -> Camera:
    """The same camera with corrected depth; itself where there is nothing to correct."""
    return camera if factor == 1.0 else _ScaledCamera(camera, factor)


def scaled_frames(frames: GuardFrames, factor: float) -> GuardFrames:
    """The same frames with corrected depth."""
    return frames if factor == 1.0 else _ScaledFrames(frames, factor)


def _scaled(frame: _F, factor: float) -> _F:
    return frame if frame.depth is None else replace(frame, depth=frame.depth * np.float32(factor))


class _ScaledCamera:
    def __init__(self, camera: Camera, factor: float) -> None:
        self._camera, self._factor = camera, factor
        self.close = camera.close

    def read(self, max_age: float) -> Frame:
        """See ``Camera.read``."""
        return _scaled(self._camera.read(max_age), self._factor)


class _ScaledFrames:
    def __init__(self, frames: GuardFrames, factor: float) -> None:
        self._frames, self._factor = frames, factor
        self.wake, self.release, self.close = frames.wake, frames.release, frames.close

    def read(self, max_age: float) -> Frame | DepthFrame:
        """See ``GuardFrames.read``."""
        return _scaled(self._frames.read(max_age), self._factor)
