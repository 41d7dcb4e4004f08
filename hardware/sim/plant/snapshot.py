"""A world's last state on disk, from which another world goes on where it ended."""

import zipfile
from pathlib import Path
from typing import Final, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from hardware.interfaces import HardwareError

STATE_FILE = "world_state.npz"
STATE: Final = mujoco.mjtState.mjSTATE_INTEGRATION
"""Of MuJoCo's states the one from which the next step goes on to the last bit."""


class Snapshot(NamedTuple):
    """State of a plant."""

    state: NDArray[np.float64]
    """MuJoCo's, all that a step begins with."""
    tick: int
    """Of the plant."""
    at_rest: bool
    """Everything, and the arm on its brakes."""


def save_snapshot(path: Path, model: mujoco.MjModel, data: mujoco.MjData, tick: int) -> None:
    """Write the state of a plant at rest on its brakes; positions and velocities also by name, for people."""
    state = np.empty(mujoco.mj_stateSize(model, STATE))
    mujoco.mj_getState(model, data, state, STATE)
    new = path.with_suffix(".new.npz")
    np.savez(new, state=state, tick=tick, qpos=data.qpos, qvel=data.qvel)
    new.replace(path)  # who finds it finds it whole


def load_snapshot(path: Path) -> Snapshot | None:
    """Read what a world left; None where there is no snapshot. Raises ``HardwareError`` if the file is none."""
    try:
        with np.load(path) as content:
            return Snapshot(np.array(content["state"], dtype=float), int(content["tick"]), at_rest=True)
    except FileNotFoundError:
        return None
    except (OSError, EOFError, KeyError, ValueError, zipfile.BadZipFile) as error:
        raise HardwareError(
            f"{path} is not a snapshot of a world ({error}): delete it to set the pieces up again"
        ) from error
