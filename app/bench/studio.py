"""Pictures of positions without a game: pieces stand where they are put, and nothing moves.

A bench of vision wants thousands of positions, and playing them would take hours of physics that it does not look at.
So the whole world is built once, with its light, camera and sensors as the seed draws them, and pieces are set from
picture to picture, each with its offset and turn as a person would put it down.
"""

from __future__ import annotations

import math
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Final, Self

import chess
import mujoco
import numpy as np

from app.layout import start_layout
from app.motion import MotionSettings
from hardware.framesets import FrameMaker
from hardware.interfaces import Frame
from hardware.sim.construction import Construction
from hardware.sim.d435 import DEPTH_HEIGHT, DEPTH_WIDTH, LEFT_IMAGER, colour_intrinsics, depth_intrinsics
from hardware.sim.randomisation import Randomisation
from hardware.sim.renderer import DEPTH_BYTES, MODEL_FILE, Renderer, Sensor, Shot, frame_path
from hardware.sim.settings import WorldSettings
from hardware.software_device import DepthStream, SoftwareCamera
from hardware.table import Place, TableSettings

INTERVAL: Final = 0.5
"""Between pictures, in the frames' stamps [s]."""
PATIENCE: Final = 60.0
"""With a picture: nobody's game waits for it [s, wall]."""


@dataclass(frozen=True, slots=True)
class Stand:
    """How a piece stands: its place, offset from the place's centre along x and y [m], and turn [rad]."""

    place: Place
    x: float
    y: float
    yaw: float


class Studio:
    """A board that is set and photographed.

    Attributes:
        looks: light, exposure and mount in the next picture; may be set.
        stands: how each piece stands, by name.
    """

    def __init__(
        self, randomisation: Randomisation, seed: int, off: float, board: chess.Board, table: TableSettings | None = None
    ) -> None:
        """Build the world and set up a position.

        Args:
            randomisation: of light, camera and sensors.
            seed: draws them, and where pieces are put.
            off: pieces are put down up to so far off along both axes [m].
            board: the first position.
            table: board and trays.

        Raises:
            HardwareError: there is no OpenGL here.
        """
        self._table = table or TableSettings()
        self._rng = np.random.default_rng([seed, 77])
        self._off, self._shots = off, 0
        settings = WorldSettings(
            pieces=start_layout(board, self._table), home=MotionSettings().home, seed=seed, table=self._table,
            randomisation=randomisation,
        )  # fmt: skip
        built = Construction.of(settings)
        self._camera, self._seed, self.looks = built.camera, seed, built.looks
        self._model = built.model(looks=True)
        self._positions = np.array(self._model.key_qpos[0])
        self.stands: Mapping[str, Stand] = {}
        self._folder = Path(tempfile.mkdtemp(prefix="touchmove-studio-"))
        mujoco.mj_saveModel(self._model, str(self._folder / MODEL_FILE))
        frame_path(self._folder, 0).touch()
        self._renderer = Renderer(self._folder)
        stream = DepthStream(depth_intrinsics(), self._camera.depth_unit, LEFT_IMAGER)
        self._device = SoftwareCamera(colour_intrinsics(self._camera.width, self._camera.height), stream)
        self._maker = FrameMaker()
        try:
            self._renderer.wait_ready()
        except BaseException:
            self.close()
            raise
        self.set(board)

    def __enter__(self) -> Self:
        """Itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close."""
        self.close()

    def set(self, board: chess.Board) -> None:
        """Set up a position: what stands on the right square stays untouched, everything else is put down anew."""
        stands = {}
        for piece in start_layout(board, self._table):
            old = self.stands.get(piece.name)
            if old is None or old.place != piece.place:
                x, y = self._rng.uniform(-self._off, self._off, 2).tolist()
                old = Stand(piece.place, x, y, float(self._rng.uniform(-math.pi, math.pi)))
            stands[piece.name] = old
        self.stands = stands
        for name, stand in stands.items():
            self.put(name, stand)

    def put(self, name: str, stand: Stand) -> None:
        """Put one piece somewhere."""
        x, y = self._table.xy(stand.place)
        start = self._model.joint(name).qposadr[0]
        half = 0.5 * stand.yaw
        self._positions[start : start + 2] = x + stand.x, y + stand.y
        self._positions[start + 3 : start + 7] = math.cos(half), 0.0, 0.0, math.sin(half)
        self.stands = {**self.stands, name: stand}

    def shoot(self) -> Frame:
        """Take a picture, through librealsense like the simulated camera's.

        Raises:
            HardwareError: the renderer has ended.
        """
        self._shots += 1
        stamp = INTERVAL * self._shots
        sensor = Sensor(camera=self._camera, seed=self._seed, tick=self._shots, depth=True)
        self._renderer.request(Shot(slot=0, view="camera", looks=self.looks, sensor=sensor), self._positions)
        self._renderer.take(wait=True, patience=PATIENCE)
        shape = (self._camera.height, self._camera.width, 3)
        file = frame_path(self._folder, 0)
        colour = np.fromfile(file, np.uint8, offset=DEPTH_BYTES, count=math.prod(shape)).reshape(shape)
        depth = np.fromfile(file, np.uint16, count=DEPTH_WIDTH * DEPTH_HEIGHT).reshape(DEPTH_HEIGHT, DEPTH_WIDTH)
        return self._maker.make(self._device.pass_through(colour, depth, stamp), stamp)

    def close(self) -> None:
        """End the renderer, remove its files."""
        self._renderer.close()
        self._device.close()
        shutil.rmtree(self._folder, ignore_errors=True)


