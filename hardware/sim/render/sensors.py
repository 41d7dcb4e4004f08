"""The simulated camera's two sensors: what they make of a clean picture."""

from __future__ import annotations

from typing import Final

from hardware.sim.render.d435 import GLANCE, depth_intrinsics
from hardware.sim.render.sensor_model import ColourSensor, StereoSensor

STEREO: Final = StereoSensor(depth_intrinsics())
GLANCING: Final = STEREO.decimated(depth_intrinsics(GLANCE), GLANCE)
COLOUR: Final = ColourSensor()
