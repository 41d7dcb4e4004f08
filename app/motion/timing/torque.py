"""What torques a motion asks of the servomotors, by the inverse dynamics of the model."""

from functools import cache
from typing import Final

import numpy as np

from app.motion.timing.reference import Segment
from controller.law.settings import LawSettings
from controller.model.compiled import FloatArray
from controller.model.constants import DeltaModel
from controller.model.demand import torque_demand
from controller.model.kinematics import OK
from hardware.parameters import RobotParameters

EVERY: Final = 8
"""Samples are looked at so far apart: 7 ms, in which a torque changes by some tenths of a newton metre."""


@cache
def _numbers(parameters: RobotParameters) -> tuple[FloatArray, float]:
    return DeltaModel(parameters).constants, LawSettings().coulomb_speed


class TorqueModel:
    """The inverse dynamics of a robot."""

    def __init__(self, parameters: RobotParameters) -> None:
        self._numbers = _numbers(parameters)

    def along(self, motion: Segment) -> tuple[FloatArray, FloatArray]:
        """Torques of some of a motion's samples, ``EVERY`` apart, and those of rest at their places, (n, 3) each [N m];
        ``ValueError`` if one is out of reach.
        """
        status, row, torque, holding = torque_demand(*self._numbers, np.ascontiguousarray(motion.table[::EVERY]))
        if status != OK:
            x, y, z = motion.position[EVERY * row].tolist()
            raise ValueError(f"the arm does not reach ({x:.3f}, {y:.3f}, {z:.3f}) m")
        return torque, holding

    def peak(self, motion: Segment) -> tuple[float, float]:
        """Largest torque of a motion, and that of rest at its places [N m]; as `along`."""
        torque, holding = self.along(motion)
        return float(np.abs(torque).max()), float(np.abs(holding).max())
