"""Poses that are tried for a piece: their neighbours, and which of them are one."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vision.pieces.poses import Pose

Array = NDArray[np.float64]

_APART: Final = 0.016, 0.7
"""Poses that differ by so much in place [m] or in direction [rad] are two."""


class PoseTrial(NamedTuple):
    """A pose that was tried: what speaks for it, how much of that a full silhouette has, and how much of it is seen."""

    score: float
    pose: Pose
    support: float
    seen: float


def middles(places: Array) -> list[tuple[float, float]]:
    """Of a spot: its middle; of a long one, several along it."""
    middle = places.mean(axis=0)
    off = places - middle
    long = np.linalg.svd(off[:: max(1, len(off) // 200)], full_matrices=False)[2][0]
    along = off @ long
    low, high = np.percentile(along, [5, 95]).tolist()
    parts = max(1, round((high - low) / 0.045))
    at = [low + (2 * i + 1) * (high - low) / (2 * parts) for i in range(parts)] if parts > 1 else [0.0]
    return [(float(middle[0] + t * long[0]), float(middle[1] + t * long[1])) for t in at]


def apart(trials: list[PoseTrial], most: int) -> list[PoseTrial]:
    """The best ones that differ."""
    kept = list[PoseTrial]()
    for one in sorted(trials, key=lambda one: -one.score):
        if not any(alike(one.pose, other.pose) for other in kept):
            kept.append(one)
            if len(kept) == most:
                break
    return kept


def alike(one: Pose, other: Pose) -> bool:
    """Whether two poses count as one."""
    turned = 0.0 if one.yaw is None or other.yaw is None else abs(math.remainder(one.yaw - other.yaw, 2.0 * math.pi))
    return math.dist((one.x, one.y), (other.x, other.y)) < _APART[0] and turned < _APART[1]


def moved(pose: Pose, dx: float, dy: float, turn: float) -> Pose:
    """A pose shifted [m] and turned [rad]; one that stands has no direction."""
    return Pose(pose.x + dx, pose.y + dy, None if pose.yaw is None else pose.yaw + turn)


def neighbours(pose: Pose, step: float, turn: float) -> list[Pose]:
    """Around a pose, along and across it, and turned; a lying one about its middle as well as about its base."""
    around = [moved(pose, a * step, b * step, 0.0) for a in (-1, 0, 1) for b in (-1, 0, 1) if a or b]
    if pose.yaw is not None:
        for sign in (-turn, turn):
            around.append(moved(pose, 0.0, 0.0, sign))
            half = 0.02
            dx = half * (math.cos(pose.yaw) - math.cos(pose.yaw + sign))
            dy = half * (math.sin(pose.yaw) - math.sin(pose.yaw + sign))
            around.append(moved(pose, dx, dy, sign))
    return around
