"""Perspective: which squares a piece hides or leans into, as the camera sees it.

A piece is taken as an upright cylinder, as high and as wide as an average one; seen obliquely, it covers a part of the
plan behind its square. Lengths in sides of a square, plan frame.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RADIUS: Final = 0.30
HEIGHT: Final = 1.3
"""Of an average piece: tournament sets are 1 (pawn) to 1.7 (king) squares high, with feet of 0.6 to 0.8."""
CELLS: Final = 12
"""Along a square, when shares are counted."""


def cover(camera: Array) -> Array:
    """Share of each square's middle that a piece on another one covers in the plan.

    Args:
        camera: the pinhole, plan frame, shape (3,) [squares].

    Returns:
        Shape (64, 64), read-only: row the square with the piece, column the covered square. The diagonal is 1.
    """
    x, y, z = (round(float(value), 1) for value in camera)  # nearer than that, nothing differs
    return _cover(x, y, z)


@lru_cache(maxsize=8)
def _cover(x: float, y: float, z: float) -> Array:
    camera = np.array([x, y])
    above = max(z, HEIGHT + 0.5)  # a camera among the pieces sees no board
    steps = (np.arange(CELLS) + 0.5) / CELLS
    steps = steps[np.abs(steps - 0.5) < 0.4]  # the middle of a square: its edge may belong to a neighbour
    shares = np.eye(64)
    points = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    origins = np.array([(square % 8, square // 8) for square in range(64)], dtype=float)
    for square, origin in enumerate(origins):
        foot = origin + 0.5
        scale = above / (above - HEIGHT)
        head = camera + (foot - camera) * scale
        grid = origins[:, None, :] + points
        # nearest point of the axis' picture; the piece's picture grows from foot to head
        axis = head - foot
        along = np.clip(((grid - foot) @ axis) / max(float(axis @ axis), 1e-9), 0.0, 1.0)
        distance = np.linalg.norm(grid - foot - along[..., None] * axis, axis=-1)
        shares[square] = (distance < RADIUS * (1.0 + along * (scale - 1.0))).mean(axis=1)
    np.fill_diagonal(shares, 1.0)
    shares.flags.writeable = False
    return shares
