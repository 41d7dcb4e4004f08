"""A robot in simulation whose wiring, drives and brakes are wrong in chosen ways, behind the seam of real drives."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import mujoco
import numpy as np

from app.measure.bench.beds.unknown_robot import unknown_robot
from hardware.interfaces import Command, Measurement, Triple
from hardware.parameters import load_parameters
from hardware.sim.bodies.scene import build_model
from hardware.sim.plant.imperfections import Flaws, Imperfections
from hardware.sim.plant.plant import Plant
from hardware.table import TableSettings

BELIEVED, TABLE = load_parameters(), TableSettings()
PERIOD = BELIEVED.drive.tick
WATCHDOG = BELIEVED.drive.watchdog_ticks * PERIOD
HOME = (0.0, 0.075, 0.325)
ROUGH = Imperfections(
    torque_ripple=0.02, cogging=0.015, friction=0.5, encoder_noise=1.5e-6, tactile_noise=0.03, tactile_offset=0.05
)
_ONES: Triple = (1.0, 1.0, 1.0)


class Wall:
    """The wall clock of a machine that does nothing else: time passes by exchanging and by sleeping alone."""

    def __init__(self) -> None:
        self.now = 0.0

    def perf_counter(self) -> float:
        return self.now

    def sleep(self, duration: float) -> None:
        self.now += duration


@dataclass(frozen=True)
class Fault:
    """What is wrong; by default nothing."""

    reads: Triple = _ONES  # what an encoder says of its shaft's angle, a factor
    zero: Triple = (0.0, 0.0, 0.0)  # added to it [rad]
    frozen: int | None = None  # this encoder stands
    encoders: tuple[int, int, int] = (0, 1, 2)  # whose shaft each encoder sees
    pulls: Triple = _ONES  # what a motor gives of the torque asked for
    motors: tuple[int, int, int] = (0, 1, 2)  # whose shaft each motor's torque reaches
    stuck: int | None = None  # this brake stays closed
    slack: int | None = None  # this one bears 2 N m, enough for gravity …
    gone: int | None = None  # … and this one nothing
    slow: int = 0  # ticks that all brakes take to open and to bite
    watchdog: bool = True
    pads: tuple[float, float] = (0.0, 0.0)  # added to the force sensors [N]
    dead_pad: int | None = None


@cache
def _model(seed: int | None, place: Triple) -> mujoco.MjModel:
    true = BELIEVED if seed is None else unknown_robot(BELIEVED, seed)
    return build_model(true, TABLE, (), np.array(place), looks=False)


class FaultyBus:
    """``ServoBus`` of such a robot: one whose masses and frictions a seed has drawn; None: just as believed."""

    lockstep = False
    period = PERIOD

    def __init__(self, wall: Wall, fault: Fault, seed: int | None = 7, place: Triple = HOME) -> None:
        self._wall, self._fault, self._heard = wall, fault, wall.now
        flaws = Flaws(ROUGH, seed) if seed is not None else None
        true = BELIEVED if seed is None else unknown_robot(BELIEVED, seed)
        self.plant = Plant(_model(seed, place), true, (), flaws=flaws)
        self._servos = [int(self.plant.model.joint(f"servo{i}").dofadr[0]) for i in (1, 2, 3)]
        self._start = np.array(self.plant.truth(reset_peak=False).tool)
        self._at_start = self._shafts()
        self._frozen_at = self.plant.measure(standing=False).angle
        self.tool_way = 0.0  # farthest that the tool has really been from where it was [m]
        self.joint_way = 0.0  # the same of a shaft [rad]
        self.commands: list[Command] = []
        self._braked = [True] * (fault.slow + 1)

    def tool(self) -> np.ndarray:
        """Where it really is, board frame [m]."""
        return TABLE.board_from_base(np.array(self.plant.truth(reset_peak=False).tool))

    def _shafts(self) -> np.ndarray:
        return np.array([self.plant.data.qpos[int(self.plant.model.joint(f"servo{i}").qposadr[0])] for i in (1, 2, 3)])

    def exchange(self, command: Command) -> Measurement:
        fault, plant = self._fault, self.plant
        if fault.watchdog and self._wall.now - self._heard > WATCHDOG:
            plant.trip_watchdog()
        self.commands.append(command)
        torque = [0.0, 0.0, 0.0]
        for motor, shaft in enumerate(fault.motors):
            torque[shaft] = command.torque[motor] * fault.pulls[motor]
        plant.apply(command._replace(torque=(torque[0], torque[1], torque[2])))
        self._set_brakes()
        plant.step()
        self._wall.sleep(self.period)
        self._heard = self._wall.now
        self.tool_way = max(
            self.tool_way, float(np.linalg.norm(np.array(plant.data.site("tool").xpos) - self._origin()))
        )
        self.joint_way = max(self.joint_way, float(np.abs(self._shafts() - self._at_start).max()))
        return self._seen(plant.measure(standing=False))

    def _origin(self) -> np.ndarray:
        base = self.plant.data.body("base")
        return np.asarray(base.xpos + base.xmat.reshape(3, 3) @ self._start)

    def _set_brakes(self) -> None:
        drive, friction = BELIEVED.drive, self.plant.model.dof_frictionloss
        self._braked = [*self._braked[1:], self.plant.braked]
        if self._fault.slow:
            friction[self._servos] = drive.brake_torque if self._braked[0] else 0.02
        if self._fault.stuck is not None:
            friction[self._servos[self._fault.stuck]] = drive.brake_torque
        if self.plant.braked and self._fault.slack is not None:
            friction[self._servos[self._fault.slack]] = 2.0
        if self.plant.braked and self._fault.gone is not None:
            friction[self._servos[self._fault.gone]] = 0.02

    def _seen(self, said: Measurement) -> Measurement:
        fault = self._fault
        angle, velocity = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
        for axis, shaft in enumerate(fault.encoders):
            angle[axis] = fault.reads[axis] * said.angle[shaft] + fault.zero[axis]
            velocity[axis] = fault.reads[axis] * said.velocity[shaft]
        if fault.frozen is not None:
            angle[fault.frozen], velocity[fault.frozen] = self._frozen_at[fault.frozen], 0.0
        right, left = (force + more for force, more in zip(said.tactile, fault.pads, strict=True))
        tactile = [right, left]
        if fault.dead_pad is not None:
            tactile[fault.dead_pad] = 0.0
        return said._replace(
            angle=(angle[0], angle[1], angle[2]), velocity=(velocity[0], velocity[1], velocity[2]),
            tactile=(tactile[0], tactile[1]),
        )  # fmt: skip

    def close(self) -> None:
        pass
