"""Rig files.

A *rig file* is the TOML of the devices that a game runs on. The computer that runs the controller and the one that
runs the game may read the same file, or copies of it. Its paths count from the folder it lies in::

    [controller]
    host = "192.168.7.2"        # where the controller listens and the game finds it
    port = 47100
    key = "touchmove.key"       # the secret they share

    [drives]
    bus = "sim"                 # a simulated world, or the name of a lab's own driver

    [world]                     # of bus = "sim" alone
    pace = "real"

    [camera]                    # of a lab; a simulated world has its own
    kind = "realsense"
"""

from __future__ import annotations

from ipaddress import IPv4Address
from pathlib import Path
from typing import Annotated, Self

from pydantic import AfterValidator, Field, NonNegativeInt, model_validator

from app.settings.toml import ConfigError, load_toml
from app.settings.tree import SIMULATED
from controller.settings import ControllerSettings
from hardware.camera.settings import FolderSettings, LabCamera, NoCameraSettings, RecordingSettings, WebcamSettings
from hardware.frozen import Frozen
from hardware.interfaces import Pace
from hardware.parameters import DEFAULT_FILE, ParametersError, load_parameters
from hardware.sim.process.randomisation import Randomisation
from hardware.sim.render.appearance import CameraSettings, LightSettings
from hardware.table import Colour, TableSettings


def _ipv4(host: str) -> str:
    try:
        return str(IPv4Address(host))
    except ValueError as error:
        raise ValueError("it must be an IPv4 address such as 192.168.7.2") from error


class ControllerSection(ControllerSettings):
    """``[controller]``: where it listens, and everything in ``ControllerSettings``."""

    host: Annotated[str, AfterValidator(_ipv4)] = "127.0.0.1"
    """IPv4 address to listen at, and where clients find it."""
    port: Annotated[int, Field(ge=1, le=65535)]  # whoever is not told of it must know it
    """UDP port."""
    key: Path = Path("touchmove.key")
    """File with the secret that controller and clients share; the controller makes it at its first start."""
    stays: bool = True
    """What comes after ``linger`` without a client: True, brakes, and it waits for the next one; False, it ends."""


class DrivesSection(Frozen):
    """``[drives]``: what the controller drives."""

    bus: Annotated[str, Field(pattern=r"^[A-Za-z][\w.-]*$")] = SIMULATED
    """``sim``, a simulated world; or the name of a lab's driver, an entry point of the group ``touchmove.drives``."""


class WorldSection(Frozen):
    """``[world]``: the simulated world behind ``bus = "sim"``."""

    pace: Pace = Pace.REAL
    seed: NonNegativeInt = 1
    """Decides how the pieces stand."""
    fen: str | None = None
    """The position that is set up; the usual one if not given."""
    person: Colour | None = None
    """The side at which a simulated person sits; nobody if left out. Their hand does what a program of its own has it
    do: a game knows as little of that as in a lab."""
    cameras: bool = True
    camera: CameraSettings = CameraSettings()
    """Size of its pictures, noise, exposure, and how the camera hangs off its nominal pose."""
    light: LightSettings = LightSettings()
    """Lamp, fill and ambient light over the table."""
    randomisation: Randomisation = Randomisation()
    """How it differs from what the game believes of it."""


class RigFile(Frozen):
    """A rig file; all paths are absolute once it was read by ``load_rig``."""

    controller: ControllerSection
    drives: DrivesSection = DrivesSection()
    world: WorldSection | None = None
    camera: Annotated[LabCamera, Field(discriminator="kind")] | None = None
    """That looks at a lab's board; none if left out."""
    run_dir: Path = Path("run")
    """Where the controller leaves its flight records, and a simulated world its sockets."""
    parameters: Path = DEFAULT_FILE
    """Of the robot."""
    table: TableSettings = TableSettings()
    calibration: Path = Path("calibration.json")
    """Where ``touchmove calibrate`` writes how the camera hangs, and games read it."""

    @model_validator(mode="after")
    def _world_of_simulated_drives(self) -> Self:
        if self.world is not None and not self.simulated:
            raise ValueError('a [world] stands behind bus = "sim" only: leave it out')
        if self.camera is not None and self.simulated:
            raise ValueError('a [camera] belongs to a lab; behind bus = "sim" the world has its own: leave it out')
        return self

    @property
    def simulated(self) -> bool:
        """Whether the drives are those of a simulated world."""
        return self.drives.bus == SIMULATED

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


def load_rig(path: Path) -> RigFile:
    """Read a rig file.

    Raises:
        ConfigError: it cannot be read, or something in it is wrong.
    """
    rig = load_toml(path, RigFile, "rig", "give sim, board, or the TOML file of a lab's rig")
    folder = path.absolute().parent
    key = rig.controller.model_copy(update={"key": folder / rig.controller.key})
    paths = {"run_dir": folder / rig.run_dir, "parameters": folder / rig.parameters}
    paths["calibration"] = folder / rig.calibration
    try:
        load_parameters(paths["parameters"])
    except ParametersError as error:
        raise ConfigError(f"rig file {path}: {error}: mend that file") from error
    return rig.model_copy(update={"controller": key, "camera": _placed(rig.camera, folder), **paths})


def load_randomisation(path: Path) -> Randomisation:
    """Read a TOML file with how a simulated world differs from what the game believes of it.

    Raises:
        ConfigError: it cannot be read, or something in it is wrong.
    """
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
