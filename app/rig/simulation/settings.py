"""Rig files of simulations of our own: what a lab would write, with a free port, and ended with the game."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import chess

from app import UserError
from app.motion import MotionSettings
from app.pieces.layout import start_layout
from app.rig.rig_file import (
    ETHERCAT,
    MOTEUS,
    ControllerSection,
    DrivesSection,
    RigFile,
    WorldSection,
    load_randomisation,
)
from app.settings.defaults import Drives, RigSection
from app.settings.toml import ConfigError
from controller.protocol.key import KEY_FILE
from controller.settings import ANY_PORT
from hardware.drives.ethercat.settings import EtherCatSettings
from hardware.drives.moteus.settings import MoteusSettings, PinSettings
from hardware.drives.settings import ForceSettings
from hardware.interfaces import Pace
from hardware.piece_set import Colour
from hardware.sim.hand.actions import HandSettings
from hardware.sim.process.randomisation import AS_A_LAB
from hardware.sim.process.settings import WorldOptions, WorldSettings
from hardware.table import TableSettings

EMULATED: Final = {
    Drives.MOTEUS: DrivesSection(
        bus=MOTEUS, emulated=True, forces=(ForceSettings(gain=40.0), ForceSettings(gain=40.0)),
        moteus=MoteusSettings(
            brakes=PinSettings(id=4, aux=2, pin=1),
            forces=(PinSettings(id=4, aux=1, pin=1), PinSettings(id=4, aux=1, pin=2)),
        ),
    ),
    Drives.ETHERCAT: DrivesSection(
        bus=ETHERCAT, emulated=True, forces=(ForceSettings(gain=4.0), ForceSettings(gain=4.0)),
        ethercat=EtherCatSettings(),
    ),
}  # fmt: skip
"""Drives of a robot as it might be built: brakes, and a sensor of 40 N behind each pad."""
FAST_TELEMETRY: Final = 45
"""Pace fast: telemetry comes each so many ticks, 25 times a second of plant time, together with a film's frames. In
between nobody has to be asked, and to send, take and record one costs as much as eight ticks."""
NO_PIECES = f"{chess.Board.empty().board_fen()} w - -"
"""A position for which nothing stands on the table, nor beside the board."""


def own_rig(
    run_dir: Path, world: WorldSection, controller: Mapping[str, Any] = MappingProxyType({}), **rig: Any
) -> RigFile:
    """A simulation that lies in its run directory with all that belongs to it; processes are known by that, however
    spelled.

    ``controller`` are fields of ``ControllerSection`` that shall be other than usual, ``rig`` such of ``RigFile``.
    """
    run_dir = run_dir.resolve()
    usual = {"port": ANY_PORT, "key": run_dir / KEY_FILE, "stays": False}
    calibration = run_dir / RigFile.model_fields["calibration"].default
    section = ControllerSection(**{**usual, **controller})
    return RigFile(controller=section, world=world, run_dir=run_dir, calibration=calibration, **rig)


def rig_for_game(
    section: RigSection,
    run_dir: Path,
    board: chess.Board | None,
    table: TableSettings,
    parameters: Path,
    person: Colour | None = None,
) -> RigFile:
    """A simulation of our own to play on, with the table where it is meant to stand.

    Nothing is set up where ``board`` is None: the pieces stand there already, as another program has left them.
    The world differs from what is believed of it as a lab would, or as was wished. ``person`` is whose simulated hand
    plays; None: nobody sits there. Raises ``UserError`` if the file of ``randomise`` is wrong.
    """
    drives = drives_of(section)
    chosen: dict[str, Any] = {} if section.pace is None else {"pace": section.pace}
    if board is not None and section.randomise is not None:
        chosen["randomisation"] = load_randomisation(section.randomise)
    elif board is not None and not section.ideal:
        chosen["randomisation"] = AS_A_LAB
    world = WorldSection(
        **chosen, seed=section.seed, fen=None if board is None else f"{board.board_fen()} w - -", person=person,
        cameras=section.cameras, linger=section.linger, journal=section.journal, processes=section.processes,
    )  # fmt: skip
    controller: dict[str, Any] = {"linger": max(section.linger, 1e-3), "port": section.port, "relay": section.relay}
    if world.pace is Pace.FAST:
        controller["telemetry_ticks"] = FAST_TELEMETRY
    if drives.emulated:
        world = world.model_copy(update={"realtime": True})
    return own_rig(run_dir, world, controller, table=table, parameters=parameters, drives=drives)


def drives_of(section: RigSection) -> DrivesSection:
    """Drives of a simulation of our own; raises ``UserError`` if they do not go with its pace."""
    if section.drives is Drives.SIM:
        return DrivesSection()
    if section.pace is Pace.FAST:
        raise UserError(f"--drives {section.drives} keeps to the wall clock like real drives: leave out --pace")
    return EMULATED[section.drives]


def world_settings(rig: RigFile, **also: Any) -> WorldSettings:
    """The world of a simulated rig, with its pieces set up, and further fields of the settings.

    Raises ``UserError`` if the position is none, or the set cannot show it.
    """
    world = rig.world_section
    try:
        board = chess.Board(world.fen) if world.fen is not None else chess.Board()
    except ValueError as error:
        raise ConfigError(f"world.fen is not a position: {error}") from error
    chosen: dict[str, Any] = {name: getattr(world, name) for name in WorldOptions.model_fields}
    if world.person is not None:
        chosen["hand"] = HandSettings(side=world.person)
    if rig.drives.emulated:
        chosen["drives"] = rig.drives.common
        chosen[rig.drives.bus] = rig.drives.of_bus
    return WorldSettings(
        **chosen, pieces=start_layout(board, rig.table) if board.occupied else (), table=rig.table,
        home=MotionSettings().at(rig.table).home, parameters_file=world.robot or rig.parameters, **also,
    )  # fmt: skip
