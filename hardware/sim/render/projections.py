"""Matrices that OpenGL draws by: from the world into a camera's or lamp's frame, and from there into its picture.

Shape (4, 4), for columns (x, y, z, 1). Depth counts from 1 at the near end to 0 at the far one, where floats are finer.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]


def looking(eye: NDArray[np.float64], forward: NDArray[np.floating], up: NDArray[np.floating]) -> Matrix:
    """The world in the frame of who looks: x right, y up, z backward."""
    ahead = forward / np.linalg.norm(forward)
    side = np.cross(ahead, up)
    side /= np.linalg.norm(side)
    view = np.eye(4)
    view[:3, :3] = side, np.cross(side, ahead), -ahead
    view[:3, 3] = -view[:3, :3] @ eye
    return view


_REVERSED: Final = np.array([[1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, -0.5, 0.5], [0, 0, 0, 1.0]])
"""Depth from -1 to 1 as depth from 1 to 0."""
TO_TEXTURE: Final = np.array([[0.5, 0, 0, 0.5], [0, 0.5, 0, 0.5], [0, 0, 1.0, 0], [0, 0, 0, 1.0]])
"""Places in a picture, -1 to 1, as places in a texture, 0 to 1."""


def _reversed(projection: Matrix) -> Matrix:
    turned: Matrix = _REVERSED @ projection
    return turned


def frustum(left: float, right: float, bottom: float, top: float, near: float, far: float) -> Matrix:
    """A pinhole's projection; borders are those of the picture at the near end [m]."""
    wide, high, deep = right - left, top - bottom, far - near
    seen = np.array(
        [
            [2.0 * near / wide, 0.0, (right + left) / wide, 0.0],
            [0.0, 2.0 * near / high, (top + bottom) / high, 0.0],
            [0.0, 0.0, -(far + near) / deep, -2.0 * far * near / deep],
            [0.0, 0.0, -1.0, 0.0],
        ]
    )
    return _reversed(seen)


def orthographic(half: float, near: float, far: float) -> Matrix:
    """The projection along parallel rays of what lies up to so far from the middle."""
    deep = far - near
    return _reversed(
        np.array(
            [[1.0 / half, 0, 0, 0], [0, 1.0 / half, 0, 0], [0, 0, -2.0 / deep, -(far + near) / deep], [0, 0, 0, 1.0]]
        )
    )


def across_from(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """What counts as up for a lamp that shines along a direction."""
    across = np.cross(direction, [-1.0, 0.0, 0.0])
    return across if float(across @ across) > 0.01 else np.cross(direction, [0.0, 1.0, 0.0])
