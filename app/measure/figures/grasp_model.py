"""The soft grasp of section 3.1, on the paper's constrained dynamics and in MuJoCo; and what is attached to the arm.

A wooden block lies on a surface, 10 mm aside of the gripper's middle. The fingers close at a steady speed, the arm is
soft along z1 (k_p1 = 0, k_v1 = 0.1) and stiff in the other directions. The right finger meets the block first and
pushes it; the arm yields to the block's friction; then the left finger meets it, and the grip moves as one.

`sliding` says in closed form what comes of that. Let a = μ m_b g (1/m + k*) be the arm's acceleration under the
friction, δ the offset, v the speed of each finger. The left finger arrives δ/v after the right one. Until then the
block is pushed by v t - a t²/2, and the arm recoils with a t; gripped it slides back until friction has stopped it. If
the arm reaches v in time, the block rests before that and is carried back to its place; else it ends at
δ (1 - a δ/v²).

`run_dae` is the grasp on the whole nonlinear arm, with fingers and block along z1. Stiction is a bristle (LuGre with
equal static and kinetic friction): deflected by 5 µm it carries the full friction and slips; below it holds, so that
the block stands still under any smaller force. A pad is a spring with a damper that only presses. `run_mujoco` is the
same with contacts and friction of MuJoCo's, with drives, encoders and sensors of the simulated rig.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from controller.law.settings import LawSettings
from controller.law.tactile import Pair, force_on_tool, gripper_acceleration, sensor_rate
from controller.law.task_space import TaskSpaceController, pack_reference
from controller.model.compiled import FloatArray, Vector
from controller.model.constants import STANDARD_GRAVITY, DeltaModel
from controller.model.kinematics import OK
from controller.model.reach import posture_at
from controller.offline.simulation import ConstrainedArm, Moment
from hardware.interfaces import Command
from hardware.parameters import RobotParameters, load_parameters
from hardware.sim.bodies import grasp_world
from hardware.sim.plant.plant import Plant
from hardware.sim.render.still import StillRenderer
from hardware.table import TableSettings

HEIGHT: Final = 0.0125  # of the pads' centre over the surface: half the block's height [m]
POINT: Final = (0.0, 0.0, 0.47 - HEIGHT)  # where the tool starts, base frame [m]
DAMPING: Final = 0.1  # k_v1 [1/s], the paper's; k_p1 is 0
ASIDE: Final = (70.0, 20.0)
"""ω along z2 and z3, as in a game: soft downwards, as k_p3 times any error of height presses a gripped block to the
surface or lifts it [rad/s]."""
START: Final = 0.020  # where each finger starts, from the tool's centre [m]
SETTLING: Final = 0.75  # time after the second contact in which everything comes to rest [s]
Z4, SPEED, RIGHT, LEFT = 0, 1, 2, 3  # places of z4 [m], ż4 [m/s], both sensors' outputs [N] in the attachment's states
STATES: Final = 4
PLACE, PACE, BRISTLE = STATES, STATES + 1, STATES + 2
"""Places of the block's middle [m] and speed [m/s] along z1 and the bristle's deflection [m] among the states."""
PRESLIDING: Final = 5e-6  # deflection of the bristle at which it slips [m]
PAD_STIFFNESS: Final = 2e4  # of pad and sensor in series, assumed [N/m]
PAD_DAMPING: Final = 40.0  # of the same; the block does not rebound, assumed [N s/m]
SHAFT_SPEED: Final = 0.002  # smooths the sign of the shafts' Coulomb friction; the law's compensation is softer [rad/s]
SUBSTEPS: Final = 8  # steps of the integrator in a tick


@dataclass(frozen=True, slots=True)
class Block:
    """A wooden Jenga block, standing on a long narrow side: 15 mm between the fingers, 25 mm high."""

    mass: float = 0.015  # [kg]
    half_size: tuple[float, float, float] = (0.0075, 0.0375, 0.0125)  # across the fingers' pads (z1), along, and up [m]
    friction: float = 0.4  # Coulomb coefficient on the surface, at rest as in motion; wood on wood
    offset: float = 0.010  # of its middle from the gripper's, along z1 [m]

    @property
    def holds(self) -> float:
        """Largest force along the surface under which it stays [N]."""
        return self.friction * self.mass * STANDARD_GRAVITY


@dataclass(frozen=True, slots=True)
class Grasp:
    """One grasp."""

    tactile_gain: float  # k* [1/kg]
    finger_speed: float = 0.030  # closing speed asked of each finger [m/s]
    joint_friction: float = 0.0  # Coulomb friction of each servomotor's shaft [N m]
    compensated: bool = True  # the law feeds the shafts' friction forward
    block: Block = Block()  # what is grasped

    @property
    def parameters(self) -> RobotParameters:
        """The robot's, with this friction of the shafts."""
        robot = load_parameters()
        friction = robot.friction.model_copy(update={"coulomb": self.joint_friction})
        return robot.model_copy(update={"friction": friction})

    @property
    def law_settings(self) -> LawSettings:
        """With or without compensation."""
        return LawSettings(friction_compensation=self.compensated)

    @property
    def reference(self) -> FloatArray:
        """Of the law, shape (16,): stay, soft along z1."""
        stiffness, damping = (0.0, ASIDE[0] ** 2, ASIDE[1] ** 2), (DAMPING, 2.0 * ASIDE[0], 2.0 * ASIDE[1])
        return pack_reference(POINT, stiffness=stiffness, damping=damping, tactile_gain=self.tactile_gain)

    @property
    def ticks(self) -> int:
        """Until everything rests."""
        duration = (START - self.block.half_size[0]) / self.finger_speed + SETTLING
        return int(np.ceil(duration / self.parameters.drive.tick))


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """A grasp over time, one entry a tick: displacements along z1 [m], forces on the pads [N]."""

    grasp: Grasp  # what was done
    time: FloatArray  # [s]
    arm: FloatArray  # the tool from its start
    right: FloatArray  # the right pad, from the tool's start
    left: FloatArray  # the left pad, from the tool's start
    block: FloatArray  # the block from its start
    forces: FloatArray  # on the right and the left pad as the sensors give them, shape (n, 2)
    poses: tuple[FloatArray, ...] = ()  # MuJoCo's joint positions at start and end, each shape (nq,), for pictures

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
        return float(np.ptp(self.block[self.time > self.time[-1] - 0.1]))


