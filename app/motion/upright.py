"""Setting up what has fallen: grasp it low, turn it up about the edge of its foot, carry it to its place.

The tool only translates. Between two pads a piece can turn about the finger axis all the same: the fingers hold it
loosely, the edge of its foot stays on the board, and the tool goes round that edge on a quarter of a circle. Then the
fingers press, and the grooves of the pads draw the stem straight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from pydantic import BaseModel, ConfigDict, PositiveFloat

from app.manipulation import Stage
from app.motion.gains import Softness
from app.motion.obstacles import Crowd, Standing, closed_position
from app.motion.path import Vector
from app.motion.plan import Motion, Plan, PlanRefused, Style
from app.motion.reference import Segment, dwell, join, to_samples
from app.motion.route import Route, timed
from app.motion.settings import MotionSettings
from app.motion.ways import Hop, Workcell, over
from controller.protocol import Guard
from hardware.parameters import RobotParameters
from hardware.table import PIECE_SHAPES, Kind, Place, TableSettings


class Uprighting(BaseModel):
    """How a piece is stood up."""
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
    share: PositiveFloat = 0.62
    low: PositiveFloat = 0.008
    soft_force: PositiveFloat = 0.8
    duration: PositiveFloat = 1.0
    press: float = 0.001
    turn: float = math.pi / 2


@dataclass(frozen=True, slots=True)
class Lying:
    name: str
    kind: Kind
    base: tuple[float, float]
    head: tuple[float, float]


def quarter(cell, start, direction, height, how: Uprighting, loose_ticks: int):
    """Arc about the foot's edge."""
