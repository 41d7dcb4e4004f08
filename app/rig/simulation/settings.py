"""What a simulated rig is started with."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from app.motion import MotionSettings
from app.rig.rig_file import load_randomisation
from app.settings.tree import RigSection
from controller.settings import ControllerSettings
from hardware.frozen import Frozen
from hardware.interfaces import Pace
from hardware.sim.hand.actions import HandSettings
from hardware.sim.process.randomisation import Randomisation
from hardware.sim.process.settings import WorldSettings
from hardware.table import Colour, PieceSpec, TableSettings


class SimRigSettings(Frozen):
    """A simulated rig: its world and its controller."""

    world: WorldSettings
    controller: ControllerSettings = ControllerSettings()


def settings_for_game(
    section: RigSection,
    pieces: Iterable[PieceSpec],
    motion: MotionSettings,
    table: TableSettings,
    pace: Pace,
    parameters_file: Path,
    person: Colour | None,
) -> SimRigSettings:
    """A simulation of our own to play on.

    Args:
        section: of the settings.
        pieces: what stands where.
        motion: how the arm moves there; it begins at home.
        table: board and trays, where they are meant to stand.
        pace: how plant time goes.
        parameters_file: of the robot.
        person: whose simulated hand plays; None: nobody sits there.

    Raises:
        UserError: the file of ``randomise`` is wrong.
    """
    randomisation = Randomisation() if section.randomise is None else load_randomisation(section.randomise)
    return SimRigSettings(
        world=WorldSettings(
            pieces=tuple(pieces), home=motion.home, table=table, pace=pace, seed=section.seed,
            randomisation=randomisation, parameters_file=parameters_file, linger=section.linger,
            journal=section.journal, cameras=section.cameras,
            hand=None if person is None else HandSettings(side=person),
        ),
        controller=ControllerSettings(linger=max(section.linger, 1e-3), port=section.port),
    )  # fmt: skip


def settings_to_calibrate(motion: MotionSettings, table: TableSettings) -> SimRigSettings:
    """A simulation of our own with an empty board, as fast as the machine can."""
    return SimRigSettings(world=WorldSettings(pieces=(), home=motion.home, table=table, pace=Pace.FAST))
