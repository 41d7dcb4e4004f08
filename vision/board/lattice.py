"""Lattices among saddle points: sets that lie as the crossings of a board's lines do, with light and dark in turns.

A lattice grows from four saddles around one square: a homography through what is there says where the next crossings
must be, the saddle found there joins if its bright sectors lie the right way, and the homography is fitted anew
(compare Geiger et al., "Automatic camera and range sensor calibration using a single shot", 2012). Crossings that a
piece hides are stepped over.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from vision.arrays import Array, Indices
from vision.board.saddles import Saddles

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

NEIGHBOURS: Final = 16  # how many saddles around one are looked at for the next crossing of a line
LEAST_TURN: Final = 0.5  # cosine of twice the angle between where the bright sectors are and where they should be
REACH: Final = 0.2  # a saddle further than this from where a crossing must be is another one [sides of a square]
SPAN: Final = 9  # no board has more lines than this in one direction


@dataclass(frozen=True, slots=True, eq=False)
class Lattice:
    """Saddles with the crossings they are."""

    places: Indices
    """Column and row of each crossing, from any origin, shape (n, 2); one column further is to the right of one row
    further, as the eye sees it counter-clockwise."""
    points: Array  # where they are, shape (n, 2) [px]
    homography: Array  # from places to pixels, shape (3, 3)
    bright: int  # 1 where the square at the upper indices of crossing (0, 0) is a light one, otherwise -1

    def __len__(self) -> int:
        return len(self.points)


def fit_homography(places: Array, points: Array, weights: Array | None = None) -> Array:
    """Homography (3, 3) with the least algebraic error, in coordinates of unit size (Hartley); its last entry is 1
    unless it vanishes.

    It takes places (n, 2), at least four and no three of four on one line, to points (n, 2), with weights (n,).
    """
    source, target = _to_unit(places), _to_unit(points)
    p, q = (each @ unit[:2, :2].T + unit[:2, 2] for each, unit in ((places, source), (points, target)))
    ones, zeros = np.ones((len(p), 1)), np.zeros((len(p), 3))
    full = np.hstack([p, ones])
    rows = np.vstack([np.hstack([full, zeros, -q[:, :1] * full]), np.hstack([zeros, full, -q[:, 1:] * full])])
    if weights is not None:
        rows *= np.concatenate([weights, weights])[:, None]
    matrix = np.linalg.eigh(rows.T @ rows)[1][:, 0].reshape(3, 3)
    homography = np.linalg.inv(target) @ matrix @ source
    # of the two signs the one that has the points in front of the camera
    return np.asarray(homography / (np.sign(np.append(places.mean(axis=0), 1.0) @ homography[2]) or 1.0))


def project(homography: Array, places: Array) -> Array:
    """Pixels of places (..., 2); not a number for those behind the camera."""
    flat = np.asarray(places, dtype=float)
    raised = flat @ homography[:, :2].T + homography[:, 2]
    depth = np.where(raised[..., 2:] > 1e-9, raised[..., 2:], np.nan)
    return np.asarray(raised[..., :2] / depth)


def steps(homography: Array, places: Array) -> Array:
    """Images of one step along columns and along rows at places (n, 2), shape (n, 2, 2): [which step, u or v] [px]."""
    flat = np.asarray(places, dtype=float)
    raised = flat @ homography[:, :2].T + homography[:, 2]
    pixels = raised[:, :2] / raised[:, 2:]
    slopes = homography[:2, :2][None] - pixels[:, :, None] * homography[2, :2][None, None]
    return np.asarray(np.swapaxes(slopes / raised[:, 2:, None], 1, 2))


def grow_lattices(saddles: Saddles, least: int, enough: int, most_seeds: int) -> list[Lattice]:
    """Lattices of at least so many crossings, the largest first; no saddle begins two.

    With fewer than ``least`` crossings a lattice is chance; above ``enough`` no other is looked for; ``most_seeds``
    beginnings are tried.
    """
    from scipy.spatial import cKDTree  # takes half a second to load, and most games know their board

    if len(saddles) < max(4, least):
        return []
    tree = cKDTree(saddles.points)
    found: list[Lattice] = []
    used: set[int] = set()
    for tried, seed in enumerate(_seeds(saddles, tree)):
        if tried >= most_seeds:
            break
        if used.issuperset(seed):
            continue
        lattice, members = _grow(saddles, tree, seed)
        if len(lattice) >= least:
            found.append(lattice)
            used.update(members)
        if len(lattice) >= enough:
            break
    return sorted(found, key=len, reverse=True)


def _seeds(saddles: Saddles, tree: cKDTree) -> Iterator[tuple[int, int, int, int]]:
    """Four saddles around one square, counter-clockwise to the eye, those of the best quality first."""
    following = _following(saddles, tree)
    quads: list[tuple[int, int, int, int]] = []
    for start in range(len(saddles)):
        for along in range(4):
            a, b = following[start].get(along), following[start].get((along + 1) % 4)
            if a is None or b is None:
                continue
            shared = (set(following[a].values()) & set(following[b].values())) - {start}
            quads.extend((start, a, d, b) for d in shared)
    unique = {tuple(sorted(quad)): quad for quad in quads}
    ranked = sorted(unique.values(), key=lambda quad: -float(saddles.quality[list(quad)].min()))
    for quad in ranked:
        ordered = _counter_clockwise(saddles.points, quad)
        if ordered is not None:
            yield ordered


def _counter_clockwise(points: Array, quad: tuple[int, int, int, int]) -> tuple[int, int, int, int] | None:
    corners = points[list(quad)]
    edges = np.roll(corners, -1, axis=0) - corners
    following = np.roll(edges, -1, axis=0)
    turns = edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0]
    if (turns > 0.0).all():
        quad = (quad[0], quad[3], quad[2], quad[1])
    elif not (turns < 0.0).all():
        return None
    lengths = np.linalg.norm(edges, axis=1)
    if lengths.min() < 0.25 * lengths.max():
        return None
    return quad


def _following(saddles: Saddles, tree: cKDTree) -> list[dict[int, int]]:
    """For each saddle the nearest along either edge, forwards and backwards, that could be the next crossing.

    Directions 0 to 3 go round: first edge, second edge, first edge backwards, second backwards.
    """
    count = len(saddles)
    near = np.asarray(tree.query(saddles.points, k=min(NEIGHBOURS + 1, count))[1])[:, 1:]
    offset = saddles.points[near] - saddles.points[:, None]
    heading = np.arctan2(offset[..., 1], offset[..., 0])
    turned = np.cos(2.0 * (saddles.bright[near] - saddles.bright[:, None])) < -LEAST_TURN
    there = np.cos(heading[..., None] - saddles.edges[:, None, :])
    back = np.abs(np.cos(heading[..., None] - saddles.edges[near])).max(axis=2)
    straight = np.cos(np.radians(14.0))
    result: list[dict[int, int]] = []
    for k in range(count):
        mine: dict[int, int] = {}
        for along, (edge, sign) in enumerate(((0, 1.0), (1, 1.0), (0, -1.0), (1, -1.0))):
            fits = np.nonzero(turned[k] & (sign * there[k, :, edge] > straight) & (back[k] > straight))[0]
            if len(fits):
                mine[along] = int(near[k, fits[0]])
        result.append(mine)
    return result


def _grow(saddles: Saddles, tree: cKDTree, seed: tuple[int, int, int, int]) -> tuple[Lattice, list[int]]:
    # right-handed to the eye though v points down: columns to the right, rows upwards
    members = dict(zip(((0, 0), (1, 0), (1, 1), (0, 1)), seed, strict=True))
    homography = _fit(members, saddles)
    indices = list(members.values())
    sign = 1 if _turns(homography, np.array(list(members), float), saddles.bright[indices]).sum() > 0.0 else -1
    for _ in range(3 * SPAN):
        grown = _extend(members, homography, sign, saddles, tree)
        if len(grown) < 4 or grown == members:
            break
        members = grown
        homography = _fit(members, saddles)
    places = np.array(list(members), dtype=np.intp)
    lattice = Lattice(places, saddles.points[list(members.values())], homography, sign)
    return lattice, list(members.values())


def _fit(members: dict[tuple[int, int], int], saddles: Saddles) -> Array:
    return fit_homography(np.array(list(members), dtype=float), saddles.points[list(members.values())])


def _turns(homography: Array, places: Array, bright: Array) -> Array:
    """Cosine of twice the angle between bright sectors and the squares at the upper indices, times parity: (n,)."""
    step = steps(homography, places)
    unit = step / np.linalg.norm(step, axis=2, keepdims=True)
    diagonal = unit.sum(axis=1)
    heading = np.arctan2(diagonal[:, 1], diagonal[:, 0])
    parity = 1.0 - 2.0 * (places.sum(axis=1) % 2)
    return np.asarray(parity * np.cos(2.0 * (bright - heading)))


def _extend(
    members: dict[tuple[int, int], int], homography: Array, sign: int, saddles: Saddles, tree: cKDTree
) -> dict[tuple[int, int], int]:
    """All saddles that lie where crossings up to two steps beyond those known must be."""
    known = np.array(list(members))
    low, high = known.min(axis=0), known.max(axis=0)
    reach = 1 if len(known) < 9 else 2
    columns, rows = np.meshgrid(*(np.arange(low[k] - reach, high[k] + reach + 1) for k in (0, 1)), indexing="ij")
    places = np.stack([columns.ravel(), rows.ravel()], axis=1)
    gap = np.abs(places[:, None] - known[None]).max(axis=2).min(axis=1)
    places = places[gap <= reach]
    raised = places @ homography[2, :2] + homography[2, 2]
    places = places[raised > 0.1 * raised.max()]
    wanted = project(homography, places.astype(float))
    side = np.linalg.norm(steps(homography, places.astype(float)), axis=2).min(axis=1)
    distance, nearest = (np.asarray(one) for one in tree.query(wanted))
    turns = sign * _turns(homography, places.astype(float), saddles.bright[nearest])
    fits = (distance < REACH * side) & (turns > LEAST_TURN) & (side > 3.0)
    taken: dict[int, tuple[float, tuple[int, int]]] = {}
    for k in np.nonzero(fits)[0]:
        index, off = int(nearest[k]), float(distance[k] / side[k])
        if index not in taken or off < taken[index][0]:
            taken[index] = (off, (int(places[k, 0]), int(places[k, 1])))
    return {place: index for index, (_, place) in sorted(taken.items(), key=lambda item: item[1][1])}


def _to_unit(points: Array) -> Array:
    centre = points.mean(axis=0)
    scale = np.sqrt(2.0) / max(float(np.linalg.norm(points - centre, axis=1).mean()), 1e-12)
    return np.array([[scale, 0.0, -scale * centre[0]], [0.0, scale, -scale * centre[1]], [0.0, 0.0, 1.0]])
