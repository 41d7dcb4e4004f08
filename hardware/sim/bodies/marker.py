"""The printed marker on the tool, as it looks; nothing touches it."""

import math
from typing import Final

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from hardware.parameters import Marker

MODULES: Final = 8
"""Of a plate's side: four bits, a black border and a white one at each side."""
_MODULE: Final = 32
"""Side of a module in the picture [px]."""
_THICKNESS: Final = 0.001
_NAME: Final = "marker"
_FILE: Final = "marker.png"


def marker_picture(number: int) -> NDArray[np.uint8]:
    """Grey, shape (256, 256): the marker with its white border."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    black = cv2.aruco.generateImageMarker(dictionary, number, (MODULES - 2) * _MODULE, borderBits=1)
    return np.pad(np.asarray(black, dtype=np.uint8), _MODULE, constant_values=255)


def add_marker_looks(spec: mujoco.MjSpec, marker: Marker) -> None:
    """Its picture and the paper it is printed on."""
    done, png = cv2.imencode(".png", np.repeat(marker_picture(marker.number)[..., None], 3, axis=2))
    if not done:
        raise RuntimeError("OpenCV could not encode the picture of the marker")
    spec.assets[_FILE] = bytes(png)
    spec.add_texture(name=_NAME, type=mujoco.mjtTexture.mjTEXTURE_2D, file=_FILE)
    paper = spec.add_material(name=_NAME, reflectance=0.0, specular=0.05)
    paper.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = _NAME


def add_marker(platform: mujoco.MjsBody, marker: Marker) -> None:
    """The plate on the platform, whose frame is the base frame moved to the tool centre."""
    half = 0.5 * marker.plate
    normal = np.array([0.0, -math.cos(marker.tilt), -math.sin(marker.tilt)])
    right = np.array([1.0, 0.0, 0.0])
    axes, quat = np.column_stack([right, np.cross(normal, right), normal]), np.empty(4)
    mujoco.mju_mat2Quat(quat, axes.ravel())
    platform.add_geom(
        name=_NAME, type=mujoco.mjtGeom.mjGEOM_BOX, size=[half, half, _THICKNESS], contype=0, conaffinity=0, mass=0.0,
        pos=(np.array(marker.centre) - _THICKNESS * normal).tolist(), quat=quat.tolist(), material=_NAME,
    )  # fmt: skip
