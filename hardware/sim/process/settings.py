"""What a simulated world is made of; written by the app into the run directory, read by the world's process."""

from pathlib import Path
from typing import Self

from pydantic import NonNegativeFloat, NonNegativeInt, PositiveFloat, ValidationError, model_validator

from hardware.drives.ethercat.settings import EtherCatSettings
from hardware.drives.moteus.settings import MoteusSettings
from hardware.drives.settings import DriveSettings
from hardware.frozen import Frozen
from hardware.interfaces import LINGER, SEED, HardwareError, Pace
from hardware.parameters import DEFAULT_FILE
from hardware.sim.bodies.placed import StandingPiece
from hardware.sim.hand.actions import HandSettings
from hardware.sim.process.planted import PlantedFault
from hardware.sim.process.randomisation import Randomisation, stand
from hardware.sim.render.settings import CameraSettings, LightSettings
from hardware.table import PieceSpec, TableSettings

FILE_NAME = "world.json"
END_FILE = "world_end.json"
"""How a world ended."""


class WorldOptions(Frozen):
    """What somebody may choose about a simulated world: ``[world]`` of a rig file, and the world's own settings."""

    pace: Pace = Pace.REAL
    """How plant time goes."""
    seed: NonNegativeInt = SEED
    """Decides how the pieces stand, and everything else that is drawn at random."""
    cameras: bool = True
    """False: no renderer, and no OpenGL needed."""
    camera: CameraSettings = CameraSettings()
    """Of the board: size of its pictures, noise, exposure, and how it hangs off its nominal pose."""
    light: LightSettings = LightSettings()
    """Lamp, fill and ambient light over the table at the start; scene control changes it while the world runs."""
    randomisation: Randomisation = Randomisation()
    """How the world differs from what the app believes; drawn by the seed."""
    hand: HandSettings | None = None
    """The hand of a person who plays; None: nobody sits at the board, and nothing is different for it."""
    linger: NonNegativeFloat = LINGER
    """After the controller is lost, wait this long for another one [s, wall]."""
    camera_latency: PositiveFloat = 0.060
    """From exposure to delivery of a frame, plant time [s]."""
    planted: tuple[PlantedFault, ...] = ()
    """Faults of emulated drives, which a bring-up or a driver has to find."""
    journal: bool = False
    """Keep every command in the run directory, so that the run can be done again; see
    ``hardware.sim.process.journal``."""
    realtime: bool = False
    """Pace real: as punctual as a motion board, by real time where the system grants it; for measurements. Otherwise
    the world is an ordinary program."""

    @model_validator(mode="after")
    def _repeatable(self) -> Self:
        if self.journal and self.hand is not None:
            raise ValueError("a journal holds the drives' commands alone, so a world with a hand cannot keep one")
        return self


class WorldSettings(WorldOptions):
    """Settings of one simulated world: what was chosen, and what follows from the rig and the position."""

    pieces: tuple[PieceSpec, ...]
    home: tuple[float, float, float]
    """Tool point at the start, base frame [m]."""
    table: TableSettings = TableSettings()
    parameters_file: Path = DEFAULT_FILE
    drives: DriveSettings | None = None
    """On which bus the robot's drives are: that has a period, a watchdog and encoders of its own. None: the drives are
    those of the parameters."""
    moteus: MoteusSettings | None = None
    """The controllers of a moteus bus that are emulated; None: there are none."""
    ethercat: EtherCatSettings | None = None
    """The devices along an EtherCAT cable that are emulated; None: there are none. Such a world has a module of its own
    for its process, see ``hardware.sim.emulated.ethercat.process``."""
    first_controller: NonNegativeFloat = 90.0
    """A world that no controller has used yet ends after this; compiling a controller's law takes some [s, wall]."""

    @model_validator(mode="after")
    def _one_bus(self) -> Self:
        named = [name for name in ("moteus", "ethercat") if getattr(self, name) is not None]
        if len(named) > 1:
            raise ValueError("both moteus and ethercat are given, and the drives are on one bus: leave one of them out")
        if named and self.drives is None:
            raise ValueError(f"{named[0]} is given without drives: describe the bus and the joints in [drives]")
        return self


def keep_settings(settings: WorldSettings, run_dir: Path) -> None:
    """Leave a world's settings in its run directory."""
    (run_dir / FILE_NAME).write_text(settings.model_dump_json(), encoding="utf-8")


def load_settings(run_dir: Path) -> WorldSettings:
    """Read what the app left in the run directory; raises ``HardwareError`` if they are missing or malformed."""
    path = run_dir / FILE_NAME
    try:
        return WorldSettings.model_validate_json(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise HardwareError(f"no world settings at {path}: start the world through 'touchmove demo'") from error
    except ValidationError as error:
        first = error.errors()[0]
        raise HardwareError(f"{path}: {'.'.join(map(str, first['loc']))}: {first['msg']}") from error


def stand_pieces(settings: WorldSettings) -> tuple[StandingPiece, ...]:
    """Every piece where it is put down before the start; decided by the seed."""
    return stand(settings.randomisation, settings.seed, settings.pieces, settings.table)
