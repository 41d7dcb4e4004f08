"""The simulated camera's geometry, after Intel's datasheet of the RealSense D400 series (337029).

Frames: each sensor's own, as OpenCV's (x right, y down, z along the view). Seen along the view the sensors stand in one
line: colour, 15 mm to the right the left imager, 50 mm further the right imager. All look the same way.
"""

import math
from typing import Final

import numpy as np

from hardware.interfaces import Intrinsics

COLOUR_FIELD_OF_VIEW: Final = math.radians(42.5)
"""Vertical, of both colour modes: 1280×720 has 69.4° × 42.5°, and 640×480 is cut out of its middle."""
DEPTH_FIELD_OF_VIEW: Final = math.radians(87.0)
"""Horizontal, of the depth mode 848×480."""
DEPTH_WIDTH: Final = 848
DEPTH_HEIGHT: Final = 480
GLANCE: Final = 2
"""Depth for who looks often has so many times fewer pixels along each axis, as by librealsense's decimation filter."""
LEFT_IMAGER: Final = 0.015
"""From the colour sensor to the left imager, where depth is seen from [m]."""


def colour_intrinsics(width: int, height: int) -> Intrinsics:
    """Pinhole of the colour sensor for pictures of this size [px]."""
    return _pinhole(width, height, 0.5 * height / math.tan(0.5 * COLOUR_FIELD_OF_VIEW))


def depth_intrinsics(decimation: int = 1) -> Intrinsics:
    """Pinhole of the left imager, with so many times fewer pixels along each axis."""
    width, height = DEPTH_WIDTH // decimation, DEPTH_HEIGHT // decimation
    return _pinhole(width, height, 0.5 * width / math.tan(0.5 * DEPTH_FIELD_OF_VIEW))


def _pinhole(width: int, height: int, focal: float) -> Intrinsics:
    """With the focal length in single precision, as librealsense keeps it."""
    single = float(np.float32(focal))
    return Intrinsics(width, height, single, single, 0.5 * (width - 1), 0.5 * (height - 1))
