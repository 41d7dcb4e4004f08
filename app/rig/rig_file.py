"""Rig files.

A *rig file* is the TOML of the devices that a game runs on. The computer that runs the controller and the one that
runs the game may read the same file, or copies of it. Its paths count from the folder it lies in::

    [controller]
    host = "192.168.7.2"        # where the controller listens and the game finds it
    port = 47100
    key = "touchmove.key"       # the secret they share

    [drives]
    bus = "sim"                 # a simulated world; moteus or ethercat; or the name of a lab's own driver

    [world]                     # of simulated and emulated drives alone
    pace = "real"

    [camera]                    # of a lab; a simulated world has its own
    kind = "realsense"
"""

from ipaddress import IPv4Address
from pathlib import Path
from typing import Annotated, Any, Final, Self

from pydantic import Field, model_validator

from app.settings.defaults import BOARD, SIMULATED, Processes
from app.settings.toml import ConfigError, load_toml, toml_value
from controller.protocol.key import load_key
from controller.settings import ANY_PORT, LOOPBACK, ControllerSettings
from controller.wire.address import ControllerAddress, find_controller
from hardware.camera.settings import FolderSettings, LabCamera, NoCameraSettings, RecordingSettings, WebcamSettings
from hardware.drives.ethercat.settings import EtherCatSettings
from hardware.drives.moteus.settings import MoteusSettings
from hardware.drives.settings import DriveSettings
from hardware.frozen import Frozen, NamedPath
from hardware.interfaces import Pace
from hardware.parameters import DEFAULT_FILE, ParametersError, RobotParameters, load_parameters
from hardware.piece_set import Colour
from hardware.sim.process.randomisation import Randomisation
from hardware.sim.process.settings import WorldOptions
from hardware.table import TableSettings

RIG_FILE: Final = "rig.toml"
"""In the run directory of a simulation of our own."""


class ControllerSection(ControllerSettings):
    """``[controller]``: where it listens, and everything in ``ControllerSettings``."""

    port: Annotated[int, Field(ge=0, le=65535)]
    """UDP port, which clients have to know; 0: any that is free, which those on this computer find in the run
    directory."""
    relay: Annotated[int, Field(ge=1, le=65535)] | None = None
    """UDP port on this computer at which clients reach it instead, through a relay; left out: its own."""
    key: NamedPath = Path("touchmove.key")
    """File with the secret that controller and clients share; the controller makes it at its first start."""

    @model_validator(mode="after")
    def _findable(self) -> Self:
        if self.port == ANY_PORT and not IPv4Address(self.host).is_loopback:
            raise ValueError("clients on other computers cannot find a free port: give port a number")
        return self


MOTEUS: Final = "moteus"
ETHERCAT: Final = "ethercat"
BUSES: Final = (SIMULATED, MOTEUS, ETHERCAT)
"""Whose drivers are part of this program."""


class DrivesSection(DriveSettings):
    """``[drives]``: what the controller drives. Fields of ``DriveSettings`` are for moteus and EtherCAT."""

    bus: Annotated[str, Field(pattern=r"^[A-Za-z][\w.-]*$")] = SIMULATED
    """``sim``, a simulated world; ``moteus`` or ``ethercat``; or the name of a lab's driver, an entry point of the
    group ``touchmove.drives``."""
    emulated: bool = False
    """The devices of the bus are emulated, and move a simulated world: to try a rig file before there is a robot."""
    moteus: MoteusSettings | None = None
    """Adapter and controllers of ``bus = "moteus"``."""
    ethercat: EtherCatSettings | None = None
    """Cable and devices of ``bus = "ethercat"``."""

    @model_validator(mode="after")
    def _of_this_bus(self) -> Self:
        for name in (MOTEUS, ETHERCAT):
            if getattr(self, name) is not None and self.bus != name:
                raise ValueError(f'[drives.{name}] is for bus = "{name}" only: leave it out, or choose that bus')
        if self.known:
            return self
        chosen = sorted(self.model_fields_set & {"emulated", *DriveSettings.model_fields})
        if chosen:
            raise ValueError(
                f'{chosen[0]} is for bus = "{MOTEUS}" and "{ETHERCAT}" only: leave it out; other drives are described '
                "by the robot's parameters"
            )
        return self

    @property
    def known(self) -> bool:
        """The bus is one that ``DriveSettings`` say how to run."""
        return self.bus in (MOTEUS, ETHERCAT)

    @property
    def simulated(self) -> bool:
        """A simulated world stands behind them."""
        return self.bus == SIMULATED or self.emulated

    @property
    def of_bus(self) -> MoteusSettings | EtherCatSettings:
        """What the section of the bus says, or its defaults; of a known bus."""
        return (self.moteus or MoteusSettings()) if self.bus == MOTEUS else (self.ethercat or EtherCatSettings())

    @property
    def common(self) -> DriveSettings:
        """What means the same on every bus."""
        return DriveSettings(**{name: getattr(self, name) for name in DriveSettings.model_fields})


