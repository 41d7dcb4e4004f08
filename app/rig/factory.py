"""The factory of rigs, and the only place where simulated and real differ for whoever plays on them."""

from collections.abc import Callable
from pathlib import Path

from app.rig.devices import Rig, RigFailed
from app.rig.remote import RemoteRig
from app.rig.rig_file import RigFile, load_rig
from app.rig.simulation.sim import SimRig
from app.settings.defaults import BOARD, SIMULATED
from controller.wire.link import Listener


def choose_rig(name: str) -> RigFile | None:
    """What ``--rig`` names where devices are needed: None for a simulation of our own, else a rig file; raises
    ``UserError`` if there is no such rig, or something in its file is wrong.
    """
    if name == SIMULATED:
        return None
    if name == BOARD:
        raise RigFailed(f"rig {BOARD} has no devices: choose sim, or the TOML file of a lab's rig")
    return load_rig(Path(name))


def open_rig(
    rig: RigFile,
    progress: Callable[[str], None],
    listener: Listener | None = None,
    *,
    own: bool = False,
    new: bool = True,
) -> Rig:
    """Open a rig; returns when the arm holds. Raises ``RigFailed`` if something did not start or answer.

    The listener is called with each telemetry of the controller, in a thread of its own. ``own``: it is a simulation of
    our own, whose processes start and end with it; of such a one ``new=False`` takes over what runs, or was left, in
    its run directory.
    """
    return SimRig(rig, progress, listener, new=new) if own else RemoteRig(rig, progress, listener)
