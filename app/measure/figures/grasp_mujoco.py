"""The soft grasp in MuJoCo: a model built from the parameters alone, with contacts and friction of its own.

Drives, encoders and sensors are those of the simulated rig; the law ticks every 0.88 ms, its torque comes a tick late.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from app.measure.figures.grasp import POINT, START, Grasp, Run
from controller.law.task_space import TaskSpaceController
from controller.model.compiled import FloatArray
from controller.model.constants import DeltaModel
from controller.model.kinematics import OK
from hardware.interfaces import Command, Measurement, Triple
from hardware.sim.bodies.grasp_world import SUBSTEPS, BlockWorld, build_block_world
from hardware.sim.plant.plant import Plant
from hardware.table import TableSettings


def block_world(grasp: Grasp) -> BlockWorld:
    """The world of a grasp."""
    block = grasp.block
    return BlockWorld(
        TableSettings().centre_in_base, POINT, START, block.mass, block.half_size, block.friction, block.offset
    )


class _Cell:
    """Plant and law, tick by tick."""

    def __init__(self, grasp: Grasp, substeps: int) -> None:
        self._grasp = grasp
        model = build_block_world(grasp.parameters, block_world(grasp), substeps)
        self.plant = Plant(model, grasp.parameters, ("block",))
        self._law = TaskSpaceController(DeltaModel(grasp.parameters), grasp.law_settings)
        self._reference = grasp.reference
        self._torque = self._answer(self.plant.measure(standing=False))

    def _answer(self, measurement: Measurement) -> Triple:
        status = self._law.update(measurement.angle, measurement.velocity)
        if status != OK:
            raise RuntimeError(f"the law found no state at tick {measurement.tick}: {status.name}")
        return self._law.torque(self._reference, measurement.tactile)

    def tick(self) -> None:
        """One exchange: what the law makes of this measurement acts from the next tick on."""
        measurement = self.plant.measure(standing=False)
        self.plant.apply(Command(self._torque, -self._grasp.finger_speed, brake=False, enable=True, busy=True))
        self.plant.step()
        self._torque = self._answer(measurement)


class MujocoRun(NamedTuple):
    """A run, and the joint positions at its start and end, each shape (nq,), for pictures."""

    run: Run
    start: FloatArray
    end: FloatArray


def run_mujoco(grasp: Grasp, substeps: int = SUBSTEPS) -> MujocoRun:
    """Simulate a grasp; ``substeps``: steps of MuJoCo in a tick."""
    cell = _Cell(grasp, substeps)
    data, tick = cell.plant.data, grasp.parameters.drive.tick
    ticks = int(np.ceil(grasp.duration / tick))
    start, rows = cell.plant.positions(), np.empty((ticks + 1, 6))
    for k in range(ticks + 1):
        z1 = data.joint("platform_x").qpos.item() - POINT[0]
        right, left = (data.joint(f"finger_{side}").qpos.item() for side in ("right", "left"))
        block = data.body("block").xpos.item(0) - grasp.block.offset
        rows[k] = z1, z1 + right, z1 - left, block, *cell.plant.measure(standing=False).tactile
        if k < ticks:
            cell.tick()
    arm, right_pad, left_pad, moved = (np.ascontiguousarray(rows[:, i]) for i in range(4))
    run = Run(grasp, np.arange(ticks + 1) * np.float64(tick), arm, right_pad, left_pad, moved, rows[:, 4:])
    return MujocoRun(run, start, cell.plant.positions())
