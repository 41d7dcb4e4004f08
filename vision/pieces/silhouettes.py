"""Outlines of all expected pieces in the picture, as functions of where the pieces stand; vectorised over pieces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from hardware.table import Kind
from vision.board.view import BoardView
from vision.pieces.outline import CONTOUR_POINTS, INSIDE_POINTS, outline
from vision.pieces.surface import Surface

Array = NDArray[np.float64]

_STEP: Final = 1e-3
"""For derivatives, and to see which way a normal points in the picture [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Silhouettes:
    """Of n pieces that stand at places (n, 2) [m], in pixels of the surface's window.

    Attributes:
        contour: (n, points, 2).
        normal: outwards, unit vectors, (n, points, 2).
        inside: (n, samples, 2).
        jacobian: pixels per metre along x and y of the board, at half height, (n, 2, 2).
        distance: of the pieces from the camera, (n,) [m].
    """

    contour: Array
    normal: Array
    inside: Array
    jacobian: Array
    distance: Array


class Shapes:
    """The expected pieces' outlines, as seen about their nominal places.

    Args:
        view: of the board.
        kinds: of n pieces.
        places: nominal, (n, 2), board frame [m].
        part: window of the picture.
    """

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
        turned: Array = np.einsum("nki,nij->nkj", np.array(points).reshape(-1, count, 3), self._axes)
        return turned

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
        pixels: Array = self._view.project(points) - self._origin
        return pixels


def labels(seen: Silhouettes, shape: tuple[int, ...]) -> NDArray[np.int16]:
    """Whose silhouette is foremost at each pixel: 1 + index of a piece, 0 none."""
    drawn = np.zeros(shape, dtype=np.int16)
    for index in np.argsort(-seen.distance).tolist():
        cv2.fillPoly(drawn, [np.rint(seen.contour[index] * 8.0).astype(np.int32)], 1 + index, shift=3)
    return drawn
