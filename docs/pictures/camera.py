"""Draws camera.jpg: a game as the simulated RGB-D camera sees it, with and without its sensors' errors.

.venv/bin/python docs/pictures/camera.py
"""

from __future__ import annotations

from pathlib import Path

import chess
import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from app.motion import MotionSettings
from app.pieces.layout import start_layout
from hardware.camera.framesets import FrameMaker
from hardware.camera.software_device import DepthStream, SoftwareCamera
from hardware.parameters import load_parameters
from hardware.sim.bodies.scene import build_model
from hardware.sim.process.settings import WorldSettings, stand_pieces
from hardware.sim.render.d435 import LEFT_IMAGER, colour_intrinsics, depth_intrinsics
from hardware.sim.render.renderer import Sensor
from hardware.sim.render.settings import CameraSettings, Looks
from hardware.sim.render.still import StillRenderer
from hardware.table import TableSettings

POSITION = "r2q1rk1/ppp2ppp/2npbn2/2b1p3/2B1P3/2NPBN2/PPP2PPP/R2Q1RK1 w - - 0 8"
NEAR, FAR = 0.40, 0.85
"""Ends of the colours [m]."""


def main() -> None:
    """Draw and write."""
    settings = WorldSettings(
        pieces=start_layout(chess.Board(POSITION), TableSettings()), home=MotionSettings().home, seed=3
    )
    home = np.array(settings.home)
    model = build_model(load_parameters(), settings.table, stand_pieces(settings), home)
    with StillRenderer(model) as still:
        _, ideal = _shoot(still, model, CameraSettings(noise=False))
        colour, depth = _shoot(still, model, CameraSettings())
    pinhole = colour_intrinsics(640, 480)
    device = SoftwareCamera(pinhole, DepthStream(depth_intrinsics(), 1e-3, LEFT_IMAGER))
    frame = FrameMaker().make(device.pass_through(colour, depth, 0.0), 0.0)
    device.close()
    assert frame.depth is not None
    panels = [frame.colour, _shown(frame.depth), _shown(ideal * 1e-3), _shown(depth * 1e-3)]
    rows = [np.hstack([_sized(one) for one in panels[i : i + 2]]) for i in (0, 2)]
    path = Path(__file__).with_suffix(".jpg")
    cv2.imwrite(str(path), np.vstack(rows)[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 85])


def _shoot(
    still: StillRenderer, model: mujoco.MjModel, camera: CameraSettings
) -> tuple[NDArray[np.uint8], NDArray[np.uint16]]:
    colour, depth = still.draw(np.array(model.key_qpos[0]), Looks(), Sensor(camera=camera, seed=1, tick=0, depth=True))
    assert depth is not None
    return colour, depth


def _shown(depth: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Depth [m] as colours; black where there is none."""
    level = np.clip((FAR - depth) / (FAR - NEAR), 0.0, 1.0)
    colours = np.array(cv2.applyColorMap((255.0 * level).astype(np.uint8), cv2.COLORMAP_TURBO))[..., ::-1]
    return np.where(depth[..., None] > 0.0, colours, 0).astype(np.uint8)


def _sized(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Of one height, the middle of what is wider."""
    start = (picture.shape[1] - 640) // 2
    return picture[:, start : start + 640]


if __name__ == "__main__":
    main()
