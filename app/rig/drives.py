"""What opens the drives of a rig: the servo bus that its file names."""

from collections.abc import Callable
from functools import partial
from importlib.metadata import entry_points
from pathlib import Path
from typing import Final

from app.rig.rig_file import BUSES, DrivesSection, RigFile
from app.settings.toml import ConfigError
from hardware.drives.moteus.settings import MoteusSettings
from hardware.interfaces import ServoBus
from hardware.parameters import RobotParameters

DRIVERS: Final = "touchmove.drives"
"""Group of entry points under which a lab's package names its driver, an ``Opener``."""
Opener = Callable[[RobotParameters], ServoBus]
"""Opens drives, given the robot's parameters; raises ``HardwareError``."""


def opener_of(rig: RigFile, require_world: Callable[[], None]) -> Opener:
    """What opens a rig's drives; ``require_world`` is called before simulated or emulated ones are opened.

    Raises ``ConfigError`` if the driver is not installed.
    """
    if not rig.simulated:
        return partial(_open_known, rig.drives) if rig.drives.known else _installed(rig.drives.bus)

    def open_simulated(parameters: RobotParameters) -> ServoBus:
        require_world()
        return _open_emulated(rig, parameters) if rig.drives.emulated else simulated_bus(rig.run_dir)

    return open_simulated


def simulated_bus(run_dir: Path) -> ServoBus:
    """The drives of the world that runs in a run directory."""
    from hardware.sim.clients.bus import SimServoBus

    return SimServoBus(run_dir)


def _open_known(section: DrivesSection, parameters: RobotParameters) -> ServoBus:
    """Real drives; what each driver needs is loaded where it is needed."""
    settings = section.of_bus
    if isinstance(settings, MoteusSettings):
        from hardware.drives.moteus.bus import MoteusServoBus

        return MoteusServoBus(section, settings, parameters)
    from hardware.drives.ethercat.bus import EtherCatServoBus

    return EtherCatServoBus(settings, section, parameters)


def _open_emulated(rig: RigFile, parameters: RobotParameters) -> ServoBus:
    """The same drivers at what stands in the run directory for port and cable."""
    from hardware.sim.clients.camera import SimClock

    SimClock(rig.run_dir).close()  # who answers this hears its bus, too
    settings = rig.drives.of_bus
    if isinstance(settings, MoteusSettings):
        from hardware.drives.moteus.bus import MoteusServoBus
        from hardware.sim.emulated.moteus.devices import PORT

        return MoteusServoBus(rig.drives, settings.model_copy(update={"port": rig.run_dir / PORT}), parameters)
    from hardware.drives.ethercat.bus import EtherCatServoBus
    from hardware.sim.emulated.ethercat.namespace import MASTER_END, network_pid, within_network

    inside = partial(within_network, network_pid(rig.run_dir))
    return EtherCatServoBus(settings.model_copy(update={"interface": MASTER_END}), rig.drives, parameters, inside)


def _installed(name: str) -> Opener:
    """A lab's own driver, by the name of its entry point."""
    drivers = entry_points(group=DRIVERS)
    if name not in drivers.names:
        known = ", ".join([*BUSES, *sorted(drivers.names)])
        raise ConfigError(
            f"drives.bus is '{name}', installed here are: {known}: install the package that provides it as an entry "
            f"point of the group {DRIVERS}"
        )
    try:
        opener: Opener = drivers[name].load()
    except (ImportError, AttributeError) as error:
        raise ConfigError(f"the driver '{name}' cannot be loaded ({error}): install its package again") from error
    return opener
