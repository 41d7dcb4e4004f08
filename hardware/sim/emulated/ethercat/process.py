"""The process of a simulated world behind emulated EtherCAT drives: ``python -P -m … RUN_DIR``.

It makes the network first, while it has one thread alone, and only then loads everything else. The cable's other end
stays for as long as this process lives.
"""

import sys
from pathlib import Path
from typing import Final

from hardware.sim.emulated.ethercat.namespace import SLAVES_END, NoNetwork, announce, make_network

SETTINGS_FILE: Final = "ethercat.json"
"""In the run directory: ``EtherCatSettings`` of the emulated devices."""


def run(run_dir: Path) -> None:
    """Be the world and its devices until nobody needs them; raises ``NoNetwork`` and ``HardwareError``."""
    make_network()
    announce(run_dir)

    from hardware.drives.ethercat.settings import EtherCatSettings  # noqa: PLC0415 - after the network was made
    from hardware.parameters import load_parameters  # noqa: PLC0415
    from hardware.sim.emulated.ethercat.devices import EtherCatDevices  # noqa: PLC0415
    from hardware.sim.emulated.plant_drives import driven_world_of  # noqa: PLC0415
    from hardware.sim.process.settings import load_settings  # noqa: PLC0415

    settings = load_settings(run_dir)
    assert settings.drives is not None
    ethercat = EtherCatSettings.model_validate_json((run_dir / SETTINGS_FILE).read_text(encoding="utf-8"))
    robot = load_parameters(settings.parameters_file)
    devices = EtherCatDevices(ethercat, settings.drives, robot, SLAVES_END)
    try:
        driven_world_of(run_dir, devices).run()
    finally:
        devices.close()


if __name__ == "__main__":
    try:
        run(Path(sys.argv[1]))
    except NoNetwork as error:
        sys.exit(str(error))
