"""The factory of rigs, and the only place where simulated and real differ for whoever plays on them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from app.rig.devices import Rig, RigFailed
from app.rig.remote import RemoteRig
from app.rig.rig_file import RigFile, load_rig
from app.rig.simulation.settings import SimRigSettings
from app.rig.simulation.sim import SimRig
from app.settings.tree import BOARD, SIMULATED
from controller.wire.link import Listener


def choose_rig(name: str) -> RigFile | None:
    """What ``--rig`` names where devices are needed: None for a simulation of our own, else a rig file.

    Raises:
        UserError: there is no such rig, or something in its file is wrong.
    """
    if name == SIMULATED:
        return None
    if name == BOARD:
        raise RigFailed(f"rig {BOARD} has no devices: choose sim, or the TOML file of a lab's rig")
    return load_rig(Path(name))


def open_rig(
    rig: RigFile | None,
    run_dir: Path,
    settings: SimRigSettings | None,
    progress: Callable[[str], None],
    listener: Listener | None = None,
) -> Rig:
    """Open a rig; returns when the arm holds.

    Args:
        rig: as chosen; None: a simulation of our own.
        run_dir: of our own simulation.
        settings: of our own simulation; None takes over what runs in the run directory.
        progress: told what is being waited for.
        listener: called with each telemetry of the controller, in a thread of its own.

    Raises:
        RigFailed: something did not start or answer.
    """
    if rig is None:
        return SimRig(run_dir, settings, progress, listener)
    return RemoteRig(rig, progress, listener)
