"""Saddle points of a picture: where two edges cross and light changes to dark four times around, as between squares.

A saddle is found where the determinant of the Hessian of the blurred picture is negative and extreme, and is kept where
the ring around it looks alike from opposite sides (Bennett and Lasenby, "ChESS", 2014; Geiger et al., "Automatic camera
and range sensor calibration", 2012). Edges of pieces, letters and grain make saddles too: what tells the board's from
those is how they lie to each other (``vision.board.lattice``).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from vision.arrays import Array, Field, Indices, Picture

BLUR: Final = 1.3  # width of the Gaussian before the second derivatives [px]
RINGS: Final = (3.0, 4.5)
"""Radii of the rings that are looked at [px]: wider than the blur, narrower than half of the smallest square."""
SAMPLES: Final = 32  # points of a ring; a multiple of four
LEAST_SYMMETRY: Final = 0.55
"""Share of a ring's variance that is alike from opposite sides, less the share that is not: 1 for a clean saddle."""
MOST_SKEW: Final = 1.1
"""Skewness of a ring's values: 0 with light and dark in equal parts, 1.15 at a crossing of 45°, more at a thin line."""
LEAST_CONTRAST: Final = 4.0  # amplitude around the ring below which there is only noise [grey levels of ``levels``]


@dataclass(frozen=True, slots=True, eq=False)
class Saddles:
    """Saddle points of a picture, best first."""

    points: Array  # where, shape (n, 2) [px]
    bright: Array  # direction in which the brighter sectors lie, modulo half a turn, shape (n,) [rad]
    edges: Array  # directions of the two edges that cross, modulo half a turn, shape (n, 2) [rad]
    quality: Array  # symmetry of the ring times the logarithm of its contrast, shape (n,)

    def __len__(self) -> int:
        return len(self.points)


def levels(colour: Picture) -> Field:
    """Channels (h, w, 3) in steps of equal ratio, 0 to 255: squares have the same contrast in light and in shadow."""
    table = 255.0 * np.log1p(np.arange(256) / 20.0) / np.log1p(255.0 / 20.0)
    return np.asarray(cv2.LUT(colour, table.astype(np.float32)), dtype=np.float32)


def find_saddles(picture: Field, most: int) -> Saddles:
    """At most so many saddle points of ``levels`` (h, w, channels), each by the channel that shows it best."""
    blurred: Field = np.asarray(cv2.GaussianBlur(picture, (0, 0), BLUR), dtype=np.float32)
    xx, yy, xy = (_derivative(blurred, *orders) for orders in ((2, 0), (0, 2), (1, 1)))
    response = xy * xy - xx * yy
    channel = response.argmax(axis=2)
    strongest = response.max(axis=2)
    peaks = (strongest >= cv2.dilate(strongest, np.ones((5, 5)))) & (strongest > 1.0)
    border = int(np.ceil(max(RINGS))) + 1
    peaks[:border], peaks[-border:], peaks[:, :border], peaks[:, -border:] = False, False, False, False
    v, u = np.nonzero(peaks)
    ranked = np.argsort(-strongest[v, u])[: 6 * most]
    v, u = v[ranked], u[ranked]
    c = channel[v, u]
    points = np.stack([u, v], axis=1) + _peak_offset(strongest, u, v)
    symmetry, contrast, bright = _rings(blurred, points, c)
    good = (symmetry > LEAST_SYMMETRY) & (contrast > LEAST_CONTRAST)
    edges = _edge_directions(xx[v, u, c], xy[v, u, c], yy[v, u, c])
    quality = symmetry * np.log(np.maximum(contrast, 1.0))
    kept = np.nonzero(good)[0]
    kept = kept[np.argsort(-quality[kept])][:most]
    return Saddles(points[kept], bright[kept], edges[kept], quality[kept])


def _derivative(picture: Field, across: int, down: int) -> Field:
    kernels = {
        0: np.array([1.0, 2.0, 1.0]) / 4.0, 1: np.array([-1.0, 0.0, 1.0]) / 2.0, 2: np.array([1.0, -2.0, 1.0])
    }  # fmt: skip
    return np.asarray(cv2.sepFilter2D(picture, cv2.CV_32F, kernels[across], kernels[down]), dtype=np.float32)


def _peak_offset(response: Field, u: Indices, v: Indices) -> Array:
    """Where the parabola through a peak and its neighbours is highest, along each axis, shape (n, 2) [px]."""
    offsets = []
    for du, dv in ((1, 0), (0, 1)):
        before, here, after = (response[v + k * dv, u + k * du].astype(float) for k in (-1, 0, 1))
        bend = np.maximum(2.0 * here - before - after, 1e-9)
        offsets.append(np.clip(0.5 * (after - before) / bend, -0.5, 0.5))
    return np.stack(offsets, axis=1)


def _rings(picture: Field, points: Array, channel: Indices) -> tuple[Array, Array, Array]:
    """Symmetry, contrast [levels] and direction of the brighter sectors [rad] around points, each shape (n,)."""
    angles = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    wave = np.exp(-2j * angles)
    symmetry, contrast, phase = np.ones(len(points)), np.full(len(points), np.inf), np.zeros(len(points), complex)
    for radius in RINGS:
        places = (points[:, None, :] + radius * circle).astype(np.float32)
        values = np.zeros((len(points), SAMPLES))
        for index in range(picture.shape[2]):
            chosen = channel == index
            if chosen.any():
                plane = np.ascontiguousarray(picture[:, :, index])
                values[chosen] = cv2.remap(plane, places[chosen], None, cv2.INTER_LINEAR)  # type: ignore[call-overload]
        values -= values.mean(axis=1, keepdims=True)
        opposite = np.roll(values, SAMPLES // 2, axis=1)
        power = np.maximum((values**2).mean(axis=1), 1e-9)
        symmetry = np.minimum(symmetry, (values * opposite).mean(axis=1) / power)
        second = (values * wave).mean(axis=1) * 2.0
        symmetry = np.where(np.abs(second) ** 2 / 2.0 < 0.45 * power, -1.0, symmetry)
        lopsided = np.abs((values**3).mean(axis=1)) > MOST_SKEW * power**1.5
        symmetry = np.where(lopsided, -1.0, symmetry)
        contrast = np.minimum(contrast, np.abs(second))
        phase += second
    return symmetry, contrast, -0.5 * np.angle(phase)


def _edge_directions(xx: Field, xy: Field, yy: Field) -> Array:
    """Directions in which a quadratic form vanishes, shape (n, 2) [rad]: there the blurred picture stays level."""
    half = 0.5 * (xx.astype(float) - yy)
    middle = 0.5 * (xx.astype(float) + yy)
    size = np.maximum(np.hypot(half, xy), 1e-9)
    axis = 0.5 * np.arctan2(xy, half)
    # along an angle a the form is middle + size·cos(2(a − axis))
    spread = 0.5 * np.arccos(np.clip(-middle / size, -1.0, 1.0))
    return np.stack([axis + spread, axis - spread], axis=1)