def sliding(grasp: Grasp, mass: float) -> tuple[float, float]:
    """Final and farthest displacement of the block in closed form [m]: by gain, speed and block of a grasp, for an arm
    of one effective mass along z1 [kg], no joint friction, no lag.
    """
    acceleration = grasp.block.holds * (1.0 / mass + grasp.tactile_gain)
    speed, offset = grasp.finger_speed, grasp.block.offset
    time = min(offset / speed, speed / acceleration)
    farthest = speed * time - acceleration * time**2 / 2.0
    return max(0.0, offset * (1.0 - acceleration * offset / speed**2)), farthest


# what is attached to the arm of the constrained dynamics: gripper and tactile sensors (Fig. 4), and a block


@dataclass(frozen=True, slots=True)
class Fingers:
    """Gripper and sensors."""

    parameters: RobotParameters  # of the robot
    asked: float = 0.0  # ṙ4, velocity asked of each finger, positive opening [m/s]

    def rates(self, own: FloatArray, forces: Pair) -> tuple[float, float, float, float]:
        """Time derivatives of the four states under forces on the pads."""
        speed, k_s = own.item(SPEED), self.parameters.tactile.bandwidth
        acceleration = gripper_acceleration(self.parameters, self.asked, speed, forces)
        right, left = sensor_rate(own.item(RIGHT), forces[0], k_s), sensor_rate(own.item(LEFT), forces[1], k_s)
        return speed, acceleration, right, left


def push(forces: Pair) -> Vector:
    """What the arm feels of forces on the right and left pad, base frame [N]."""
    return force_on_tool(forces), 0.0, 0.0


