"""Edges of a field across outlines: where on a short line it falls the most, to a fraction of a pixel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from vision.arrays import Array, Field, Indices, Mask, Whole

_STEP: Final = 0.5
ACROSS: Final[Field] = np.arange(-5.0, 5.0 + 1e-9, _STEP, dtype=np.float32)
"""Distances from the outline at which lines across it are sampled, outwards [px]."""
_WINDOW: Final = 4  # samples on either side of an edge that are compared
_NEARER: Final = 0.05  # of several edges on a line the nearer one: how much one px² of distance costs


@dataclass(frozen=True, slots=True, eq=False)
class Edges:
    """The picture's edges across the outlines of n pieces."""

    offset: Array  # how far outside of each contour point the edge lies, (n, points) [px]
    sure: Array  # how clear it is, 0 to 1
    open: Mask  # whether that part of the outline is in sight


def edges_on_lines(value: Field, counted: Mask) -> Edges:
    """Where on lines across outlines (n, points, samples as of ``ACROSS``) the evidence falls the most.

    ``value`` is the evidence, 0 where it does not count, ``counted`` whether it does.
    """
    middle, n = len(ACROSS) // 2, _WINDOW
    opened = counted[:, :, middle - 3 : middle + 4].all(axis=2)
    total = np.zeros((*value.shape[:2], len(ACROSS) + 1), dtype=np.float32)
    np.cumsum(value, axis=2, out=total[:, :, 1:])
    fall = (2.0 * total[:, :, n:-n] - total[:, :, : -2 * n] - total[:, :, 2 * n :]) / np.float32(n)
    place = ACROSS[0] + _STEP * (np.arange(n, len(ACROSS) - n + 1) - 0.5)
    offset, best = _peak(fall - (_NEARER * place**2).astype(np.float32), place)
    clear = np.take_along_axis(fall, best[:, :, None], axis=2)[:, :, 0]
    sure = np.clip((clear - 0.5) / 3.0, 0.0, 1.0).astype(float)
    return Edges(offset, np.where(opened, sure, 0.0), np.asarray(opened))


def slopes(one: Field) -> tuple[Field, Field]:
    """Derivatives of a field along u and v, smoothed [per px]."""
    smooth = cv2.GaussianBlur(one, (0, 0), 0.8)
    along_u = np.asarray(cv2.Sobel(smooth, cv2.CV_32F, 1, 0, scale=0.125), dtype=np.float32)
    return along_u, np.asarray(cv2.Sobel(smooth, cv2.CV_32F, 0, 1, scale=0.125), dtype=np.float32)


def along(slope: tuple[Field, Field], flat: Whole, normal: Field) -> Field:
    """Slope along normals at pixels."""
    u, v = slope
    return u.ravel().take(flat) * normal[..., 0] + v.ravel().take(flat) * normal[..., 1]


def _peak(score: Field, place: Array) -> tuple[Array, Indices]:
    """Place of the highest value along the last axis, between samples by a parabola; and the sample's number."""
    best = np.clip(score.argmax(axis=2), 1, score.shape[2] - 2)
    low, top, high = (np.take_along_axis(score, (best + i)[:, :, None], axis=2)[:, :, 0] for i in (-1, 0, 1))
    curve = low - 2.0 * top + high
    bent = curve < -1e-6
    part = np.where(bent, 0.5 * (low - high) / np.where(bent, curve, 1.0), 0.0)
    offset: Array = place[best] + _STEP * np.clip(part, -1.0, 1.0)
    return offset, best
