"""A robot that nobody knows: masses, inertias and friction drawn by a seed, torques with ripple, encoders with noise.

The controller on it is the one of every test bed; what it believes of the robot is said by whoever makes the bed.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from app.commissioning.identification.excitation import Excitation
from app.commissioning.identification.recording import JointRecord, joint_record
from app.commissioning.identification.survey import exciting_motion
from app.measure.bench.beds.bed import Bed
from app.motion import MotionSettings
from controller.law.task_space import TaskSpaceController
from controller.loop.supervisor import Supervisor
from controller.model.compiled import FloatArray
from controller.model.constants import DeltaModel
from controller.protocol import Result
from controller.protocol.cause_sentences import explain
from hardware.interfaces import Measurement
from hardware.parameters import RobotParameters
from hardware.sim.bodies.placed import StandingPiece
from hardware.sim.bodies.scene import build_model
from hardware.sim.plant.imperfections import Flaws, Imperfections
from hardware.sim.plant.plant import Plant
from hardware.sim.process.randomisation import Randomisation, uneven, weighed
from hardware.table import TableSettings

ROUGH: Final = Imperfections(torque_ripple=0.02, cogging=0.015)
"""Ripple of 2 % and cogging of 0.6 % of the rated torque: what servomotors of this size have."""
RANGES: Final = Randomisation(robot_mass=0.2, arm_mass=0.2, arm_inertia=0.2, arm_friction=0.5, devices=ROUGH)
ENCODER_NOISE: Final = 2.0
"""Standard deviation of an encoder at rest [counts of 22 bit]; a check takes 4 for broken."""


def unknown_robot(believed: RobotParameters, seed: int, ranges: Randomisation = RANGES) -> RobotParameters:
    """As a world of this seed draws it."""
    drawn = weighed(ranges.robot_mass, believed, np.random.default_rng([seed, 2]))
    return uneven(ranges, drawn, np.random.default_rng([seed, 5]))


class NoisyPlant(Plant):
    """A plant whose encoders are noisy; rates are differences of what they say."""

    noise: FloatArray | None = None
    """Of each tick, modulo its length, (n, 3) [rad]."""

    def measure(self, standing: bool) -> Measurement:
        """See ``Plant.measure``."""
        said = super().measure(standing)
        if self.noise is None:
            return said
        now, before = self.noise[self.tick % len(self.noise)], self.noise[(self.tick - 1) % len(self.noise)]
        rate = (now - before) / self.parameters.drive.tick
        a, b, c = (np.array(said.angle) + now).tolist()
        d, e, f = (np.array(said.velocity) + rate).tolist()
        return said._replace(angle=(a, b, c), velocity=(d, e, f))


def unknown_plant(
    true: RobotParameters, table: TableSettings, place: FloatArray, seed: int, standing: tuple[StandingPiece, ...] = ()
) -> NoisyPlant:
    """A table with these pieces under such a robot, whose tool stands at a place, base frame (3,) [m]."""
    model = build_model(true, table, standing, place, looks=False)
    names = tuple(piece.spec.name for piece in standing)
    plant = NoisyPlant(model, true, names, flaws=Flaws(RANGES.devices, seed))
    count = 2.0 * np.pi / 2.0**true.drive.encoder_bits
    plant.noise = ENCODER_NOISE * count * np.random.default_rng([seed, 6]).standard_normal((1 << 14, 3))
    return plant


def bed_of(plant: Plant, believed: RobotParameters, table: TableSettings) -> Bed:
    """A controller that believes this of the robot."""
    return Bed(plant, table, MotionSettings().at(table), TaskSpaceController(DeltaModel(believed)))


def recorded(bed: Bed, excitation: Excitation) -> JointRecord:
    """The motion that shows what a robot weighs, carried out; raises ``RuntimeError`` if it was stopped."""
    rows: list[tuple[float, ...]] = []

    def note(supervisor: Supervisor) -> None:
        rows.append((*supervisor.measurement.angle, *supervisor.torque))

    period = bed.parameters.drive.tick
    motion = exciting_motion(excitation, period)
    samples = motion.samples.copy()
    samples["position"] += bed.arm[0] - samples["position"][0]
    bed.listeners.append(note)
    try:
        ended = bed.execute(samples)
    finally:
        bed.listeners.remove(note)
    if ended.result is not Result.DONE:
        raise RuntimeError(f"the exciting motion was stopped: {explain(*ended.reason[:3])}")
    table = np.array(rows)
    return joint_record(period, table[:, :3], table[:, 3:])
