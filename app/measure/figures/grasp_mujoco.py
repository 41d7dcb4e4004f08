"""The soft grasp in MuJoCo: a model built from the parameters alone, with contacts and friction of its own.

Drives, encoders and sensors are those of the simulated rig; the law ticks every 0.88 ms, its torque comes a tick late.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.measure.figures.grasp import POINT, START, Grasp, Run
from controller.law.task_space import TaskSpaceController
from controller.model.compiled import FloatArray
from controller.model.constants import DeltaModel
from controller.model.kinematics import OK
from hardware.interfaces import Command
from hardware.sim.bodies.grasp_world import SUBSTEPS, BlockWorld, build_block_world
from hardware.sim.plant.plant import Plant
from hardware.sim.render.still import StillRenderer
from hardware.table import TableSettings


def block_world(grasp: Grasp) -> BlockWorld:
    """The world of a grasp."""
    block = grasp.block
    return BlockWorld(
        TableSettings().centre_in_base, POINT, START, block.mass, block.half_size, block.friction, block.offset
    )


class MujocoRun(NamedTuple):
    """A run, and the joint positions at its start and end, each shape (nq,), for pictures."""

    run: Run
    start: FloatArray
    end: FloatArray


def run_mujoco(grasp: Grasp, substeps: int = SUBSTEPS) -> MujocoRun:
    """Simulate a grasp; ``substeps``: steps of MuJoCo in a tick."""
    plant = Plant(build_block_world(grasp.parameters, block_world(grasp), substeps), grasp.parameters, ("block",))
    law, reference = TaskSpaceController(DeltaModel(grasp.parameters), grasp.law_settings), grasp.reference
    ticks = int(np.ceil(grasp.duration / grasp.parameters.drive.tick))
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
    time = np.arange(ticks + 1) * np.float64(grasp.parameters.drive.tick)
    return MujocoRun(Run(grasp, time, arm, right, left, block, rows[:, 4:]), start, plant.positions())


def _along_z1(plant: Plant, grasp: Grasp) -> tuple[float, float, float, float]:
    """Tool, right and left pad from the tool's start, and block from its own [m]."""
    data = plant.data
    z1 = data.joint("platform_x").qpos.item() - POINT[0]
    right, left = (data.joint(f"finger_{side}").qpos.item() for side in ("right", "left"))
    return z1, z1 + right, z1 - left, data.body("block").xpos.item(0) - grasp.block.offset


def views(grasp: Grasp, positions: Sequence[FloatArray]) -> list[NDArray[np.uint8]]:
    """One picture (480, 640, 3) RGB for each set of joint positions.

    Args:
        grasp: whose world it is.
        positions: each of shape (nq,), of a `MujocoRun`.

    Raises:
        HardwareError: there is no OpenGL here, or it does not draw.
    """
    with StillRenderer(build_block_world(grasp.parameters, block_world(grasp))) as still:
        return [still.draw(pose)[0] for pose in positions]
