"""Silhouettes of pieces that lie, or stand anywhere, as a camera sees them; from the profile that the settings give.

A turned piece is a row of discs. Seen from anywhere, each pair of neighbours shows a convex spot; together they are
its silhouette. Poses are tried near each other, and some of them count as one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Final, NamedTuple

import cv2
import numpy as np

from hardware.piece_set import PIECE_SHAPES, Kind, piece_profile
from vision.arrays import Array, Field, Mask
from vision.board.view import BoardView

_RINGS: Final = 15
_ANGLES: Final = 2.0 * np.pi * np.arange(16) / 16
_CIRCLE: Final = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1)
"""Of a ring."""
_KNIGHT: Final = 0.75  # radius of a knight's head from wherever it is seen, in stem radii
_AROUND: Final = 0.02  # distances from a piece's surface are known up to so far from it [m] …
_CELL: Final = 0.00025  # … in steps of this [m]
_RESTS: Final = 0.92  # a foot's rim is rounded: so far from the axis does it rest, in radii of the foot
_APART: Final = 0.016, 0.7  # poses that differ by so much in place [m] or in direction [rad] are two


@dataclass(frozen=True, slots=True)
class Pose:
    """How a piece is there, board frame."""

    x: float  # of its foot's underside, the middle, seen from above [m]
    y: float  # likewise [m]
    yaw: float | None = None  # from there to the head, from the x axis, counter-clockwise [rad]; None: it stands


@lru_cache(maxsize=16)
def _profile(kind: Kind) -> Array:
    """Radius and height of the outline from the underside's rim to the axis, (n, 2) [m]; a rook's dips there."""
    profile, shape = np.array(piece_profile(kind)), PIECE_SHAPES[kind]
    if kind is Kind.KNIGHT:
        head = _KNIGHT * shape.stem_radius
        profile = np.vstack(
            [profile[:-1], [[head, profile[-1, 1]], [head, 0.94 * shape.height], [0.4 * head, shape.height]]]
        )
    return profile


@lru_cache(maxsize=16)
def _rings(kind: Kind) -> Array:
    """Radius and height of rings, closest where the outline turns, (n, 2) [m]."""
    profile = _profile(kind)
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(profile, axis=0).T))])
    at = np.linspace(0.0, length[-1], _RINGS)
    return np.stack([np.interp(at, length, profile[:, 0]), np.interp(at, length, profile[:, 1])], axis=1)


@lru_cache(maxsize=1)  # a pose's silhouette and its surface are asked for one after the other, thousands of times
def _axes(kind: Kind, pose: Pose) -> tuple[Array, Array]:
    """Middle of the underside (3,) [m] and, as rows, two directions across the axis and the axis itself, (3, 3)."""
    if pose.yaw is None:
        return np.array([pose.x, pose.y, 0.0]), np.eye(3)
    shape = PIECE_SHAPES[kind]
    radius = _RESTS * shape.foot_radius
    lean = math.atan2(radius - shape.stem_radius, shape.height - shape.stem_radius - shape.foot_height)
    cos, sin = math.cos(lean), math.sin(lean)
    x, y = math.cos(pose.yaw), math.sin(pose.yaw)  # ahead
    height = radius * cos + shape.foot_height * sin
    axes = np.array([[-y, x, 0.0], [sin * x, sin * y, cos], [cos * x, cos * y, -sin]])
    return np.array([pose.x, pose.y, height]), axes


def off_surface(points: Field, kind: Kind, pose: Pose) -> Array:
    """How far points (n, 3) of the board frame are from the surface of a piece, whether within or without, (n,) [m]."""
    start, axes = _axes(kind, pose)
    from_start = points - start
    along = from_start @ axes[2]
    return _off(kind, along, np.sqrt(np.maximum((from_start**2).sum(axis=1) - along**2, 0.0)))


def off_standing(points: Field, kind: Kind, places: Array) -> Array:
    """The same for a piece that stands at each of some places, board frame (m, 2) [m]: (m, n) [m]."""
    return _off(kind, points[:, 2], np.hypot(points[:, 0] - places[:, :1], points[:, 1] - places[:, 1:]))


def _off(kind: Kind, along: Array | Field, across: Array) -> Array:
    """How far points are from the surface, by where they are along the axis and how far from it [m]."""
    table = _distances(kind)
    row = np.clip(np.rint((along + _AROUND) / _CELL).astype(np.intp), 0, table.shape[0] - 1)
    column = np.minimum(np.rint(across / _CELL).astype(np.intp), table.shape[1] - 1)
    return np.asarray(table[row, column])


@lru_cache(maxsize=16)
def _distances(kind: Kind) -> Array:
    """How far from the surface, by cells along the axis, from ``_AROUND`` before the underside on, and off it [m]."""
    profile = np.vstack([[0.0, 0.0], _profile(kind)])  # with the underside
    high, wide = profile[:, 1].max() + 2.0 * _AROUND, profile[:, 0].max() + _AROUND
    along, across = np.meshgrid(np.arange(0.0, high, _CELL) - _AROUND, np.arange(0.0, wide, _CELL), indexing="ij")
    nearest = np.full(along.shape, np.inf)
    for (r0, z0), (r1, z1) in pairwise(profile.tolist()):
        length = (r1 - r0) ** 2 + (z1 - z0) ** 2
        if length > 0.0:
            share = np.clip(((across - r0) * (r1 - r0) + (along - z0) * (z1 - z0)) / length, 0.0, 1.0)
            off = np.hypot(across - r0 - share * (r1 - r0), along - z0 - share * (z1 - z0))
            nearest = np.minimum(nearest, off)
    return nearest


class Drawn(NamedTuple):
    """A silhouette in a part of a picture."""

    rows: slice  # of the part, around the silhouette
    columns: slice  # likewise
    mask: Mask  # of the silhouette, over those; empty where none of it is within the part
    underside: Mask  # of what the camera sees of the foot's underside, which is felt; over the same


def drawn(kind: Kind, pose: Pose, view: BoardView, shape: tuple[int, int], origin: tuple[int, int]) -> Drawn:
    """A piece's silhouette in a part of a picture of a height and width that begins at a column and row of it [px]."""
    start, axes = _axes(kind, pose)
    rings, round_ = _rings(kind), _CIRCLE @ axes[:2]
    points = start + rings[:, 1, None, None] * axes[2] + rings[:, 0, None, None] * round_
    pixels = view.project(points) - np.array(origin, dtype=float)
    flat = pixels.reshape(-1, 2)
    (first_u, first_v), (last_u, last_v) = flat.min(axis=0).tolist(), flat.max(axis=0).tolist()
    left, top = min(max(math.floor(first_u), 0), shape[1]), min(max(math.floor(first_v), 0), shape[0])
    right, bottom = min(max(math.ceil(last_u) + 1, left), shape[1]), min(max(math.ceil(last_v) + 1, top), shape[0])
    mask = np.zeros((bottom - top, right - left), dtype=np.uint8)
    underside = np.zeros_like(mask)
    if mask.size:
        local = np.rint((pixels - (left, top)) * 16.0).astype(np.int32)
        for first, second in pairwise(local):
            cv2.fillConvexPoly(mask, cv2.convexHull(np.concatenate([first, second])), 1, shift=4)
        if (view.camera_position - start) @ axes[2] < 0.0:
            cv2.fillConvexPoly(underside, local[0], 1, shift=4)
    return Drawn(slice(top, bottom), slice(left, right), mask.view(np.bool_), underside.view(np.bool_))


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
