"""The gripper and its tactile sensors as something attached to the simulated arm, as in Fig. 4 of the paper.

What a finger or a sensor does stands in `controller.law.tactile`; here are their states and the law that reads them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from controller.law.tactile import Pair, force_on_tool, gripper_acceleration, sensor_rate
from controller.law.task_space import LawSettings, TaskSpaceController
from controller.model.compiled import FloatArray, Vector
from controller.model.constants import DeltaModel
from controller.model.kinematics import OK
from controller.model.reach import posture_at
from controller.offline.trajectory import Moment
from hardware.parameters import RobotParameters

Z4, SPEED, RIGHT, LEFT = 0, 1, 2, 3
"""Places of z4 [m], ż4 [m/s] and both sensors' outputs [N] among the attachment's states."""
STATES: Final = 4


@dataclass(frozen=True, slots=True)
class Fingers:
    """Gripper and sensors.

    Attributes:
        parameters: of the robot.
        asked: ṙ4, velocity asked of each finger, positive opening [m/s].
    """

    parameters: RobotParameters
    asked: float = 0.0

    def rates(self, own: FloatArray, forces: Pair) -> tuple[float, float, float, float]:
        """Time derivatives of the four states under forces on the pads."""
        speed, bandwidth = own.item(SPEED), self.parameters.tactile.bandwidth
        return (
            speed,
            gripper_acceleration(self.parameters, self.asked, speed, forces),
            sensor_rate(own.item(RIGHT), forces[0], bandwidth),
            sensor_rate(own.item(LEFT), forces[1], bandwidth),
        )


def push(forces: Pair) -> Vector:
    """What the arm feels of forces on the right and left pad, base frame [N]."""
    return force_on_tool(forces), 0.0, 0.0


class TactileLaw:
    """(23) with the tactile loop closed over the sensors of an attachment, as a law for a simulation.

    Args:
        model: the robot that the law thinks it controls.
        reference: shape (16,), as ``pack_reference`` makes it.
        settings: of the law.
        warm: start each forward kinematics from the last one, as the loop does; else in closed form each time, so that
            the torque is a smooth function of the state, to rounding.
    """

    def __init__(
        self, model: DeltaModel, reference: FloatArray, settings: LawSettings | None = None, warm: bool = True
    ) -> None:
        self.law = TaskSpaceController(model, settings)
        self._reference = reference
        self._warm = warm

    def __call__(self, moment: Moment) -> Vector:
        """Torques for a moment [N m]."""
        if not self._warm:
            self.law.reset()
        status = self.law.update(moment.angle, moment.rate)
        if status != OK:
            raise RuntimeError(f"the law found no state at {moment.time:.4f} s: {status.name}")
        return self.law.torque(self._reference, (moment.own.item(RIGHT), moment.own.item(LEFT)))


def effective_mass(model: DeltaModel, point: Vector) -> float:
    """Mass that a force along z1 accelerates at a tool point [m] under (23), 1 / (Λ⁻¹)₁₁ [kg]."""
    law = TaskSpaceController(model)
    y1, y2, y3 = posture_at(model, np.array(point)).y.tolist()
    law.update((y1, y2, y3), (0.0, 0.0, 0.0))
    return float(1.0 / np.linalg.inv(law.state.task_inertia)[0, 0])
