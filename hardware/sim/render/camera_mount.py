"""Where the board's camera really hangs, in the renderer's own model."""

import math

import mujoco
import numpy as np
from numpy.typing import NDArray

from hardware.sim.render.d435 import DEPTH_HEIGHT, LEFT_IMAGER, depth_intrinsics
from hardware.sim.render.settings import MountSettings, Vector

_CV_AXES = np.array([1.0, -1.0, -1.0])
"""OpenCV's camera axes in MuJoCo's, which look along -z with y up."""
_DEPTH_ANGLE = 2.0 * math.atan(0.5 * DEPTH_HEIGHT / depth_intrinsics().fy)
"""Vertical field of view of the left imager [rad]."""


class Mount:
    """A model's camera of a name, seen through either of its sensors; as it is now is its nominal pose."""

    def __init__(self, model: mujoco.MjModel, name: str) -> None:
        self._camera = model.camera(name)
        self._position = np.array(self._camera.pos)
        self._rotation = _from_quat(self._camera.quat) * _CV_AXES
        self._field_of_view = float(self._camera.fovy[0])

    def look(self, mount: MountSettings, *, depth: bool) -> None:
        """Look through the colour sensor, or through the left imager beside it, as the camera really hangs."""
        rotation = self._rotation @ _turned(mount.turn)
        quat = np.empty(4)
        mujoco.mju_mat2Quat(quat, (rotation * _CV_AXES).ravel())
        aside = LEFT_IMAGER * rotation[:, 0] if depth else np.zeros(3)
        self._camera.pos[:] = self._position + np.asarray(mount.shift) + aside
        self._camera.quat[:] = quat
        self._camera.fovy[:] = math.degrees(_DEPTH_ANGLE) if depth else self._field_of_view


def _turned(vector: Vector) -> NDArray[np.float64]:
    """The matrix of a rotation vector [rad], shape (3, 3)."""
    angle = math.hypot(*vector)
    quat = np.array([1.0, 0.0, 0.0, 0.0])
    if angle > 0.0:
        mujoco.mju_axisAngle2Quat(quat, np.asarray(vector) / angle, angle)
    return _from_quat(quat)


def _from_quat(quat: NDArray[np.float64]) -> NDArray[np.float64]:
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, quat)
    return matrix.reshape(3, 3)
