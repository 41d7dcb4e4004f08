"""Outlines of standing pieces from an elevation, by the profile that the table settings give; and in the picture.

Frame ``aside``: origin at the centre of the foot's underside; right as the camera sees it, away from the camera along
the board, up [m].
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from hardware.piece_set import PIECE_SHAPES, Kind, piece_profile
from vision.arrays import Array, Mask, Picture
from vision.board.view import BoardView
from vision.pieces.surface import Surface

CONTOUR_POINTS: Final = 56  # of each outline
INSIDE_POINTS: Final = 48  # of each silhouette
STEP_DEG: Final = 4.0  # outlines are made for elevations so far apart [°]
HEAD_WEIGHT: Final = 0.1  # of a knight's outline above its turned part: its head looks different from all sides
_HEAD_RADIUS: Final = 0.75  # of a knight's head seen from anywhere, in stem radii
_SCALE: Final = 6000.0  # of the drawing in which outlines are found [px/m]
_RING_STEP: Final = 0.0005  # between rings of the drawing [m]
_RING_POINTS: Final = 40
_STEP: Final = 1e-3
"""For derivatives, and to see which way a normal points in the picture [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """Outline and silhouette of one kind from one elevation; points (n, 3) in ``aside`` [m]."""

    contour: Array  # ``CONTOUR_POINTS`` on the surface, evenly along the outline
    normal: Array  # outward normals of the outline at those, across the view; unit vectors
    weight: Array  # how far each of them can be trusted, 0 to 1
    inside: Array  # ``INSIDE_POINTS`` spread over the silhouette


def outline(kind: Kind, elevation: float) -> Outline:
    """Of a piece that the camera sees from this elevation above the board [rad]."""
    return _outline(kind, round(math.degrees(elevation) / STEP_DEG))


@lru_cache(maxsize=512)
def _outline(kind: Kind, step: int) -> Outline:
    elevation = math.radians(step * STEP_DEG)
    sin, cos = math.sin(elevation), math.cos(elevation)
    points = _surface(kind)
    across = np.column_stack([points[:, 0], points[:, 2] * cos + points[:, 1] * sin])  # right and up, as seen
    origin = across.min(axis=0) - 4.0 / _SCALE
    mask = _drawn(across, origin)
    chain = max(cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0], key=len)[:, 0].astype(float)
    chain, normal = _evenly(chain)
    place = chain / _SCALE + origin
    nearest = np.array([int(((across - one) ** 2).sum(axis=1).argmin()) for one in place])
    rim = points[nearest]
    # the chain is exact across the view; the surface point gives how far away it is
    seen = across[nearest]
    contour = rim + _aside(place - seen, sin, cos)
    turned = contour[:, 2] <= piece_profile(kind)[-1][1] + 1e-3
    weight = np.where(turned, 1.0, HEAD_WEIGHT)
    inside = _spread(mask) / _SCALE + origin
    return Outline(contour, _aside(normal, sin, cos), weight, _aside(inside, sin, cos))


def _aside(across: Array, sin: float, cos: float) -> Array:
    """Vectors across the view (right, up as seen) in ``aside``, shape (n, 3)."""
    return np.column_stack([across[:, 0], across[:, 1] * sin, across[:, 1] * cos])


def _surface(kind: Kind) -> Array:
    """Points on the surface, ring by ring, shape (rings × ``_RING_POINTS``, 3)."""
    profile = np.array(piece_profile(kind))
    if kind is Kind.KNIGHT:
        shape = PIECE_SHAPES[kind]
        head = _HEAD_RADIUS * shape.stem_radius
        profile = np.vstack([profile[:-1], [[head, profile[-1, 1]], [head, 0.94 * shape.height], [0.0, shape.height]]])
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(profile, axis=0).T))])
    along = np.linspace(0.0, length[-1], math.ceil(length[-1] / _RING_STEP))
    radius, height = np.interp(along, length, profile[:, 0]), np.interp(along, length, profile[:, 1])
    angle = 2.0 * np.pi * np.arange(_RING_POINTS) / _RING_POINTS
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    plane = radius[:, None, None] * ring
    return np.concatenate([plane, np.broadcast_to(height[:, None, None], (*plane.shape[:2], 1))], axis=2).reshape(-1, 3)


def _drawn(across: Array, origin: Array) -> Picture:
    """Rings filled one over the other: the silhouette."""
    pixels = np.rint((across - origin) * _SCALE).astype(np.int32)
    width, height = (pixels.max(axis=0) + 5).tolist()
    mask = np.zeros((height, width), dtype=np.uint8)
    for ring in pixels.reshape(-1, _RING_POINTS, 2):
        cv2.fillConvexPoly(mask, np.ascontiguousarray(ring), 1)
    return mask


