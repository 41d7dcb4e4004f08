"""A board's corners from all crossings and all sides of its squares together, and how far off they may be.

The model is a plane through a pinhole (eight numbers), a lens that bends (one), a board that is not quite flat (a
smooth field of second and third order), and light that creeps over the edges of dark squares (one). The last three are
held near zero by what is known of lenses and boards; a fit by weighted least squares leaves out what pieces hide. All
is linear in the places of a first grid, so that the covariance of the corners comes with it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from vision.arrays import Array
from vision.board.alternation import Look
from vision.board.crossings import find_crossings
from vision.board.grid import CORNERS, Grid
from vision.board.lattice import fit_homography, project
from vision.board.side_edges import SideEdges, measure_edges

PLANE, LENS, BOW = slice(0, 8), slice(8, 9), slice(9, 23)  # where the parameters of each part are; last: the light's
LOOSE: Final = 1.0  # how far the plane may be from the first grid's, one sigma [sides of a square]
PRIOR_LENS: Final = 0.02
"""What a lens bends by, one sigma: as ``Grid.bending``. Cameras of phones and of rigs correct their pictures."""
PRIOR_BOW: Final = 0.02  # size of each term of a board's bow, one sigma [sides of a square]
PRIOR_CREEP: Final = 0.05  # how far light creeps, one sigma [sides of a square]
EDGE_WEIGHT: Final = 0.7  # what one end of a side counts, a crossing being 1
LEAST_SCATTER: Final = 0.008  # no crossing is seen better than this, one sigma [sides of a square]
ALIKE: Final = 16.0  # so many neighbouring measurements err in the same way: board or light are not as in the model
ROUNDS: Final = 12
FIRST_SCATTER: Final = 0.04  # of a bent board's crossings about a plane, in the first round [sides of a square]
LEAST_CROSSINGS: Final = 12  # of those within the board; fewer are chance
TRUST: Final = 1.6
"""Error that is exceeded by one board in twenty, by what the fit believes: counted on drawn boards of known corners."""
PIXELS: Final = 1.2
"""How well a corner is known by eye in a picture, which is what it is compared with: sharpening and compression shift
the edges of a border, and people who mark them agree no better [px]."""
LEAST_ERROR: Final = 0.01  # no corner is claimed to be better than this [sides of a square]: boards are made no better


@dataclass(frozen=True, slots=True, eq=False)
class JointFit:
    """Corners of a board in a picture."""

    corners: Array  # in the order of ``CORNERS``, shape (4, 2) [px]
    sigma: Array  # of each corner, by the covariance of the fit, shape (4,) [sides of a square]
    halves: Array
    """How far each corner moves when a quarter of the board is left out, jackknife deviation, shape (4,) [sides of a
    square]."""
    sides: Array  # shorter side of the square at each corner, shape (4,) [px]

    def error(self, factor: float = 1.0) -> float:
        """What the worst corner's error stays below for nineteen boards of twenty [sides of a square].

        ``factor`` is that by which the picture was resized for the fit: no pixels were added by that.
        """
        statistical = TRUST * np.hypot(self.sigma, self.halves)
        pixels = PIXELS * factor / self.sides
        return float(np.sqrt(statistical**2 + pixels**2 + LEAST_ERROR**2).max())


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """Equations of the fit, one for each coordinate that was measured."""

    design: Array
    off: Array
    weight: Array
    places: Array


def fit_jointly(look: Look, grid: Grid, dark: int) -> JointFit | None:
    """Fit a board to all that can be seen of it; None if too few crossings within it can be.

    In ``look`` light less dark squares are about 1; the grid is right to a tenth of a square; ``dark`` as of
    ``refine_grid``.
    """
    crossings = find_crossings(look, grid, dark)
    inner = ~crossings.border
    if np.count_nonzero(inner) < LEAST_CROSSINGS:
        return None
    places, points = crossings.places[inner], grid.project(crossings.found[inner])
    plane = _plane(grid, places, points)
    inward = np.asarray(np.linalg.inv(plane.homography), dtype=np.float64)
    found = project(inward, points)
    rows = _rows(plane, places, found, _onto(inward, grid, measure_edges(look, grid, dark)))
    return _solve(plane, rows)


def _plane(grid: Grid, places: Array, points: Array) -> Grid:
    """Plane through crossings, outliers weighted down."""
    side = float(np.median(grid.sides(places)))
    weight = np.ones(len(places))
    for _ in range(ROUNDS):
        homography = fit_homography(places, points, weight)
        off = np.linalg.norm(project(homography, places) - points, axis=1) / side
        weight = 1.0 / (1.0 + (off / FIRST_SCATTER) ** 2)
    return Grid(homography, 0.0, grid.size)


def _onto(inward: Array, grid: Grid, edges: SideEdges) -> SideEdges:
    """The same edges, measured from the lines of a plane."""
    rows = np.arange(len(edges.axis))
    seen = edges.places.copy()
    seen[rows, edges.axis] += edges.off
    off = project(inward, grid.project(seen))[rows, edges.axis] - edges.places[rows, edges.axis]
    return SideEdges(edges.places, edges.axis, off, edges.rising, edges.border)


def _fields(grid: Grid, places: Array) -> Array:
    """What each parameter but the last does at places (n, 2): shape (n, 2, 23) [sides of a square]."""
    a, b = ((places - 4.0) / 4.0).T
    one, zero = np.ones_like(a), np.zeros_like(a)
    fields = [(one, zero), (a, zero), (b, zero), (zero, one), (zero, a), (zero, b), (a * a, a * b), (a * b, b * b)]
    centre = 0.5 * (np.array(grid.size, dtype=float) - 1.0)
    points = grid.project(places)
    step = 1e-3
    slopes = np.stack([(grid.project(places + step * e) - points) / step for e in np.eye(2)], axis=-1)
    offset = points - centre
    bent = offset * (offset**2).sum(axis=-1, keepdims=True) / (centre**2).sum()
    lens = np.linalg.solve(slopes, bent[..., None])[..., 0]
    fields.append((lens[:, 0], lens[:, 1]))
    for term in (a * a, a * b, b * b, a**3, a * a * b, a * b * b, b**3):
        fields += [(term, zero), (zero, term)]
    return np.stack([np.stack(one, axis=-1) for one in fields], axis=-1)


def _rows(plane: Grid, places: Array, found: Array, edges: SideEdges) -> _Rows:
    crossing = _fields(plane, places)
    edge = _fields(plane, edges.places)[np.arange(len(edges.axis)), edges.axis]
    size = plane.sides(np.array([[4.0, 4.0]])) / plane.sides(edges.places) if len(edges.axis) else np.zeros(0)
    creep = np.concatenate([np.zeros(2 * len(places)), -edges.rising * size])
    return _Rows(
        design=np.column_stack([np.vstack([crossing[:, 0], crossing[:, 1], edge]), creep]),
        off=np.concatenate([*(found - places).T, edges.off]),
        weight=np.concatenate([np.ones(2 * len(places)), np.full(len(edges.axis), EDGE_WEIGHT)]),
        places=np.vstack([places, places, edges.places]),
    )


def _solve(plane: Grid, rows: _Rows) -> JointFit:
    deviation = np.empty(24)
    deviation[PLANE], deviation[LENS], deviation[BOW], deviation[-1] = LOOSE, PRIOR_LENS, PRIOR_BOW, PRIOR_CREEP
    prior = np.diag(deviation**-2.0)

    def normal(weight: Array) -> tuple[Array, Array]:
        weighted = rows.design * (weight / ALIKE)[:, None]
        return weighted.T @ rows.design + prior, weighted.T @ rows.off

    scatter, weight = 0.02, rows.weight / 0.02**2
    for _ in range(ROUNDS):
        solution = np.linalg.solve(*normal(weight))
        off = rows.off - rows.design @ solution
        scatter = max(LEAST_SCATTER, 1.4826 * float(np.median(np.abs(off))))
        weight = rows.weight / (1.0 + (0.5 * off / scatter) ** 2) ** 2 / scatter**2
    covariance = np.linalg.inv(normal(weight)[0])
    fields = np.concatenate([_fields(plane, CORNERS), np.zeros((4, 2, 1))], axis=2)
    quarter = (rows.places[:, 0] > 4.0) * 2 + (rows.places[:, 1] > 4.0)
    without = np.array([np.linalg.solve(*normal(np.where(quarter == k, 0.0, weight))) for k in range(4)])
    moved = np.einsum("cik,gk->gci", fields, without - solution)
    return JointFit(
        corners=plane.project(CORNERS + fields @ solution),
        sigma=np.sqrt(np.einsum("cik,kl,cil->c", fields, covariance, fields)),
        halves=np.sqrt(0.75 * (moved**2).sum(axis=(0, 2))),
        sides=plane.sides(CORNERS),
    )
