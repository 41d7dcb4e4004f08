"""MuJoCo's own viewer on a world that runs: for people's eyes, as the film is. Nothing that plays can use it."""

import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import mujoco

from hardware.interfaces import HardwareError
from hardware.sim.clients.referee import SimReferee
from hardware.sim.render.drawing import draw_rods
from hardware.sim.render.renderer import MODEL_FILE

REFRESH: Final = 1.0 / 30.0
"""[s, wall]"""
HIDDEN_GROUP: Final = 3
"""What touches but is not seen."""


def watch_world(run_dir: Path, progress: Callable[[str], None]) -> None:
    """Show a world that runs with cameras, whose model lies in its run directory, until its window is closed or it
    ends.

    Raises ``HardwareError`` if there is no screen, the viewer's library is not installed, or no such world runs.
    """
    viewer = _viewer()
    path = run_dir / MODEL_FILE
    if not path.exists():
        raise HardwareError(f"no world with cameras runs in {run_dir}: start a game, then look at it")
    model = mujoco.MjModel.from_binary_path(str(path))
    data = mujoco.MjData(model)
    referee = SimReferee(run_dir)
    try:
        data.qpos[:] = referee.positions()
        mujoco.mj_kinematics(model, data)
        with viewer.launch_passive(model, data, show_left_ui=False, show_right_ui=False) as window:
            window.opt.geomgroup[HIDDEN_GROUP] = 0
            window.cam.lookat[:], window.cam.distance = (0.0, 0.0, 0.1), 1.2
            window.cam.azimuth, window.cam.elevation = 110.0, -25.0
            progress(f"showing the world in {run_dir}; close the window to end")
            while window.is_running():
                try:
                    positions = referee.positions()
                except HardwareError:
                    progress("the world has ended")
                    return
                with window.lock():
                    data.qpos[:] = positions
                    mujoco.mj_kinematics(model, data)
                    mujoco.mj_camlight(model, data)
                    window.user_scn.ngeom = 0
                    draw_rods(window.user_scn, data)
                window.sync()
                time.sleep(REFRESH)
    finally:
        referee.close()


def _viewer() -> Any:
    """The viewer's module; raises ``HardwareError`` if it does not start here."""
    try:
        import glfw  # noqa: PLC0415  # for a window alone; not needed for anything else
        from mujoco import viewer  # noqa: PLC0415
    except ImportError as error:
        raise HardwareError("MuJoCo's viewer needs the package glfw: install it with 'pip install glfw'") from error
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the same: it is told in one sentence below
        started = glfw.init()
    if not started:
        raise HardwareError("there is no screen for MuJoCo's viewer here: the film game.webm shows the game, too")
    return viewer
