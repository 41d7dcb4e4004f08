"""Draws boxes.jpg: where a game with boxes for captured pieces ended, as the board's camera and the film see it.

Run from the top of the repository, after a game:

touchmove demo --pace fast --no-video --captured box --seed 1 --nodes 2000 --plies 120 --out games/boxes
PYTHONPATH=. MUJOCO_GL=egl python docs/pictures/boxes.py games/boxes
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import mujoco
import numpy as np

from hardware.sim.plant.snapshot import STATE_FILE
from hardware.sim.process.construction import Construction
from hardware.sim.process.settings import load_settings
from hardware.sim.render.drawing import draw_rods

TARGET = Path(__file__).with_name("boxes.jpg")


def main(game: Path) -> None:
    """Draw it from what the game's world left."""
    model = Construction.of(load_settings(game / "run")).model(looks=True)
    data, option = mujoco.MjData(model), mujoco.MjvOption()
    with np.load(game / "run" / STATE_FILE) as state:
        data.qpos[:] = state["qpos"]
    option.geomgroup[3] = 0
    mujoco.mj_forward(model, data)
    renderer, views = mujoco.Renderer(model, 480, 640), []
    for camera in ("camera", "film"):
        renderer.update_scene(data, camera=camera, scene_option=option)
        draw_rods(renderer.scene, data)
        views.append(renderer.render())
    cv2.imwrite(str(TARGET), cv2.cvtColor(np.hstack(views), cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 88])


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("name the folder of a game that was played with --captured box")
    main(Path(sys.argv[1]))