class TactileLaw:
    """(23) with the tactile loop closed over the sensors of an attachment, as a law for a simulation.

    ``model`` is the robot that the law thinks it controls, ``reference`` has the shape (16,) of ``pack_reference``.
    Each forward kinematics starts from the last one, as in the loop; not ``warm``: in closed form each time, so that
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
    """Gripper, sensors and block, attached to the arm; ``presliding``: deflection at which the bristle slips [m]."""

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


# the two models; in both the law ticks every 0.88 ms and its torque comes a tick late


def run_dae(grasp: Grasp, substeps: int = SUBSTEPS, presliding: float = PRESLIDING) -> Run:
    """Simulate a grasp on (2); ``substeps`` of the integrator in a tick, ``presliding`` as of `GraspedBlock`."""
    model = DeltaModel(grasp.parameters)
    arm = ConstrainedArm(model, coulomb_speed=SHAFT_SPEED)
    law, attached = TactileLaw(model, grasp.reference, grasp.law_settings), GraspedBlock(grasp, presliding)
    path = arm.simulate_sampled(arm.at(POINT), law, grasp.ticks, attachment=attached, substeps=substeps)
    z1, z4 = path.position[:, 0] - POINT[0], path.own[:, Z4]
    block = path.own[:, PLACE] - grasp.block.offset
    return Run(grasp, path.time, z1, z1 + z4, z1 - z4, block, path.own[:, [RIGHT, LEFT]])


def block_world(grasp: Grasp) -> grasp_world.BlockWorld:
    """The world of a grasp in MuJoCo."""
    block, centre = grasp.block, TableSettings().centre_in_base
    return grasp_world.BlockWorld(centre, POINT, START, block.mass, block.half_size, block.friction, block.offset)


def run_mujoco(grasp: Grasp, substeps: int = grasp_world.SUBSTEPS) -> Run:
    """Simulate a grasp in MuJoCo, with ``substeps`` in a tick."""
    parameters, ticks = grasp.parameters, grasp.ticks
    world = grasp_world.build_block_world(parameters, block_world(grasp), substeps)
    plant = Plant(world, parameters, ("block",))
    law, reference = TaskSpaceController(DeltaModel(parameters), grasp.law_settings), grasp.reference
    start, rows, torque = plant.positions(), np.empty((ticks + 1, 6)), (0.0, 0.0, 0.0)
    for k in range(-1, ticks + 1):
        measured = plant.measure(standing=False)
        if k >= 0:
            rows[k] = *_along_z1(plant, grasp), *measured.tactile
        if 0 <= k < ticks:  # what the law makes of this measurement acts from the next tick on
            plant.apply(Command(torque, -grasp.finger_speed, brake=False, enable=True, busy=True))
            plant.step()
        status = law.update(measured.angle, measured.velocity)
        if status != OK:
            raise RuntimeError(f"the law found no state at tick {measured.tick}: {status.name}")
        torque = law.torque(reference, measured.tactile)
    arm, right, left, block = (np.ascontiguousarray(rows[:, i]) for i in range(4))
    time = np.arange(ticks + 1) * np.float64(parameters.drive.tick)
    return Run(grasp, time, arm, right, left, block, rows[:, 4:], (start, plant.positions()))


def _along_z1(plant: Plant, grasp: Grasp) -> tuple[float, float, float, float]:
    """Tool, right and left pad from the tool's start, and block from its own [m]."""
    data = plant.data
    z1 = data.joint("platform_x").qpos.item() - POINT[0]
    right, left = (data.joint(f"finger_{side}").qpos.item() for side in ("right", "left"))
    return z1, z1 + right, z1 - left, data.body("block").xpos.item(0) - grasp.block.offset


def views(grasp: Grasp, poses: Sequence[FloatArray]) -> list[NDArray[np.uint8]]:
    """One picture (480, 640, 3) RGB for each of ``Run.poses``.

    Raises:
        HardwareError: there is no OpenGL here, or it does not draw.
    """
    with StillRenderer(grasp_world.build_block_world(grasp.parameters, block_world(grasp))) as still:
        return [still.draw(pose)[0] for pose in poses]
