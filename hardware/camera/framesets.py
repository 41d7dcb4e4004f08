"""Pairs of pictures as librealsense hands them out, made into frames: one piece of code for a camera, a simulated
one and a recording.

Depth pixels that have none are 0.
"""

from typing import Any, Final

import numpy as np
import pyrealsense2 as rs
from numpy.typing import NDArray

from hardware.interfaces import Frame, HardwareError, Intrinsics

DISTORTION_LIMIT: Final = 1.0
"""A picture whose corners are displaced by more than this is not a pinhole's [px]."""


class FrameMaker:
    """Turns framesets into frames: depth in metres, aligned to the colour picture."""

    def __init__(self) -> None:
        self._align = rs.align(rs.stream.color)

    def make(self, frameset: Any, stamp: float) -> Frame:
        """A frame that owns its arrays, of librealsense's frameset, with a stamp of exposure [s].

        Raises ``HardwareError`` if there is no colour picture, or it is of a kind that cannot be used.
        """
        colour = frameset.get_color_frame()
        if not colour:
            raise HardwareError("the camera sent no colour picture: choose a mode with colour and depth")
        pinhole = pinhole_of(colour.profile)
        depth = frameset.get_depth_frame()
        if depth and not _coincide(depth.profile, colour.profile):
            # librealsense spreads each depth pixel over its neighbours here, so what is aligned already is left alone
            depth = self._align.process(frameset).get_depth_frame()
        return Frame(_rgb(colour), _metres(depth) if depth else None, pinhole, stamp)


def pinhole_of(profile: Any) -> Intrinsics:
    """Intrinsics of a stream; raises ``HardwareError`` if its pictures are distorted."""
    lens = profile.as_video_stream_profile().get_intrinsics()
    k1, k2, p1, p2, k3 = lens.coeffs
    x, y = 0.5 * lens.width / lens.fx, 0.5 * lens.height / lens.fy
    square = x * x + y * y
    radial = abs(k1 * square + k2 * square**2 + k3 * square**3) * square**0.5
    displaced = lens.fx * (radial + 3.0 * square * (abs(p1) + abs(p2)))
    if lens.model != rs.distortion.none and displaced > DISTORTION_LIMIT:
        raise HardwareError(
            f"the camera's colour pictures are distorted by {displaced:.1f} px at the corners, at most "
            f"{DISTORTION_LIMIT:.0f} px is accepted: use a camera that rectifies colour, such as a D435"
        )
    return Intrinsics(lens.width, lens.height, lens.fx, lens.fy, lens.ppx, lens.ppy)


def _coincide(one: Any, other: Any) -> bool:
    """Whether two streams have the same pinhole in the same place."""
    apart = one.get_extrinsics_to(other)
    here = np.allclose(apart.translation, 0.0, atol=1e-6) and np.allclose(apart.rotation, np.eye(3).ravel(), atol=1e-6)
    return here and pinhole_of(one) == pinhole_of(other)


def _rgb(colour: Any) -> NDArray[np.uint8]:
    kind = colour.profile.format()
    pixels = np.asanyarray(colour.get_data())
    if kind == rs.format.rgb8:
        return np.array(pixels, dtype=np.uint8)
    if kind == rs.format.bgr8:
        return np.array(pixels[..., ::-1], dtype=np.uint8)
    raise HardwareError(f"colour pictures of format {kind.name} cannot be read: record or stream rgb8 or bgr8")


def _metres(depth: Any) -> NDArray[np.float32]:
    metres: NDArray[np.float32] = np.asanyarray(depth.get_data()).astype(np.float32) * np.float32(depth.get_units())
    return metres
