"""Supervisor and simulated plant in one process, in lockstep: what a demo in pace ``fast`` runs, but for the sockets.

So ticks repeat exactly, and a bench sees both sides of every one of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from app.motion import Motion, MotionSettings, Plan, Planner
from app.motion.gain_schedule import critical
from app.motion.path import Vector
from app.motion.timing.reference import Bounds, dwell, join, line, to_samples
from controller.law.task_space import TaskSpaceController
from controller.loop.admission import Ended
from controller.loop.supervisor import Supervisor
from controller.model.constants import DeltaModel
from controller.protection.limits import default_limits
from controller.protocol import MotionFlag
from controller.protocol.cause_sentences import explain
from controller.protocol.messages import Announce, Samples
from controller.protocol.states import State
from controller.settings import ControllerSettings
from hardware.parameters import load_parameters
from hardware.sim.bodies.placed import StandingPiece
from hardware.sim.bodies.scene import build_model
from hardware.sim.plant.imperfections import Flaws
from hardware.sim.plant.plant import Plant
from hardware.table import TableSettings

LEAD: Final = 8  # ticks between an announcement and the first sample, as on any lockstep bus
_BOOT_TICKS: Final = 400
_AHEAD: Final = 1000
"""So many samples are there at least before they are executed."""


class Bed:
    """A test bed: a controller and its plant, up to where the arm holds. From the table follow the limits of the
    protection; by it and the settings motions are planned. ``listeners`` are called after every tick, and may be added
    to.

    Raises:
        RuntimeError: the arm does not get so far as to hold.
    """

    def __init__(
        self, plant: Plant, table: TableSettings, settings: MotionSettings | None = None,
        law: TaskSpaceController | None = None, listeners: Sequence[Callable[[Supervisor], None]] = (),
    ) -> None:  # fmt: skip
        self.plant, self.table, self.settings = plant, table, settings or MotionSettings()
        self.parameters = plant.parameters
        law = law or TaskSpaceController(DeltaModel(self.parameters))
        limits = default_limits(self.parameters, table)
        self.supervisor = Supervisor(law, limits, ControllerSettings(), self.parameters.drive.tick, lockstep=True)
        self.listeners = list(listeners)
        self._motions = 0
        for _ in range(_BOOT_TICKS):
            self.tick()
            if self.supervisor.state is State.HOLD:
                return
        raise RuntimeError(f"the arm does not hold after {_BOOT_TICKS} ticks: it is in {self.supervisor.state.name}")

    @property
    def arm(self) -> tuple[Vector, float]:
        """Where the arm is to be, base frame (3,), and where its fingers are [m]."""
        return self.supervisor.reference.position.copy(), self.supervisor.measurement.finger_position

    def planner(self) -> Planner:
        """From where the arm is."""
        return Planner.of(self.settings, self.parameters, self.table, *self.arm, LEAD)

    def positions(self) -> dict[str, Vector]:
        """Where each piece stands, board frame (3,) [m]."""
        return {pose.name: np.array([pose.x, pose.y, pose.z]) for pose in self.plant.truth(reset_peak=False).pieces}

    def tick(self) -> None:
        """One exchange: the measurement is of the plant before the command acts."""
        command = self.supervisor.command()
        measurement = self.plant.measure(standing=False)
        self.plant.apply(command)
        self.plant.step()
        self.supervisor.advance(measurement)
        for listener in self.listeners:
            listener(self.supervisor)

    def wait(self, duration: float) -> None:
        """Let so much time pass [s]."""
        for _ in range(round(duration / self.parameters.drive.tick)):
            self.tick()

    def begin(self, samples: NDArray[Any], followed: bool = False) -> None:
        """Announce a motion, shape (n,) of type ``SAMPLE``, and hand over all of it that there is room for."""
        supervisor = self.supervisor
        self._motions += 1
        flags = MotionFlag.FOLLOWED if followed else MotionFlag(0)
        supervisor.announce(Announce(self._motions, supervisor.measurement.tick + LEAD, len(samples), flags))
        supervisor.take_samples(Samples(self._motions, 0, samples))

    def execute(self, samples: NDArray[Any], followed: bool = False) -> Ended:
        """One motion to its end; says how it ended."""
        self.begin(samples, followed)
        buffer = self.supervisor.admission.motion
        while buffer.announced is not None:
            if buffer.received < min(
                len(samples), buffer.executed + _AHEAD
            ):  # a ring has no room for all of a long one
                self.supervisor.take_samples(Samples(self._motions, buffer.received, samples[buffer.received :]))
            self.tick()
        return self.supervisor.admission.ended

    def carry_out(self, motion: Motion, followed: bool = False) -> None:
        """One motion of a plan, to its end.

        Raises:
            RuntimeError: it did not end as it must.
        """
        ended = self.execute(motion.samples, followed)
        if ended.result is not motion.wanted:
            why = explain(*ended.reason[:3])
            raise RuntimeError(f"{motion.label} ended as {ended.result.name}, not {motion.wanted.name}: {why}")

    def continued(self, plan: Plan) -> Iterator[tuple[Motion, bool]]:
        """A plan's motions, each timed from where the arm is when it is asked for; and whether another one follows."""
        for index, motion in enumerate(plan.motions):
            yield motion.continued(self.arm[0]), index < len(plan.motions) - 1

    def execute_plan(self, plan: Plan, *, joined: bool = False) -> None:
        """All motions of a plan, each from rest or (``joined``) announced as followed; errors as of ``carry_out``."""
        for motion, followed in self.continued(plan):
            self.carry_out(motion, joined and followed)


def straight(start: Vector, end: Vector, bounds: Bounds, frequency: float, tick: float) -> NDArray[Any]:
    """Samples of a straight motion from a reference to a point, base frame (3,) [m], with the fingers at rest.

    The gains are critically damped at a frequency [rad/s]; ``tick`` in [s].
    """
    path = join([dwell(start, 1), line(start, end, bounds, tick)])
    return to_samples(path, critical((frequency,) * 3, len(path)), np.zeros(len(path)))


def plant_of(
    standing: tuple[StandingPiece, ...], table: TableSettings, settings: MotionSettings, flaws: Flaws | None = None, *,
    looks: bool = False,
) -> Plant:  # fmt: skip
    """The plant of a test bed with these pieces on its table and the arm at home; flaws as of ``Plant``.

    With ``looks`` as in a game, whose motion differs in its last digits from that of a bare world.
    """
    parameters = load_parameters()
    model = build_model(parameters, table, standing, np.array(settings.home), looks=looks)
    return Plant(model, parameters, tuple(piece.spec.name for piece in standing), flaws=flaws)