def _evenly(chain: Array) -> tuple[Array, Array]:
    """Points evenly along a closed chain, and the outward normals there, each (``CONTOUR_POINTS``, 2)."""
    kernel = cv2.getGaussianKernel(25, 4.0)[:, 0]
    smooth = np.column_stack([np.convolve(np.r_[c[-12:], c, c[:12]], kernel, "valid") for c in chain.T])
    tangent = np.roll(smooth, -3, axis=0) - np.roll(smooth, 3, axis=0)
    normal = np.column_stack([tangent[:, 1], -tangent[:, 0]])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    area = 0.5 * float(np.sum(smooth[:, 0] * np.roll(smooth[:, 1], -1) - smooth[:, 1] * np.roll(smooth[:, 0], -1)))
    length = np.cumsum(np.linalg.norm(np.diff(smooth, axis=0, append=smooth[:1]), axis=1))
    take = np.searchsorted(length, (np.arange(CONTOUR_POINTS) + 0.5) / CONTOUR_POINTS * length[-1])
    return smooth[take], normal[take] * (1.0 if area > 0.0 else -1.0)


def _spread(mask: Picture) -> Array:
    """``INSIDE_POINTS`` points spread evenly over a silhouette, (n, 2) in pixels of the drawing."""
    inner = cv2.erode(mask, np.ones((7, 7), dtype=np.uint8))
    rows, columns = np.nonzero(inner)
    take = np.linspace(0, len(rows) - 1, INSIDE_POINTS).astype(int)
    # along the rows they come in order of height, so that equal steps are an even spread; columns alternate by chance
    order = np.lexsort((np.random.default_rng(7).random(len(rows)), rows))
    picked = order[take]
    return np.column_stack([columns[picked], rows[picked]]).astype(float)


@dataclass(frozen=True, slots=True, eq=False)
class Silhouettes:
    """Of n pieces that stand at places (n, 2) [m], in pixels of the surface's window."""

    contour: Array  # (n, points, 2)
    normal: Array  # outwards, unit vectors, (n, points, 2)
    inside: Array  # (n, samples, 2)
    jacobian: Array  # pixels per metre along x and y of the board, at half height, (n, 2, 2)
    distance: Array  # of the pieces from the camera, (n,) [m]


class Shapes:
    """Outlines of n expected pieces about their nominal places (n, 2), board frame [m], in a window of the picture."""

    def __init__(self, view: BoardView, kinds: list[Kind], places: Array, part: Surface) -> None:
        self._view = view
        self._origin = np.array([part.columns.start, part.rows.start], dtype=float)
        eye = view.camera_position
        away = places - eye[:2]
        reach = np.linalg.norm(away, axis=1)
        elevations = np.arctan2(eye[2], reach)
        outlines = [outline(kind, float(angle)) for kind, angle in zip(kinds, elevations, strict=True)]
        forward = away / np.maximum(reach, 1e-9)[:, None]
        self._axes = np.zeros((len(kinds), 3, 3))  # right, forward and up of each, as rows
        self._axes[:, 0, 0], self._axes[:, 0, 1] = forward[:, 1], -forward[:, 0]
        self._axes[:, 1, :2], self._axes[:, 2, 2] = forward, 1.0
        self._contour = self._turned([one.contour for one in outlines], CONTOUR_POINTS)
        self._outer = self._turned([one.contour + _STEP * one.normal for one in outlines], CONTOUR_POINTS)
        self._inside = self._turned([one.inside for one in outlines], INSIDE_POINTS)
        self.weight = np.array([one.weight for one in outlines]).reshape(-1, CONTOUR_POINTS)

    def _turned(self, points: list[Array], count: int) -> Array:
        return np.asarray(np.einsum("nki,nij->nkj", np.array(points).reshape(-1, count, 3), self._axes))

    def at(self, places: Array) -> Silhouettes:
        """Where outlines are when the pieces stand at these places, (n, 2) [m]."""
        foot = np.zeros((len(places), 1, 3))
        foot[:, 0, :2] = places
        contour = self._pixels(self._contour + foot)
        normal = self._pixels(self._outer + foot) - contour
        normal /= np.linalg.norm(normal, axis=2, keepdims=True)
        middle = foot + self._inside.mean(axis=1, keepdims=True)
        steps = self._pixels(middle + np.array([[0.0, 0, 0], [_STEP, 0, 0], [0, _STEP, 0]]))
        jacobian = np.stack([steps[:, 1] - steps[:, 0], steps[:, 2] - steps[:, 0]], axis=2) / _STEP
        distance = self._view.depth(foot[:, 0])
        return Silhouettes(contour, normal, self._pixels(self._inside + foot), jacobian, distance)

    def _pixels(self, points: Array) -> Array:
        return np.asarray(self._view.project(points) - self._origin)


def labels(seen: Silhouettes, shape: tuple[int, ...], these: Mask | None = None) -> NDArray[np.int16]:
    """Whose silhouette is foremost at each pixel: 1 + index of a piece, 0 none; of ``these`` (n,) alone."""
    drawn = np.zeros(shape, dtype=np.int16)
    for index in np.argsort(-seen.distance).tolist():
        if these is None or these[index]:
            cv2.fillPoly(drawn, [np.rint(seen.contour[index] * 8.0).astype(np.int32)], 1 + index, shift=3)
    return drawn