class WorldSection(WorldOptions):
    """``[world]``: the simulated world behind simulated or emulated drives."""

    fen: str | None = None
    """The position that is set up; the usual one if not given. An empty board: not even pieces beside it."""
    person: Colour | None = None
    """The side at which a simulated person sits; nobody if left out. Their hand does what a program of its own has it
    do: a game knows as little of that as in a lab."""

    robot: NamedPath | None = None
    """Parameters of the robot that is there, whatever the rig file's ``parameters`` believe of it; these if left
    out."""
    processes: Processes = Processes.TOGETHER
    """Of a game's own simulation in pace fast; ``touchmove controller`` keeps world and controller apart."""

    @property
    def together(self) -> bool:
        """World and controller of a game's own simulation run in one process."""
        return self.pace is Pace.FAST and self.processes is Processes.TOGETHER

    @model_validator(mode="after")
    def _one_person(self) -> Self:
        if self.person is not None and (self.journal or self.hand is not None):
            raise ValueError("a person has one hand, and a world with a hand keeps no journal: leave person out")
        return self


class RigFile(Frozen):
    """A rig file; all paths are absolute once it was read by ``load_rig``."""

    controller: ControllerSection
    drives: DrivesSection = DrivesSection()
    world: WorldSection | None = None
    camera: Annotated[LabCamera, Field(discriminator="kind")] | None = None
    """That looks at a lab's board; none if left out."""
    run_dir: NamedPath = Path("run")
    """Where the controller leaves its flight records, and a simulated world its sockets."""
    parameters: NamedPath = DEFAULT_FILE
    """Of the robot."""
    table: TableSettings = TableSettings()
    calibration: NamedPath = Path("calibration.json")
    """Where ``touchmove calibrate`` writes how the camera hangs, and games read it."""

    @model_validator(mode="after")
    def _world_of_simulated_drives(self) -> Self:
        if self.world is not None and not self.simulated:
            raise ValueError('a [world] stands behind bus = "sim" and emulated drives only: leave it out')
        if self.camera is not None and self.simulated:
            raise ValueError('a [camera] belongs to a lab; behind bus = "sim" the world has its own: leave it out')
        if self.world_section.planted and not self.drives.emulated:
            raise ValueError("faults are planted in emulated drives only: set emulated = true in [drives]")
        if self.drives.emulated and self.pace is not Pace.REAL:
            raise ValueError("emulated drives keep to the wall clock like real ones: leave out the world's pace")
        return self

    @property
    def simulated(self) -> bool:
        """Whether the drives are those of a simulated world."""
        return self.drives.simulated

    @property
    def world_section(self) -> WorldSection:
        """The simulated world, as it is where the file says nothing about it."""
        return self.world or WorldSection()

    @property
    def lab_camera(self) -> LabCamera:
        """The camera of a lab, as it is where the file says nothing about it."""
        return self.camera or NoCameraSettings()

    @property
    def pace(self) -> Pace:
        """Of a lab: real."""
        return self.world_section.pace if self.simulated else Pace.REAL

    @property
    def sees(self) -> bool:
        """Whether there is a camera."""
        return self.world_section.cameras if self.simulated else not isinstance(self.lab_camera, NoCameraSettings)

    def robot(self) -> RobotParameters:
        """The robot with its drives as they are on this rig's bus; raises ``ParametersError``."""
        parameters = load_parameters(self.parameters)
        return self.drives.common.robot(parameters) if self.drives.known else parameters

    def address(self) -> ControllerAddress:
        """Where clients reach the controller; raises ``KeyFileError`` if the key cannot be read and
        ``ControllerUnavailable`` if it has any free port, and none runs in the run directory.
        """
        section = self.controller
        if section.port == ANY_PORT:
            found = find_controller(self.run_dir, section.key)
            return found if section.relay is None else found._replace(host=LOOPBACK, port=section.relay)
        return ControllerAddress(section.host, section.port, load_key(section.key))


