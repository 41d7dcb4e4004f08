"""Where the tool goes: straight lines, corners blended with clothoids, as a function of the way along the path.

A corner is a pair of equal clothoids in the plane of its two lines: curvature grows linearly along the way to the
middle of the corner and falls again, so it is continuous everywhere, and the tool's acceleration can be.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import fresnel

Vector = NDArray[np.float64]

STRAIGHT: Final = 1e-6
"""Lines that turn by less are one line [rad]."""


class Derivatives(NamedTuple):
    """Of the path by the way along it, (n, 3) each: unit tangent, curvature vector [1/m] and its rate [1/m²]."""

    first: Vector
    second: Vector
    third: Vector


@dataclass(frozen=True, slots=True)
class Path:
    """Pieces one after the other; each is a line or one half of a corner. All arrays have one row a piece.

    Attributes:
        flat: the end at which a half of a corner meets its line; of a line its start, (n, 3) [m].
        tangent: direction of travel there, (n, 3).
        normal: towards the inside of the corner there, (n, 3); zero for a line.
        sharpness: how fast curvature changes along the way, (n,) [1/m²]; 0 for a line.
        sign: +1 where a piece starts at ``flat``, -1 where it ends there, (n,).
        length: (n,) [m].
        line: which line of the polygon it belongs to, (n,); halves of a corner belong to the line they touch.
    """

    flat: Vector
    tangent: Vector
    normal: Vector
    sharpness: Vector
    sign: Vector
    length: Vector
    line: NDArray[np.int64]

    @property
    def ends(self) -> Vector:
        """Way from the start to the end of each piece, (n,) [m]."""
        return np.cumsum(self.length)

    @property
    def begins(self) -> Vector:
        """Way from the start to the begin of each piece, (n,) [m]."""
        return np.concatenate([[0.0], np.cumsum(self.length)[:-1]])

    @property
    def table(self) -> Vector:
        """All of each piece for compiled code: tangent, normal, sharpness, sign, length, begin, flat end, (n, 13)."""
        return np.column_stack(
            [self.tangent, self.normal, self.sharpness, self.sign, self.length, self.begins, self.flat]
        )

    @property
    def total(self) -> float:
        """Whole way [m]."""
        return float(self.length.sum())

    def piece_at(self, way: Vector) -> NDArray[np.int64]:
        """Which piece each way along the path lies on; the earlier one where two meet."""
        return np.minimum(np.searchsorted(self.ends, way - 1e-12), len(self.length) - 1)

    def position(self, way: Vector) -> Vector:
        """Points (n, 3) at ways (n,) along the path [m]."""
        piece = self.piece_at(way)
        sigma = self._from_flat(way, piece)
        sharpness = self.sharpness[piece]
        x, y = np.array(sigma), np.zeros_like(sigma)
        bent = sharpness > 0.0
        x[bent], y[bent] = clothoid(sharpness[bent], sigma[bent])
        along = (self.sign[piece] * x)[:, None] * self.tangent[piece]
        points: Vector = self.flat[piece] + along + y[:, None] * self.normal[piece]
        return points

    def derivatives(self, way: Vector, piece: NDArray[np.int64]) -> Derivatives:
        """At ways (n,) along the path; which piece each belongs to decides where two meet."""
        sigma = self._from_flat(way, piece)
        sharpness, sign = self.sharpness[piece], self.sign[piece]
        heading = 0.5 * sharpness * sigma * sigma
        cos, sin = np.cos(heading)[:, None], np.sin(heading)[:, None] * sign[:, None]
        tangent, normal = self.tangent[piece], self.normal[piece]
        t = cos * tangent + sin * normal
        n = cos * normal - sin * tangent
        curvature = (sharpness * sigma)[:, None]
        rate = (sharpness * sign)[:, None]
        return Derivatives(t, curvature * n, rate * n - curvature * curvature * t)

    def _from_flat(self, way: Vector, piece: NDArray[np.int64]) -> Vector:
        on = np.clip(way - self.begins[piece], 0.0, self.length[piece])
        return np.where(self.sign[piece] > 0.0, on, self.length[piece] - on)


def clothoid(sharpness: Vector, way: Vector) -> tuple[Vector, Vector]:
    """Point of a clothoid that starts straight along x and bends towards y, after a way from its start [m]."""
    scale = np.sqrt(np.pi / sharpness)
    sine, cosine = fresnel(way / scale)
    return scale * cosine, scale * sine


class CornerShape(NamedTuple):
    """Of a corner whose clothoids are each 1 m long: where it begins before the corner's point, and how far its middle
    stays off that point [m]. Both scale with the clothoids' length.
    """

    tangent: float
    deviation: float


def corner_shape(turn: float) -> CornerShape:
    """For a turn between two lines [rad]."""
    x, y = clothoid(np.array([turn]), np.array([1.0]))
    half = 0.5 * turn
    return CornerShape(float(x[0] + y[0] * np.tan(half)), float(y[0] / np.cos(half)))


def corner_points(turn: float, count: int = 13) -> tuple[Vector, Vector]:
    """A corner with tangents of length 1, by the ways along the line before it (negative) and along the one after it,
    from the point where they meet: (2 count - 1,) each.
    """
    x, y = clothoid(np.full(count, turn), np.linspace(0.0, 1.0, count))
    scale = 1.0 / corner_shape(turn).tangent
    onwards = scale * y / math.sin(turn)
    before = scale * x - 1.0 - onwards * math.cos(turn)
    # the second half is the first one mirrored
    return np.concatenate([before, -onwards[-2::-1]]), np.concatenate([onwards, -before[-2::-1]])


def turns(points: Vector) -> Vector:
    """How far a polygon (n, 3) turns at each of its inner points, (n - 2,) [rad]."""
    found = []
    ways = [[b - a for a, b in zip(*pair, strict=True)] for pair in pairwise(points.tolist())]
    for (ax, ay, az), (bx, by, bz) in pairwise(ways):  # a few points: quicker than arrays
        across = math.hypot(ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)
        found.append(math.atan2(across, ax * bx + ay * by + az * bz))
    return np.array(found)


def blend(points: Vector, tangents: Vector) -> Path:
    """A path along a polygon with blended corners.

    Args:
        points: corners of the polygon, (n, 3) [m]; no two that follow each other coincide.
        tangents: how far before each inner point its corner begins, (n - 2,) [m]; unused where the polygon hardly
            turns. On each line there must be room for both of its ends.

    Raises:
        ValueError: two corners overlap, or one that turns has no room.
    """
    ways = np.diff(points, axis=0)
    lengths = np.linalg.norm(ways, axis=1)
    ways = ways / lengths[:, None]
    turn = turns(points)
    reach = np.concatenate([[0.0], np.where(turn > STRAIGHT, tangents, 0.0), [0.0]])
    left = lengths - reach[:-1] - reach[1:]
    if (left < -1e-9).any() or ((turn > STRAIGHT) & (reach[1:-1] <= 0.0)).any():
        raise ValueError(f"corners of {reach[1:-1]} m do not fit on lines of {lengths} m")
    rows: list[tuple[Vector, Vector, Vector, float, float, float, int]] = []
    zero = np.zeros(3)
    for k, way in enumerate(ways):
        if left[k] > 1e-9:
            rows.append((points[k] + reach[k] * way, way, zero, 0.0, 1.0, float(left[k]), k))
        if k < len(turn) and turn[k] > STRAIGHT:
            corner, onwards = points[k + 1], ways[k + 1]
            length = float(reach[k + 1]) / corner_shape(float(turn[k])).tangent
            sharpness = float(turn[k]) / length**2
            aside, back = onwards - (onwards @ way) * way, -way + (onwards @ way) * onwards
            entry, leave = corner - reach[k + 1] * way, corner + reach[k + 1] * onwards
            rows.append((entry, way, aside / np.linalg.norm(aside), sharpness, 1.0, length, k))
            rows.append((leave, onwards, back / np.linalg.norm(back), sharpness, -1.0, length, k + 1))
    flat, tangent, normal, sharpness_, sign, length_, line = (np.array(column) for column in zip(*rows, strict=True))
    return Path(flat, tangent, normal, sharpness_, sign, length_, line)
