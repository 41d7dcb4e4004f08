"""Pictures of the soft grasp's world at given joint positions, drawn by the simulated rig's renderer."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.measure.figures.grasp import Grasp
from app.measure.figures.grasp_mujoco import block_world
from controller.model.compiled import FloatArray
from hardware.sim.bodies.grasp_world import build_block_world, save_model
from hardware.sim.render.renderer import HEIGHT, MODEL_FILE, WIDTH, Renderer, RenderRequest, frame_path, load_pictures

_SLOT = 0


def views(grasp: Grasp, positions: Sequence[FloatArray]) -> list[NDArray[np.uint8]]:
    """One picture (480, 640, 3) RGB for each set of joint positions.

    Args:
        grasp: whose world it is.
        positions: each of shape (nq,), of a `MujocoRun`.

    Raises:
        HardwareError: there is no OpenGL here, or it does not draw.
    """
    with tempfile.TemporaryDirectory(prefix="touchmove-figures-") as name:
        folder = Path(name)
        save_model(build_block_world(grasp.parameters, block_world(grasp)), folder / MODEL_FILE)
        frame_path(folder, _SLOT).touch()
        renderer = Renderer(folder)
        try:
            renderer.wait_ready()
            return [_view(renderer, folder, pose) for pose in positions]
        finally:
            renderer.close()


def _view(renderer: Renderer, folder: Path, positions: FloatArray) -> NDArray[np.uint8]:
    renderer.request(RenderRequest(slot=_SLOT, view="camera"), positions)
    renderer.take(wait=True)
    colour, _ = load_pictures(frame_path(folder, _SLOT), WIDTH, HEIGHT, depth=False)
    return colour
