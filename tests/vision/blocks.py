"""Depth pictures of blocks on a board, drawn by casting rays: what stands where is exactly known."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from hardware.interfaces import Frame, Intrinsics
from hardware.table import TableSettings
from tests.vision.views import looking_at
from vision.board.view import BoardView

PINHOLE = Intrinsics(640, 480, 615.0, 615.0, 319.5, 239.5)
TABLE = TableSettings()


def view_from(y: float, z: float) -> BoardView:
    """A camera over the board's middle line that looks at its centre."""
    return BoardView(PINHOLE, looking_at((0.0, y + 1e-6, z), (0.0, 0.0, 0.0)), TABLE)


def scene(view: BoardView, blocks: dict[int, tuple[float, int]], hole: bool = False, hovering: float = 0.0) -> Frame:
    """Depth of the board's plane and of blocks half a square wide: square → (height [m], brightness).

    Args:
        view: of the camera.
        blocks: that stand on the board.
        hole: nothing is measured in a stripe of the picture.
        hovering: from this height on blocks are there, and what is below is air [m].
    """
    rotation, shift = view.camera_from_board[:3, :3], view.camera_from_board[:3, 3]
    eye = -rotation.T @ shift
    u, v = np.meshgrid(np.arange(640.0), np.arange(480.0))
    rays = np.stack([(u - PINHOLE.cx) / PINHOLE.fx, (v - PINHOLE.cy) / PINHOLE.fy, np.ones_like(u)], axis=-1)
    rays = rays @ rotation  # in the board frame; the third coordinate in the camera stays 1
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.where(rays[..., 2] < 0.0, -eye[2] / rays[..., 2], 0.0)
        colour = np.full((480, 640, 3), 120, np.uint8)
        for square, (height, shade) in blocks.items():
            x, y = (square % 8 - 3.5) * TABLE.square, (square // 8 - 3.5) * TABLE.square
            half = TABLE.square / 4.0
            low, high = np.array([x - half, y - half, hovering]), np.array([x + half, y + half, height])
            part = window(view, low, high)
            one, two = (low - eye) / rays[part], (high - eye) / rays[part]
            enter, leave = np.minimum(one, two).max(axis=-1), np.maximum(one, two).min(axis=-1)
            hit = (enter < leave) & (enter > 0.0) & ((enter < depth[part]) | (depth[part] == 0.0))
            depth[part], colour[part] = (
                np.where(hit, enter, depth[part]), np.where(hit[..., None], np.uint8(shade), colour[part]),
            )  # fmt: skip
    if hole:
        depth[:, 300:330] = 0.0
    return Frame(colour, depth.astype(np.float32), PINHOLE, 0.0)


def window(view: BoardView, low: NDArray[np.float64], high: NDArray[np.float64]) -> tuple[slice, slice]:
    """Rows and columns of the picture in which a box is seen."""
    pixels = view.project(np.array([[x, y, z] for x, y, z in product(*zip(low, high, strict=True))]))
    left, top = np.clip(np.floor(pixels.min(axis=0)), 0, (640, 480)).astype(int)
    right, bottom = np.clip(np.ceil(pixels.max(axis=0)) + 1, 0, (640, 480)).astype(int)
    return slice(top, bottom), slice(left, right)
