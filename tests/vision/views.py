"""Cameras of tests."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hardware.table import square_place
from vision.board.view import BoardView

Picture = NDArray[Any]


def looking_at(position: tuple[float, float, float], target: tuple[float, float, float], roll: float = 0.0) -> Picture:
    """camera_from_board of a camera at a position, looking at a target with the horizon level but for a roll."""
    forward = np.subtract(target, position) / np.linalg.norm(np.subtract(target, position))
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(forward, right), forward])
    c, s = math.cos(roll), math.sin(roll)
    pose = np.eye(4)
    pose[:3, :3] = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ axes
    pose[:3, 3] = -pose[:3, :3] @ position
    return pose


def square_polygon(view: BoardView, square: int) -> Picture:
    """Corners of a square (0 = a1 … 63 = h8) in the picture, shape (4, 2) [px], in the order of the board's."""
    x, y = view.table.xy(square_place(square))
    half = 0.5 * view.table.square
    return view.project([(x + i * half, y + j * half, 0.0) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
