"""A simulated person's hand at work: looks at the table, plans the next part, and lets its servos follow.

Nothing is put anywhere: the hand writes the targets of its servos and nothing else, and pieces move because fingers
touch them. While it has nothing to do it may fall asleep, and then costs next to nothing.
"""

import math
from collections.abc import Iterator
from typing import Final

import mujoco
import numpy as np

from hardware.sim.bodies.hand import JOINTS, NAME, HandPose, parked, servo_constants
from hardware.sim.hand.actions import Action, HandSettings, Withdraw
from hardware.sim.hand.motion import Program
from hardware.sim.hand.routines import HandFailed, Routines
from hardware.sim.hand.sight import SeenPiece, TableView
from hardware.sim.plant import tick
from hardware.sim.plant.plant import Plant
from hardware.sim.plant.tick import NOTHING, ServoStrokes
from hardware.table import PieceSpec, TableSettings

_STREAM: Final = 0x68616E64
"""Sets the hand's random numbers apart from others of the same seed."""
_PARKED_WITHIN: Final = 0.05
"""A hand so near to where it is parked is at home [m]."""


class Hand:
    """The hand of one player, on a plant whose model has one (``bodies.hand.add_hand``); the seed is of everything
    human.

    A hand that is not where it is parked, as in a world that goes on from a snapshot, withdraws first. ``failed`` says
    why the last actions were not carried out to the end; empty while all is well.
    """

    def __init__(
        self, plant: Plant, settings: HandSettings, pieces: tuple[PieceSpec, ...], table: TableSettings, seed: int
    ) -> None:
        self.failed = ""
        self._plant = plant
        model, data = plant.model, plant.data
        self._period = plant.parameters.drive.tick
        self._first = int(model.actuator(JOINTS[0]).id)
        channels = [min(i, 4) for i in range(len(JOINTS))]  # thumb and index finger share the gap
        self._places = np.array([(self._first + i, channel) for i, channel in enumerate(channels)])
        self._tree = int(model.body_treeid[model.body(NAME).id])
        lead = [(2.0 * math.sqrt(mass / stiffness), mass / stiffness) for stiffness, mass in servo_constants()]
        self._lead = np.array(lead)
        self._kinds = {piece.name: piece.kind for piece in pieces}
        self._bodies = {piece.name: data.body(piece.name) for piece in pieces}
        self._tool = data.site("tool")
        # what lies in them may be higher than their walls
        self._boxes = tuple(box._replace(height=max(box.height, table.box_fill)) for box in table.boxes())
        rng = np.random.default_rng([seed, _STREAM])
        self._routines = Routines(self._look, lambda: self._pose, settings, table, rng)
        self._work: Iterator[Program] | None = None
        self._home = parked(settings.side)
        here = self._measured()
        away = math.dist(here[:3], self._home[:3]) > _PARKED_WITHIN
        self._pose = here if away else self._home
        self._begin(Program(self._pose, (), 0.0))
        self._command()
        if away:
            self._work = self._routines.leave_off()
            self._allow_sleep(False)

    # what others ask

    @property
    def busy(self) -> bool:
        """Something is being done; plant time has to run."""
        return self._work is not None

    @property
    def holding(self) -> bool:
        """A piece is between the fingertips."""
        return self._routines.held is not None

    def perform(self, actions: tuple[Action, ...]) -> None:
        """Begin with the first of these actions; raises ``HandFailed`` if it is busy."""
        if self.busy:
            raise HandFailed("the hand is busy: wait until its actions are done")
        self._start(actions)

    def withdraw(self) -> None:
        """Leave off as soon as what has begun to move comes to rest, put down what is held, and go home."""
        if self.busy:
            self._follow(self._program.cut(tick.time_at(self._followed, self._plant.tick)))
            self._work = self._routines.leave_off()
        elif math.dist(self._pose[:3], self._home[:3]) > _PARKED_WITHIN:
            self._start((Withdraw(),))

    # time

    @property
    def followed(self) -> ServoStrokes:
        """What the servos follow, up to a tick in which they have to be led further: see ``drive``."""
        return self._followed if self.busy else NOTHING

    def drive(self) -> bool:
        """Set the servos for the tick that comes; whether actions have just ended, well or not (``failed``)."""
        if self._work is None:
            return False
        if tick.over(self._followed, self._plant.tick) and not self._next():
            return True
        self._command()
        return False

    def _start(self, actions: tuple[Action, ...]) -> None:
        self.failed = ""
        self._work = self._routines.do(actions)
        self._begin(Program(self._pose, (), 0.0))
        self._allow_sleep(False)

    def _begin(self, program: Program) -> None:
        """Follow another program, from this tick on."""
        self._began = self._plant.tick
        self._follow(program)

    def _follow(self, program: Program) -> None:
        self._program = program
        clock = np.array([float(self._began), self._period, program.duration])
        self._followed = ServoStrokes(self._places, self._lead, np.array(program.start), program.table(), clock)

    def _next(self) -> bool:
        """Go on with the next program; False where all is done."""
        self._pose = self._program.end
        try:
            assert self._work is not None
            self._begin(next(self._work))
        except StopIteration:
            self._end()
            return False
        except HandFailed as failure:
            self.failed = str(failure)
            self._end()
            return False
        return True

    def _end(self) -> None:
        self._work = None
        self._begin(Program(self._pose, (), 0.0))
        self._command()
        self._allow_sleep(not self.holding)

    def _command(self) -> None:
        tick.follow(self._followed, self._plant.tick, self._plant.data.ctrl)

    def _allow_sleep(self, allowed: bool) -> None:
        """A tree that may not sleep wakes up in the next step; new targets of its servos would not wake it."""
        policy = mujoco.mjtSleepPolicy.mjSLEEP_ALLOWED if allowed else mujoco.mjtSleepPolicy.mjSLEEP_NEVER
        self._plant.model.tree_sleep_policy[self._tree] = int(policy)

    # what it sees and feels

    def _measured(self) -> HandPose:
        data = self._plant.data
        x, y, z, yaw = (float(data.joint(name).qpos[0]) for name in JOINTS[:4])
        return HandPose(x, y, z, yaw, float(np.mean(data.ctrl[self._first + 4 : self._first + 6])))

    def _look(self) -> TableView:
        seen = []
        for name, body in self._bodies.items():
            x, y, z = body.xpos.tolist()
            i, j, k = body.xmat.reshape(3, 3)[:, 2].tolist()
            seen.append(SeenPiece(name, self._kinds[name], x, y, z, (i, j, k)))
        return TableView(tuple(seen), np.array(self._tool.xpos), self._boxes)
