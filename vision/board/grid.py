"""Where the lines of a board cross in a picture: a homography and one term of radial distortion, fitted robustly.

Places count squares: the board's corner a1 is (0, 0), h1 (8, 0), h8 (8, 8); crossings are at whole numbers. The lens
bends a point at distance r from the picture's centre, in half diagonals, to r (1 + k r² / (1 + 4 r²)): as k r² near the
centre, and levelling off outside, since what a lens does there cannot be told from the middle of a board.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from vision.arrays import Array
from vision.board.lattice import fit_homography, project, steps

LEVEL: Final = 4.0  # how early the bending levels off [1/half diagonal²]
PRIOR_BENDING: Final = 0.05  # what k is about if crossings do not tell: cameras without fisheye lenses stay below 0.1
CORNERS: Final = np.array([[0.0, 0.0], [8.0, 0.0], [8.0, 8.0], [0.0, 8.0]])
"""Places of the outer corners a1, h1, h8, a8, shape (4, 2)."""


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """A board's lines in a picture."""

    homography: Array  # from places to pixels of a picture without distortion, shape (3, 3)
    bending: float  # k of the lens
    size: tuple[int, int]  # width and height of the picture [px]

    def project(self, places: Array) -> Array:
        """Pixels of places (..., 2); not a number for those behind the camera."""
        return bend(project(self.homography, places), self.bending, self.size)

    def sides(self, places: Array) -> Array:
        """Length of the shorter side of a square at places (n, 2), shape (n,) [px]."""
        return np.asarray(np.linalg.norm(steps(self.homography, places), axis=2).min(axis=1))

    def scaled(self, factor: float, size: tuple[int, int]) -> Grid:
        """The same lines in a picture of another size; pixels are at whole numbers in both."""
        shift = 0.5 * factor - 0.5
        matrix = np.array([[factor, 0.0, shift], [0.0, factor, shift], [0.0, 0.0, 1.0]])
        return Grid(matrix @ self.homography, self.bending, size)

    def moved(self, matrix: Array) -> Grid:
        """The same lines, places counted differently: ``matrix`` (3, 3) takes new places to old ones."""
        return Grid(self.homography @ matrix, self.bending, self.size)


def bend(points: Array, bending: float, size: tuple[int, int]) -> Array:
    """What the lens makes of pixels (..., 2) of a picture without distortion."""
    centre = 0.5 * (np.array(size, dtype=float) - 1.0)
    offset = (points - centre) / np.linalg.norm(centre)
    squared = (offset**2).sum(axis=-1, keepdims=True)
    return np.asarray(centre + (points - centre) * (1.0 + bending * squared / (1.0 + LEVEL * squared)))


def fit_grid(
    places: Array, points: Array, size: tuple[int, int], scatter: float = 0.02, weights: Array | None = None
) -> Grid:
    """Grid through crossings, of which some may be no crossings of this board, in a picture of a width and height [px].

    ``places`` (n, 2), at least four, were found at ``points`` (n, 2) [px]; good ones are expected off by a ``scatter``
    [sides of a square]; ``weights`` are along columns and along rows, (n, 2), 1 if None.
    """
    from scipy.optimize import least_squares  # takes half a second to load, and most games know their board

    weight = np.ones(places.shape) if weights is None else weights
    centre = places.mean(axis=0)
    local = places - centre
    start = fit_homography(local, points, weight.min(axis=1))
    start = start / start[2, 2]
    side = np.linalg.norm(steps(start, local), axis=2).min(axis=1)
    inward = np.linalg.inv(np.swapaxes(steps(start, local), 1, 2))
    unit = np.append(np.tile([1.0, 1.0, 1.0], 2) * side.mean(), [0.01, 0.01, PRIOR_BENDING])

    def grid_of(parameters: Array) -> Grid:
        scaled = parameters * unit
        return Grid(np.append(scaled[:8], 1.0).reshape(3, 3), float(scaled[8]), size)

    def residuals(parameters: Array) -> Array:
        off = np.einsum("nij,nj->ni", inward, grid_of(parameters).project(local) - points) * weight
        return np.append(np.nan_to_num(off, nan=1.0).ravel(), scatter * parameters[8])

    first = np.append(start.ravel()[:8], 0.0) / unit
    result = least_squares(residuals, first, loss="soft_l1", f_scale=2.0 * scatter, max_nfev=30)
    back = np.array([[1.0, 0.0, -centre[0]], [0.0, 1.0, -centre[1]], [0.0, 0.0, 1.0]])
    return grid_of(result.x).moved(back)
