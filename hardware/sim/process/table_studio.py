"""Pictures of a table whose every piece is put where a bench wants it, through the simulated camera with its errors.

Nothing moves and no physics runs: the renderer alone draws, so a picture costs a third of a second.
"""

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from hardware.camera.software_device import DepthStream, SoftwareCamera
from hardware.interfaces import Frame
from hardware.parameters import load_parameters
from hardware.piece_set import Colour
from hardware.sim.bodies.hand import JOINTS, HandPose, add_hand
from hardware.sim.bodies.placed import StandingPiece
from hardware.sim.bodies.scene import build_model
from hardware.sim.render.camera_mount import Mount
from hardware.sim.render.d435 import LEFT_IMAGER, colour_intrinsics, depth_intrinsics
from hardware.sim.render.quality import FILM
from hardware.sim.render.renderer import RenderRequest, Sensor
from hardware.sim.render.settings import CameraSettings, MountSettings, SceneState
from hardware.sim.render.still import VIEW, StillRenderer
from hardware.table import PieceSpec, TableSettings

_AWAY = -1.0
"""Height at which pieces that are not wanted are kept, far below the table [m]."""
_CV_AXES = np.diag([1.0, -1.0, -1.0])
"""OpenCV's camera axes in MuJoCo's."""


@dataclass(frozen=True, slots=True)
class PlacedPiece:
    """Where a piece is: foot's centre in the board frame [m], turned about its axis, then tipped about x [rad]."""

    name: str
    x: float
    y: float
    height: float = 0.0
    yaw: float = 0.0
    tip: float = 0.0


class TableStudio:
    """Renders frames of pieces at chosen poses. A context manager.

    The arm's tool is at ``home``, base frame [m]; ``hand`` says whose pictures may show, None: nobody's.
    """

    def __init__(
        self,
        pieces: Sequence[PieceSpec],
        table: TableSettings,
        home: tuple[float, float, float],
        camera: CameraSettings | None = None,
        hand: Colour | None = None,
    ) -> None:
        standing = tuple(StandingPiece(piece, *table.xy(piece.place)) for piece in pieces)
        add = partial(add_hand, side=hand) if hand else None
        self._model = build_model(load_parameters(), table, standing, np.array(home), add=add)
        self._hand = hand
        self._names = [piece.name for piece in pieces]
        self._camera = camera or CameraSettings()
        self._still = StillRenderer(self._model)
        self._device = SoftwareCamera(
            colour_intrinsics(self._camera.width, self._camera.height),
            DepthStream(depth_intrinsics(), self._camera.depth_unit, LEFT_IMAGER),
        )
        self._taken = 0
        self._with_seed = Counter[int]()
        """So many pictures were taken with each seed: what the others of a studio are does not change their noise."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._still.close()
        self._device.close()

    def frame(self, poses: Iterable[PlacedPiece], looks: SceneState, seed: int, hand: HandPose | None = None) -> Frame:
        """A picture of these pieces and no others; ``seed`` decides the sensors' noise, which is another one each time.

        The hand is parked out of the picture where its pose is None; raises ``ValueError`` if there is none in this
        studio.
        """
        if hand is not None and self._hand is None:
            raise ValueError("this studio has no hand: name its side when you open it")
        self._taken += 1
        self._with_seed[seed] += 1
        sensor = Sensor(camera=self._camera, seed=seed, tick=self._with_seed[seed], depth=True)
        colour, depth = self._still.draw(self._positions(poses, hand), looks, sensor)
        return self._device.frame(colour, depth, self._taken / 30.0)

    def glance(self, poses: Iterable[PlacedPiece], seed: int) -> None:
        """Draw what a guard would see, and drop it; for who wants to know what it costs."""
        sensor = Sensor(camera=self._camera, seed=seed, tick=self._taken, depth=True, colour=False, glance=True)
        self._still.request(RenderRequest(slot=0, view=VIEW, sensor=sensor), self._positions(poses, None))

    def colour(self, poses: Iterable[PlacedPiece], seed: int) -> None:
        """Draw what the colour sensor would see, without depth, and drop it."""
        sensor = Sensor(camera=self._camera, seed=seed, tick=self._taken, depth=False)
        self._still.request(RenderRequest(slot=0, view=VIEW, sensor=sensor), self._positions(poses, None))

    def film(self, poses: Iterable[PlacedPiece]) -> None:
        """Draw a picture of a film, and drop it."""
        self._still.request(RenderRequest(slot=0, view="film", quality=FILM), self._positions(poses, None))

    def camera_from_board(self, mount: MountSettings) -> NDArray[np.float64]:
        """The truth: how the camera really hangs, shape (4, 4)."""
        return true_camera(self._model, mount)

    def _positions(self, poses: Iterable[PlacedPiece], hand: HandPose | None) -> NDArray[np.float64]:
        positions = np.array(self._model.key_qpos[0])
        if hand is not None:
            for joint, where in zip(JOINTS, (*hand[:4], hand.gap, hand.gap), strict=True):
                positions[self._model.joint(joint).qposadr[0]] = where
        for name in self._names:
            start = self._model.joint(name).qposadr[0]
            positions[start + 2] = _AWAY
        for pose in poses:
            start = self._model.joint(pose.name).qposadr[0]
            cos, sin = math.cos(0.5 * pose.yaw), math.sin(0.5 * pose.yaw)
            tip, over = math.cos(0.5 * pose.tip), math.sin(0.5 * pose.tip)
            positions[start : start + 3] = pose.x, pose.y, pose.height
            positions[start + 3 : start + 7] = cos * tip, cos * over, sin * over, sin * tip
        return positions


def true_camera(model: mujoco.MjModel, mount: MountSettings) -> NDArray[np.float64]:
    """Pose of the colour sensor in a model's world as it hangs: points of the world frame into the camera's, (4, 4)."""
    hung = Mount(model, VIEW)
    hung.look(mount, depth=False)
    camera, matrix = model.camera(VIEW), np.empty(9)  # of the world itself, so that its own pose is that in the world
    mujoco.mju_quat2Mat(matrix, camera.quat)
    rotation, position = matrix.reshape(3, 3) @ _CV_AXES, np.array(camera.pos)
    hung.look(MountSettings(), depth=False)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation.T, -rotation.T @ position
    return pose
