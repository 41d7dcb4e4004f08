"""Where the tool goes: straight lines, corners blended with clothoids, as a function of the way along the path.

A corner is a pair of equal clothoids in the plane of its two lines: curvature grows linearly along the way to the
middle of the corner and falls again, so it is continuous everywhere, and the tool's acceleration can be.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.motion.curves import STRAIGHT, pieces, turns

__all__ = ["STRAIGHT", "Path", "Vector", "blend", "turns"]

Vector = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Path:
    """Pieces one after the other; each is a line or one half of a corner."""

    table: Vector
    """Of each piece tangent, normal, sharpness, sign, length, begin, flat end, line, (n, 14)."""

    @property
    def tangent(self) -> Vector:
        """Direction of travel at the flat end of each piece, (n, 3)."""
        return self.table[:, 0:3]

    @property
    def normal(self) -> Vector:
        """Towards the inside of the corner there, (n, 3); zero for a line."""
        return self.table[:, 3:6]

    @property
    def sharpness(self) -> Vector:
        """How fast curvature changes along the way, (n,) [1/m²]; 0 for a line."""
        return self.table[:, 6]

    @property
    def sign(self) -> Vector:
        """+1 where a piece starts at its flat end, -1 where it ends there, (n,)."""
        return self.table[:, 7]

    @property
    def length(self) -> Vector:
        """Of each piece, (n,) [m]."""
        return self.table[:, 8]

    @property
    def begins(self) -> Vector:
        """Waypoints from the start to the begin of each piece, (n,) [m]."""
        return self.table[:, 9]

    @property
    def flat(self) -> Vector:
        """The end at which a half of a corner meets its line; of a line its start, (n, 3) [m]."""
        return self.table[:, 10:13]

    @property
    def line(self) -> NDArray[np.int64]:
        """Which line of the polygon it belongs to, (n,); halves of a corner belong to the line they touch."""
        return self.table[:, 13].astype(np.int64)

    @property
    def ends(self) -> Vector:
        """Waypoints from the start to the end of each piece, (n,) [m]."""
        return self.begins + self.length

    @property
    def total(self) -> float:
        """Whole way [m]."""
        return float(self.table[-1, 8] + self.table[-1, 9])

    @property
    def end(self) -> Vector:
        """Where it ends, (3,) [m]."""
        last: Vector = self.flat[-1] + (self.length[-1] * self.tangent[-1] if self.sign[-1] > 0.0 else 0.0)
        return last

    def piece_at(self, way: Vector) -> NDArray[np.int64]:
        """Which piece each way along the path lies on; the earlier one where two meet."""
        return np.minimum(np.searchsorted(self.ends, way - 1e-12), len(self.length) - 1)


def blend(points: Vector, tangents: Vector) -> Path:
    """A path along a polygon (n, 3) [m] with blended corners; no two points that follow each other coincide.

    ``tangents`` say how far before each inner point its corner begins, (n - 2,) [m]; they are unused where the polygon
    hardly turns. On each line there must be room for both of its ends. Raises ``ValueError`` if two corners overlap, or
    one that turns has no room.
    """
    table = pieces(np.ascontiguousarray(points, dtype=float), np.asarray(tangents, dtype=float))
    if not len(table):
        raise ValueError(f"corners of {tangents} m do not fit on lines between {points.tolist()}")
    return Path(table)
