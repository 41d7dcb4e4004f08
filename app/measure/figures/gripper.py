"""What is attached to the arm of the paper's constrained dynamics: gripper and tactile sensors (Fig. 4), and a block.

What a finger or a sensor does stands in `controller.law.tactile`; here are their states and the law that reads them.

`run_dae` is the soft grasp on the whole nonlinear arm, with fingers and block along z1. Stiction is a bristle (LuGre
with equal static and kinetic friction): deflected by 5 µm it carries the full friction and slips; below it holds, so
that the block stands still under any smaller force. A pad is a spring with a damper that only presses.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from app.measure.figures.grasp import POINT, START, Grasp, Run
from controller.law.tactile import Pair, force_on_tool, gripper_acceleration, sensor_rate
from controller.law.task_space import LawSettings, TaskSpaceController
from controller.model.compiled import FloatArray, Vector
from controller.model.constants import DeltaModel
from controller.model.kinematics import OK
from controller.model.reach import posture_at
from controller.offline.simulation import ConstrainedArm, Moment
from hardware.parameters import RobotParameters

Z4, SPEED, RIGHT, LEFT = 0, 1, 2, 3
"""Places of z4 [m], ż4 [m/s] and both sensors' outputs [N] among the attachment's states."""
STATES: Final = 4
PLACE, PACE, BRISTLE = STATES, STATES + 1, STATES + 2
"""Places of the block's middle [m] and speed [m/s] along z1 and the bristle's deflection [m] among the states."""
PRESLIDING: Final = 5e-6
"""Deflection of the bristle at which it slips [m]."""
PAD_STIFFNESS: Final = 2e4
"""Of pad and sensor in series, assumed [N/m]."""
PAD_DAMPING: Final = 40.0
"""Of the same; the block does not rebound, assumed [N s/m]."""
SHAFT_SPEED: Final = 0.002
"""The sign of the shafts' Coulomb friction is smoothed over this; the law's compensation is softer [rad/s]."""
SUBSTEPS: Final = 8
"""Steps of the integrator in a tick."""


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


class GraspedBlock:
    """Gripper, sensors and block, attached to the arm.

    Args:
        grasp: what is done.
        presliding: deflection at which the bristle slips [m].
    """

    def __init__(self, grasp: Grasp, presliding: float = PRESLIDING) -> None:
        self._fingers = Fingers(grasp.parameters, -grasp.finger_speed)
        self._block = grasp.block
        self._presliding = presliding
        self._bristle = grasp.block.holds / presliding
        self._bristle_damping = float(np.sqrt(self._bristle * grasp.block.mass))

    def start(self) -> FloatArray:
        """States at time 0: fingers open and at rest, the block aside."""
        own = np.zeros(STATES + 3)
        own[Z4], own[PLACE] = START, self._block.offset
        return own

    def pads(self, moment: Moment) -> Pair:
        """What the block does to the pads [N]."""
        (z1, _, _), (v1, _, _) = moment.tool
        z4, speed, _, _, place, pace, _ = moment.own.tolist()
        half = self._block.half_size[0]
        right = _pressed(place + half - z1 - z4, pace - v1 - speed)
        left = _pressed(z1 - z4 - place + half, v1 - speed - pace)
        return right, left

    def rates(self, moment: Moment) -> FloatArray:
        """Time derivatives of the states."""
        forces = self.pads(moment)
        pace, bristle = moment.own.item(PACE), moment.own.item(BRISTLE)
        bending = pace - abs(pace) * bristle / self._presliding
        friction = self._bristle * bristle + self._bristle_damping * bending
        pushed = forces[1] - forces[0] - friction
        return np.array([*self._fingers.rates(moment.own, forces), pace, pushed / self._block.mass, bending])

    def force(self, moment: Moment) -> Vector:
        """What the arm feels [N]."""
        return push(self.pads(moment))


def _pressed(depth: float, rate: float) -> float:
    """Force of a pad that is pressed in by a depth [m], growing at a rate [m/s]."""
    return max(0.0, PAD_STIFFNESS * depth + PAD_DAMPING * rate) if depth > 0.0 else 0.0


def run_dae(grasp: Grasp, substeps: int = SUBSTEPS, presliding: float = PRESLIDING) -> Run:
    """Simulate a grasp; the law ticks every 0.88 ms and its torque comes a tick late.

    Args:
        grasp: what is done.
        substeps: steps of the integrator in a tick.
        presliding: see `GraspedBlock`.
    """
    model = DeltaModel(grasp.parameters)
    arm = ConstrainedArm(model, coulomb_speed=SHAFT_SPEED)
    law = TactileLaw(model, grasp.reference, grasp.law_settings)
    ticks = int(np.ceil(grasp.duration / grasp.parameters.drive.tick))
    path = arm.simulate_sampled(
        arm.at(POINT), law, ticks, attachment=GraspedBlock(grasp, presliding), substeps=substeps
    )
    z1, z4 = path.position[:, 0] - POINT[0], path.own[:, Z4]
    block = path.own[:, PLACE] - grasp.block.offset
    return Run(grasp, path.time, z1, z1 + z4, z1 - z4, block, path.own[:, [RIGHT, LEFT]])
