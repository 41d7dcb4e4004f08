"""Pictures of the simulated table by the rig's camera, with the errors of its colour sensor; helpers of tests."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import chess
import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from app.motion import MotionSettings
from app.pieces.layout import start_layout
from hardware.interfaces import HardwareError
from hardware.parameters import load_parameters
from hardware.sim.bodies.scene import CAMERAS, build_model
from hardware.sim.process.settings import WorldSettings, stand_pieces
from hardware.sim.process.table_studio import TableStudio
from hardware.sim.render.drawing import draw_rods
from hardware.sim.render.renderer import HEIGHT, WIDTH, intrinsics_for
from hardware.sim.render.sensor_model import ColourSensor, colour_picture
from hardware.sim.render.settings import LightSettings
from hardware.table import PieceSpec, TableSettings
from vision.board.view import BoardView, playing_area

CAMERA = CAMERAS["camera"]
TABLE = TableSettings()


@contextmanager
def studio_of(pieces: Sequence[PieceSpec], table: TableSettings = TABLE) -> Iterator[TableStudio]:
    """A studio with this set, the arm at home, where this machine has OpenGL; in CI it must."""
    try:
        made = TableStudio(pieces, table, MotionSettings().at(table).home)
    except HardwareError as error:
        if os.environ.get("CI"):
            raise
        pytest.skip(str(error))
    with made:
        yield made


def view_of(data: mujoco.MjData, model: mujoco.MjModel) -> BoardView:
    """The board as the model's camera truly sees it."""
    index = model.camera("camera").id
    rotation = data.cam_xmat[index].reshape(3, 3) @ np.diag([1.0, -1.0, -1.0])  # MuJoCo looks along -z, y up
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation.T, -rotation.T @ data.cam_xpos[index]
    return BoardView(intrinsics_for(CAMERA.field_of_view), pose, TABLE)


def rendered(
    make: Callable[..., Any],
    fen: str | None,
    tool: NDArray[np.float64] | None = None,
    turn: float = 0.0,
    light: LightSettings | None = None,
    seed: int = 0,
    exposure: float = 1.0,
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """A picture and where the corners a1, h1, h8, a8 truly are in it, shape (4, 2) [px].

    Args:
        make: makes renderers; the fixture ``renderer``.
        fen: what stands on the board; None: nothing, no tray is filled.
        tool: where the arm is; its home if None.
        turn: of the camera about its line of sight [rad].
        light: direction and strengths of the lamp.
        seed: of the sensor's noise.
        exposure: of the sensor.
    """
    home = np.array(MotionSettings().home)
    settings = WorldSettings(
        pieces=() if fen is None else start_layout(chess.Board(fen), TABLE), home=MotionSettings().home
    )
    model = build_model(load_parameters(), TABLE, stand_pieces(settings), home if tool is None else tool)
    lamp = light or LightSettings()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    index = model.camera("camera").id
    spun = np.empty(4)
    mujoco.mju_mulQuat(spun, model.cam_quat[index].copy(), np.array([np.cos(turn / 2), 0.0, 0.0, np.sin(turn / 2)]))
    model.cam_quat[index] = spun
    if model.nlight:
        model.light_pos[0] = lamp.distance * np.array(lamp.direction) / np.linalg.norm(lamp.direction)
        model.light_dir[0] = -model.light_pos[0]
    mujoco.mj_forward(model, data)
    drawer = make(model, HEIGHT, WIDTH)
    option = mujoco.MjvOption()
    option.geomgroup[3] = 0  # shapes for collisions alone
    drawer.update_scene(data, camera="camera", scene_option=option)
    draw_rods(drawer.scene, data)
    picture = colour_picture(
        np.array(drawer.render()), ColourSensor(), exposure=exposure, gain=1.0, white_balance=(1.0, 1.0, 1.0),
        rng=np.random.default_rng(seed),
    )  # fmt: skip
    return picture, view_of(data, model).project(playing_area(TABLE))