def load_rig(path: Path) -> RigFile:
    """Read a rig file; raises ``ConfigError`` if it cannot be read, or something in it is wrong."""
    if path == Path(BOARD) and not path.exists():
        raise ConfigError(f"rig {BOARD} has no devices: choose sim, or the TOML file of a lab's rig")
    rig = load_toml(path, RigFile, "rig", "give sim, board, or the TOML file of a lab's rig")
    folder = path.absolute().parent
    key = rig.controller.model_copy(update={"key": folder / rig.controller.key})
    paths = {"run_dir": folder / rig.run_dir, "parameters": folder / rig.parameters}
    paths["calibration"] = folder / rig.calibration
    world = rig.world
    if world is not None and world.robot is not None:
        world = world.model_copy(update={"robot": folder / world.robot})
    try:
        load_parameters(paths["parameters"])
        if world is not None and world.robot is not None:
            load_parameters(world.robot)
    except ParametersError as error:
        raise ConfigError(f"rig file {path}: {error}: correct that file") from error
    drives = rig.drives
    if drives.moteus is not None and drives.moteus.port is not None:
        drives = drives.model_copy(
            update={"moteus": drives.moteus.model_copy(update={"port": folder / drives.moteus.port})}
        )
    return rig.model_copy(
        update={"controller": key, "camera": _placed(rig.camera, folder), "drives": drives, "world": world, **paths}
    )


def save_rig(rig: RigFile, path: Path) -> None:
    """Write a rig file that ``load_rig`` reads as the same rig, also where its folder has been moved to.

    What is as usual is left out.
    """
    content = _counted_from(path.absolute().parent, rig.model_dump(exclude_defaults=True))
    sections = {name: value for name, value in content.items() if isinstance(value, dict)}
    lines = [f"{name} = {toml_value(value)}" for name, value in content.items() if name not in sections]
    for name, section in sections.items():
        lines += ["", f"[{name}]", *(f"{key} = {toml_value(value)}" for key, value in section.items())]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _counted_from(folder: Path, content: dict[str, Any]) -> dict[str, Any]:
    """The same with what lies in a folder counted from there."""
    paths = {name: value for name, value in content.items() if isinstance(value, Path) and value.is_relative_to(folder)}
    below = {name: _counted_from(folder, value) for name, value in content.items() if isinstance(value, dict)}
    return {**content, **{name: value.relative_to(folder) for name, value in paths.items()}, **below}


def load_randomisation(path: Path) -> Randomisation:
    """Read how a simulated world differs from what the game believes; raises ``ConfigError`` if the file is wrong."""
    return load_toml(path, Randomisation, "randomisation", "give a TOML file with fields of Randomisation")


def _placed(camera: LabCamera | None, folder: Path) -> LabCamera | None:
    """A camera's settings with paths that count from the rig file's folder."""
    match camera:
        case FolderSettings(path=path) | RecordingSettings(path=path):
            return camera.model_copy(update={"path": folder / path})
        case WebcamSettings(device=Path() as device):
            return camera.model_copy(update={"device": folder / device})
        case _:
            return camera
