"""Pictures of a model at given joint positions: no world runs and nothing moves, the renderer alone draws."""

import tempfile
from pathlib import Path
from typing import Final, Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from hardware.sim.render.renderer import (
    HEIGHT,
    MODEL_FILE,
    WIDTH,
    Renderer,
    RenderRequest,
    Sensor,
    frame_path,
    load_pictures,
    make_slot,
)
from hardware.sim.render.settings import SceneState

VIEW: Final = "camera"
_PATIENCE: Final = 60.0
"""For one picture: here nothing hurries, on however busy a machine [s, wall]."""


class StillRenderer:
    """Draws a model with a camera ``VIEW``. A context manager; raises ``HardwareError`` if there is no OpenGL here."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="touchmove-")
        folder = Path(self._folder.name)
        mujoco.mj_saveModel(model, str(folder / MODEL_FILE))
        self._file = frame_path(folder, 0)
        make_slot(folder, 0)
        self._renderer = Renderer(folder)
        self._renderer.wait_ready()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the renderer."""
        self._renderer.close()
        self._folder.cleanup()

    def draw(
        self, positions: NDArray[np.float64], looks: SceneState | None = None, sensor: Sensor | None = None
    ) -> tuple[NDArray[np.uint8], NDArray[np.uint16] | None]:
        """Colour and depth at joint positions (nq,), as ``load_pictures`` has them; the rest as of ``RenderRequest``.
        Raises ``HardwareError`` if the renderer has ended or is stuck.
        """
        self.request(RenderRequest(slot=0, view=VIEW, looks=looks, sensor=sensor), positions)
        if sensor is None:
            return load_pictures(self._file, WIDTH, HEIGHT, depth=False)
        return load_pictures(self._file, sensor.camera.width, sensor.camera.height, depth=sensor.depth)

    def request(self, shot: RenderRequest, positions: NDArray[np.float64]) -> None:
        """Have any picture drawn into slot 0, and wait for it; raises as ``draw``."""
        self._renderer.request(shot, positions)
        self._renderer.take(wait=True, patience=_PATIENCE)
