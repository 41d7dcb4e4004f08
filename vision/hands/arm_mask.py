"""Where the arm hides the table in a picture: capsules in the board frame, drawn as a mask.

A capsule is all that lies within a radius of a segment. Its picture is the convex hull of the pictures of the two
spheres at its ends, and a sphere's picture is that of the circle where lines of sight touch it. Vision knows nothing of
robots: a caller that knows where the links are says so as capsules.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from vision.arrays import Array, Indices, Mask
from vision.board.view import BoardView

NEAREST: Final = 0.05  # what is nearer to the camera's plane than this, beyond its radius, is not drawn [m]
_ROUND: Final = 16  # corners of the polygon that stands for a circle; it is drawn about it
_TURN: Final = 2.0 * math.pi * np.arange(_ROUND) / _ROUND
_OUTSIDE: Final = 1.0 / math.cos(math.pi / _ROUND)
_SHIFT: Final = 4
"""OpenCV takes corners in whole parts of a pixel: 2 ** -4."""
_FAR: Final = 1e5  # corners further away than this are drawn there [px]


@dataclass(frozen=True, slots=True, eq=False)
class Capsules:
    """Some capsules; arrays are read-only."""

    ends: Array  # of their axes, board frame, shape (n, 2, 3) [m]
    radii: Array  # shape (n,) [m]

    def __post_init__(self) -> None:
        """Keep read-only copies.

        Raises:
            ValueError: shapes do not fit, a number is not finite, or a radius is negative.
        """
        ends, radii = np.array(self.ends, dtype=float), np.array(self.radii, dtype=float)
        if ends.ndim != 3 or ends.shape[1:] != (2, 3) or radii.shape != ends.shape[:1]:
            raise ValueError(
                f"ends of shape {ends.shape} and radii of shape {radii.shape}: give (n, 2, 3) and (n,) of them"
            )
        if not (np.isfinite(ends).all() and np.isfinite(radii).all() and (radii >= 0.0).all()):
            raise ValueError("a capsule has a number that is not finite, or a negative radius: give metres")
        for name, array in (("ends", ends), ("radii", radii)):
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    def grown(self, margin: float) -> Capsules:
        """The same with every radius larger [m]."""
        return Capsules(self.ends, self.radii + margin)

    def __len__(self) -> int:
        return len(self.radii)


@dataclass(frozen=True, slots=True, eq=False)
class Hidden:
    """What is known to be before the table."""

    mask: Mask  # where it is in the picture, generously, shape (height, width)
    bodies: Capsules | None = None
    """In which all of it is. With depth, what is seen within the mask but outside of these is something else: a hand
    behind the arm's outline, or before it. None: whatever the mask covers is not looked at."""


def draw_mask(view: BoardView, capsules: Capsules, margin: float = 0.0, grow: int = 0) -> Mask:
    """Pixels (height, width) in which a capsule is seen, or would be if nothing stood before it.

    Every radius is larger by a margin [m], which is not known of where the links are, and the mask by ``grow`` [px]:
    edges that a depth camera smears.
    """
    height, width = view.intrinsics.height, view.intrinsics.width
    mask = np.zeros(
        (height + 2 * grow, width + 2 * grow), dtype=np.uint8
    )  # what lies just outside grows into the picture
    rotation, shift = view.camera_from_board[:3, :3], view.camera_from_board[:3, 3]
    ends, radii, _ = clip(capsules.ends @ rotation.T + shift, capsules.radii + margin)
    corners = _outlines(ends, radii)
    pixels = corners[..., :2] / corners[..., 2:] * (view.intrinsics.fx, view.intrinsics.fy)
    pixels = (pixels + np.array([view.intrinsics.cx + grow, view.intrinsics.cy + grow])).clip(-_FAR, _FAR)
    fixed = np.rint(pixels * (1 << _SHIFT)).astype(np.int32)
    for outline in fixed:
        cv2.fillConvexPoly(mask, cv2.convexHull(outline), 1, shift=_SHIFT)
    if grow > 0:
        mask = np.asarray(cv2.dilate(mask, np.ones((2 * grow + 1, 2 * grow + 1), np.uint8)), dtype=np.uint8)
    return mask[grow : grow + height, grow : grow + width].astype(np.bool_)


def clip(ends: Array, radii: Array) -> tuple[Array, Array, Indices]:
    """The parts of axes (n, 2, 3), camera frame [m], that are far enough before the camera for all of their capsule to
    have a picture: ends (m, 2, 3), radii (m,), and which of the capsules these are (m,).
    """
    limit = radii + NEAREST
    depth = ends[..., 2]
    kept = np.flatnonzero(depth.max(axis=1, initial=-math.inf) > limit)
    ends, depth, limit = ends[kept].copy(), depth[kept], limit[kept]
    for one in (0, 1):
        other = 1 - one
        behind = depth[:, one] < limit
        share = (limit - depth[:, one])[behind] / (depth[:, other] - depth[:, one])[behind]
        ends[behind, one] += share[:, None] * (ends[behind, other] - ends[behind, one])
    return ends, radii[kept], kept


def _outlines(ends: Array, radii: Array) -> Array:
    """Points about both spheres' outlines of each capsule, camera frame: (n, 2, 3) and (n,) to (n, 32, 3)."""
    distance = np.linalg.norm(ends, axis=2, keepdims=True)
    sight = ends / distance
    aside = np.cross(sight, np.where(np.abs(sight[..., :1]) < 0.7, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
    aside /= np.linalg.norm(aside, axis=2, keepdims=True)
    upright = np.cross(sight, aside)
    square = (radii[:, None, None] / distance) ** 2
    centre, radius = ends * (1.0 - square), radii[:, None, None] * np.sqrt(1.0 - square) * _OUTSIDE
    circle = np.cos(_TURN)[:, None] * aside[..., None, :] + np.sin(_TURN)[:, None] * upright[..., None, :]
    points: Array = centre[..., None, :] + radius[..., None] * circle
    return points.reshape(len(ends), 2 * _ROUND, 3)
