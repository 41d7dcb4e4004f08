"""What runs in the process of a world whose drives are emulated."""

import contextlib
from collections.abc import Iterator
from pathlib import Path

from hardware.interfaces import HardwareError
from hardware.parameters import ParametersError, load_parameters
from hardware.sim.emulated.answer_times import AnswerTimes
from hardware.sim.emulated.ethercat.devices import EtherCatDevices
from hardware.sim.emulated.ethercat.namespace import SLAVES_END
from hardware.sim.emulated.moteus.devices import MoteusDevices
from hardware.sim.emulated.plant_drives import DrivenWorld, EmulatedDevices, driven_world_of
from hardware.sim.process.settings import WorldSettings, load_settings


def devices_of(run_dir: Path, settings: WorldSettings) -> EmulatedDevices:
    """The devices that a world's settings name; ``HardwareError``: there are none, or no cable, or no such robot."""
    times = AnswerTimes() if settings.realtime else None
    if settings.moteus is not None:
        return MoteusDevices(run_dir, settings.moteus, times)
    if settings.ethercat is not None and settings.drives is not None:
        try:
            robot = load_parameters(settings.parameters_file)
        except ParametersError as error:
            raise HardwareError(f"this world cannot be made: {error}") from error
        return EtherCatDevices(settings.ethercat, settings.drives, robot, SLAVES_END, times)
    raise HardwareError(f"the settings of the world in {run_dir} name no bus to emulate: start it through its rig")


@contextlib.contextmanager
def emulated_world(run_dir: Path) -> Iterator[DrivenWorld]:
    """The world of a run directory with its devices; raises ``HardwareError`` as ``driven_world_of``."""
    devices = devices_of(run_dir, load_settings(run_dir))
    with contextlib.closing(devices):
        yield driven_world_of(run_dir, devices)


def run_emulated(run_dir: Path) -> None:
    """Run it until it is no longer needed."""
    with emulated_world(run_dir) as world:
        world.run()
