"""What runs inside the processes that a rig starts."""

from __future__ import annotations

from pathlib import Path

from app import UserError
from controller.settings import ControllerSettings
from hardware.parameters import load_parameters
from hardware.sim.settings import load_settings

CONTROLLER_SETTINGS_FILE = "controller_settings.json"


def run_world(run_dir: Path) -> int:
    """The simulated world until it is no longer needed; exit status."""
    from hardware.sim.server import serve

    serve(run_dir)
    return 0


def run_controller(run_dir: Path) -> int:
    """The controller until it is shut down; exit status.

    The law is compiled before the drives are opened: they would brake on a controller that says nothing for so long.
    """
    from controller.law import TaskSpaceController
    from controller.model.constants import DeltaModel
    from controller.safety import default_limits
    from controller.server import serve
    from hardware.sim.bus import SimServoBus

    settings = ControllerSettings.model_validate_json((run_dir / CONTROLLER_SETTINGS_FILE).read_text(encoding="utf-8"))
    world = load_settings(run_dir)
    parameters = load_parameters(world.parameters_file)
    TaskSpaceController(DeltaModel(parameters))
    try:
        limits = default_limits(parameters, world.table)
    except ValueError as error:  # the board is out of reach: said before the drives are opened
        raise UserError(str(error)) from error
    return serve(SimServoBus(run_dir), parameters, settings, run_dir, limits)
