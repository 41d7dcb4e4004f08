"""The soft grasp of section 3.1: what is grasped and how, and what a run of it leaves; nothing of how it is computed.

A wooden block lies on a surface, 10 mm aside of the gripper's middle. The fingers close at a steady speed, the arm is
soft along z1 (k_p1 = 0, k_v1 = 0.1) and stiff in the other directions. The right finger meets the block first and
pushes it; the arm yields to the block's friction; then the left finger meets it, and the grip moves as one.

`sliding` says in closed form what comes of that. Let a = μ m_b g (1/m + k*) be the arm's acceleration under the
friction, δ the offset, v the speed of each finger. The left finger arrives δ/v after the right one. Until then the
block is pushed by v t - a t²/2, and the arm recoils with a t; gripped it slides back until friction has stopped it. If
the arm reaches v in time, the block rests before that and is carried back to its place; else it ends at
δ (1 - a δ/v²).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from controller.law.task_space import LawSettings, pack_reference
from controller.model.compiled import FloatArray
from controller.model.constants import STANDARD_GRAVITY
from hardware.parameters import RobotParameters, load_parameters

HEIGHT: Final = 0.0125
"""Of the pads' centre over the surface: half the block's height [m]."""
POINT: Final = (0.0, 0.0, 0.47 - HEIGHT)
"""Where the tool starts, base frame [m]."""
DAMPING: Final = 0.1
"""k_v1 [1/s], the paper's; k_p1 is 0."""
ASIDE: Final = (70.0, 20.0)
"""ω along z2 and z3, as in a game: soft downwards, as k_p3 times any error of height presses a gripped block to the
surface or lifts it [rad/s]."""
START: Final = 0.020
"""Where each finger starts, from the tool's centre [m]."""
SETTLING: Final = 0.75
"""Time after the second contact in which everything comes to rest [s]."""


@dataclass(frozen=True, slots=True)
class Block:
    """A wooden Jenga block, standing on a long narrow side: 15 mm between the fingers, 25 mm high.

    Attributes:
        mass: [kg].
        half_size: across the fingers' pads (z1), along it, and up [m].
        friction: Coulomb coefficient on the surface, at rest as in motion; wood on wood.
        offset: of its middle from the gripper's, along z1 [m].
    """

    mass: float = 0.015
    half_size: tuple[float, float, float] = (0.0075, 0.0375, 0.0125)
    friction: float = 0.4
    offset: float = 0.010

    @property
    def holds(self) -> float:
        """Largest force along the surface under which it stays [N]."""
        return self.friction * self.mass * STANDARD_GRAVITY


@dataclass(frozen=True, slots=True)
class Grasp:
    """One grasp.

    Attributes:
        tactile_gain: k* [1/kg].
        finger_speed: closing speed asked of each finger [m/s].
        joint_friction: Coulomb friction of each servomotor's shaft [N m].
        compensated: the law feeds the shafts' friction forward.
        block: what is grasped.
    """

    tactile_gain: float
    finger_speed: float = 0.030
    joint_friction: float = 0.0
    compensated: bool = True
    block: Block = Block()

    def with_gain(self, tactile_gain: float) -> Grasp:
        """The same with another k* [1/kg]."""
        return replace(self, tactile_gain=tactile_gain)

    @property
    def parameters(self) -> RobotParameters:
        """The robot's, with this friction of the shafts."""
        robot = load_parameters()
        friction = robot.friction.model_copy(update={"coulomb": self.joint_friction})
        return robot.model_copy(update={"friction": friction})

    @property
    def law_settings(self) -> LawSettings:
        """Of the law."""
        return LawSettings(friction_compensation=self.compensated)

    @property
    def reference(self) -> FloatArray:
        """Of the law, shape (16,): stay, soft along z1."""
        return pack_reference(
            POINT,
            stiffness=(0.0, ASIDE[0] ** 2, ASIDE[1] ** 2),
            damping=(DAMPING, 2.0 * ASIDE[0], 2.0 * ASIDE[1]),
            tactile_gain=self.tactile_gain,
        )

    @property
    def duration(self) -> float:
        """Until everything rests [s]."""
        return (START - self.block.half_size[0]) / self.finger_speed + SETTLING


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """A grasp over time, one entry a tick: displacements along z1 [m], forces on the pads [N].

    Attributes:
        grasp: what was done.
        time: [s].
        arm: the tool from its start.
        right: the right pad, from the tool's start.
        left: the left pad, from the tool's start.
        block: the block from its start.
        forces: on the right and the left pad as the sensors give them, shape (n, 2).
    """

    grasp: Grasp
    time: FloatArray
    arm: FloatArray
    right: FloatArray
    left: FloatArray
    block: FloatArray
    forces: FloatArray

    @property
    def final(self) -> float:
        """Where the block ends, from its start; the fingers push it to the left, so that is positive here [m]."""
        return float(-self.block[-1])

    @property
    def farthest(self) -> float:
        """How far it was pushed on the way [m]."""
        return float(-self.block.min())

    @property
    def unrest(self) -> float:
        """How far the block still moves to and fro in the last 0.1 s [m]."""
        last = self.block[self.time > self.time[-1] - 0.1]
        return float(last.max() - last.min())


def sliding(grasp: Grasp, mass: float) -> tuple[float, float]:
    """Final and farthest displacement of the block in closed form [m]: an arm of one mass, no joint friction, no lag.

    Args:
        grasp: its gain, speed and block count.
        mass: effective mass of the arm along z1 [kg].
    """
    acceleration = grasp.block.holds * (1.0 / mass + grasp.tactile_gain)
    speed, offset = grasp.finger_speed, grasp.block.offset
    time = min(offset / speed, speed / acceleration)
    farthest = speed * time - acceleration * time**2 / 2.0
    return max(0.0, offset * (1.0 - acceleration * offset / speed**2)), farthest
