"""What stands on the table, wherever it stands: pieces as depth alone shows them, without a thought of what should be.

Points above the table, seen from straight above, fall into clusters, one for each piece: stems are further apart than
feet. A cluster's height says how likely each kind is, the picture says the side. Nothing is said of what is hidden.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

import cv2
import numpy as np

from hardware.interfaces import Frame
from hardware.piece_set import PIECE_SHAPES, Kind
from hardware.table import PieceSpec, Place
from vision.arrays import Field, Mask, Whole
from vision.board.view import BoardView
from vision.pieces.fit import TALL, Fit
from vision.pieces.poses import off_standing
from vision.pieces.surface import Surface, heights, raised, surface

_CELL: Final = 0.0015  # side of the cells into which points fall, seen from above [m]
_CEILING: Final = 0.07  # nothing that stands is higher [m]
_WALL: Final = 0.008  # depth is off by millimetres, and fat at edges: so much wider may a box look [m]
_LEAST_POINTS: Final = 60  # smaller clusters are noise [px]
_BEYOND_FOOT: Final = 0.005  # depth shows no piece that stands further beyond its foot than this [m]
_ABOUT: Final = 0.016  # what stands so near to a piece's place is that piece [m]
_FINE: Final = 0.0005  # side of the cells in which is drawn what pieces explain [m]
_LOW: Final = 0.008  # nothing that is so high is the board [m]: what lies is twice as high
_STRANGE: Final = 40
"""What no piece explains is at least as many pixels: where nothing strange was there were 23 at most in 240 pictures of
tables with squares of 40 to 54 mm; of 150 pieces that lay anywhere, or just beside another, 148 made larger ones."""
_LONGEST: Final = 0.09
"""What reaches further, from corner to corner, is no piece, but a cup or a clock, which is left alone [m]: a king
that lies is 62 mm long and 20 mm wide, and may seem to be one with what is off its foot beside him."""
_WIDEST: Final = 0.013
"""A cluster that reaches further from its middle, but for single points, is no one piece that stands [m]."""
_STRAY: Final = 0.92  # of a cluster's points so many are within that, and below its top: single points fly
_HEAD: Final = 0.008  # points so far below the top are above a piece's axis, about [m]
_CROWN: Final = 0.004  # points so far below the top say how broad that is [m]
_GRIDS: Final = ((0.002, 3), (0.0007, 2))  # searches of the axis: step between places [m], how many on either side
_OFF: Final = 0.0015  # standard deviation of a point from the surface that it is on [m]
_MOST: Final = 9.0  # a single point speaks against a place by no more than this; squared standard deviations
_POINTS: Final = 400  # of a piece are enough
_AGREES: Final = 0.7  # share of an outline that agrees with the picture, with which its place is known to a millimetre
_SAME: Final = 0.009  # an outline and a sighting, or two sightings, no further apart are one piece's [m]
_OUTLINED: Final = 0.005  # … and, without depth's bias, no further [m]
_STRAYS: Final = 0.005  # an outline that is so much further from a sighting than the others is something else's [m]
_FEW: Final = 8
_SPREAD_OUT: Final = 0.15  # with fewer pieces, or those nearer together [m], depth's bias is the same everywhere
_ALONG: Final = np.linspace(0.35, 0.9, 12)  # where lightness is looked at, in heights
_LEAST_ALONG: Final = 12  # fewer pixels of an axis tell nothing [px]
_HIDES: Final = 0.015  # what is so much nearer than a piece would be hides it [m]


TOPS: Final[Mapping[Kind, float]] = MappingProxyType({
    Kind.PAWN: 0.0355, Kind.ROOK: 0.0398, Kind.KNIGHT: 0.0420, Kind.BISHOP: 0.0464, Kind.QUEEN: 0.0537,
    Kind.KING: 0.0578,
})  # fmt: skip
"""How high the kinds of our set look to a D435 from above [m]: thin points are lost, broad ones bleed (measured over
600 pieces in 24 lights)."""
SPREADS: Final[Mapping[Kind, float]] = MappingProxyType({
    Kind.PAWN: 0.0009, Kind.ROOK: 0.0008, Kind.KNIGHT: 0.0012, Kind.BISHOP: 0.0010, Kind.QUEEN: 0.0010,
    Kind.KING: 0.0010,
})  # fmt: skip
"""Standard deviations of heights of one kind in one picture [m] (measured over 900 pieces in 40 lights: 0.6 to 0.8, but
1.04 for knights, whose heads look in all directions; and 0.2 more)."""
_NEAR: Final = 0.65
"""Farther than this from the camera they err more, by the square, as a stereo camera's depth does [m] (measured over
1,150 pieces on boards of 40, 48 and 53 mm squares: 1.0 mm at 0.6 m, 1.2 at 0.71, 1.6 at 0.81, 1.7 at 0.87)."""
_FLUKE: Final = 6.0  # heights further off count no more; standard deviations
_BREADTHS: Final[Mapping[Kind, float]] = MappingProxyType({
    Kind.PAWN: 0.00245, Kind.ROOK: 0.00415, Kind.KNIGHT: 0.0017, Kind.BISHOP: 0.0018, Kind.QUEEN: 0.0035,
    Kind.KING: 0.0023,
})  # fmt: skip
"""How broad tops look, see ``Sighting.breadth`` [m] (measured over 935 pieces in 12 lights)."""
_BREADTH_SPREAD: Final = 0.0006  # … and their standard deviation [m]: 0.45 measured, and what another camera may add
_BREADTH_FLUKE: Final = 3.5  # breadths further off count no more; standard deviations


@dataclass(frozen=True, slots=True)
class Sighting:
    """Something that stands, or lies."""

    x: float  # of its axis, board frame [m]; without depth's bias (see ``sightings_of``) to about 2 mm
    y: float  # likewise [m]
    height: float  # of its top [m]
    upright: bool  # as high and as narrow as a piece that stands; else it lies, or leans, or is none
    white: float
    """Evidence that it is White's, less that for Black's, the median of its pixels (natural logarithm). Measured over
    2,000 pieces in 60 lights: White's 1.0 to 4.2, Black's -0.4 to -4.7."""
    breadth: float = math.nan
    """Of its top, the narrower way: standard deviation of the points up to 4 mm below the highest [m]."""
    reach: float = 0.0  # nearly all of it is no further from its axis [m]
    lightness: float = math.nan  # CIELAB's, 0 to 255, median along its axis; NaN where too little of that is seen
    blur: float = 1.0  # so many times more than near the camera heights and breadths err where it is


@dataclass(frozen=True, slots=True)
class Sightings:
    """What a frame shows."""

    all: tuple[Sighting, ...]  # that stands or lies there
    hidden: frozenset[Place]
    """Places of expected pieces that something else hides, so that nobody can say whether they are there."""
    strange: tuple[tuple[float, float], ...] = ()
    """Where so much rises that no expected piece explains it, board frame (x, y) [m]."""


def sightings_of(
    frame: Frame, view: BoardView, expected: Mapping[Place, PieceSpec], beside: tuple[float, float]
) -> Sightings:
    """All that stands or lies on the board, or up to so far beside it, along x and along y [m], in a frame with depth.

    Most of what is expected stands there: the colours of both sides are learnt from it, and by how much places by depth
    are off.

    Raises:
        ValueError: the frame is by another camera, or the board is not in the picture.
    """
    view.require_camera(frame)
    fit = Fit(frame, view, expected, use_depth=True, around=beside)
    assert fit.rises is not None, "without depth nothing is seen to stand"
    points, whiter = raised(fit.part, fit.rises, view), (fit.maps[0] - fit.maps[1]).ravel()
    flat, each = points.reshape(-1, 3), clusters(points, view, beside)
    found = [_sighted(flat[mine], float(np.median(whiter[mine]))) for mine in each]
    found = _lit(_unbiased(found, fit), each, frame, view, fit.part)
    strange = _strange(points, found, fit, view, beside)
    return Sightings(tuple(found), frozenset(hidden_places(frame, view, expected)), strange)


def together(looks: Sequence[Sightings]) -> Sightings:
    """What the newest of some looks at the same shows, with heights and breadths as on average over all of them."""
    newest, before = looks[-1], [one for look in looks[:-1] for one in look.all]
    averaged = []
    for one in newest.all:
        same = [one, *(was for was in before if math.dist((was.x, was.y), (one.x, one.y)) < _SAME)]
        height = math.fsum(was.height for was in same) / len(same)
        breadth = math.fsum(was.breadth for was in same) / len(same)
        averaged.append(replace(one, height=height, breadth=breadth))
    return Sightings(tuple(averaged), newest.hidden, newest.strange)


def rough_sightings(frame: Frame, view: BoardView, beside: tuple[float, float]) -> list[Sighting]:
    """The same where nothing is known of what should stand: places are some millimetres off, and of which side it is
    nobody says.

    Raises:
        ValueError: as ``sightings_of``.
    """
    view.require_camera(frame)
    assert frame.depth is not None, "without depth nothing is seen to stand"
    part = surface(view, beside)
    points = raised(part, heights(frame.depth, part), view)
    flat, each = points.reshape(-1, 3), clusters(points, view, beside)
    return _lit([_sighted(flat[mine], 0.0) for mine in each], each, frame, view, part)


def _lit(
    found: Sequence[Sighting], clusters: Sequence[Whole], frame: Frame, view: BoardView, part: Surface
) -> list[Sighting]:
    """With the lightness of each along its axis, as far as that is in sight, and how much depth errs there."""
    light = cv2.cvtColor(frame.colour[part.rows, part.columns], cv2.COLOR_RGB2LAB)[..., 0]
    lit = []
    for one, mine in zip(found, clusters, strict=True):
        axis = _axis_pixels(one, view, part)
        along = light.ravel()[axis[np.isin(axis, mine)]]
        lightness = float(np.median(along)) if along.size >= _LEAST_ALONG else math.nan
        away = float(view.depth([(one.x, one.y, 0.5 * one.height)])[0])
        lit.append(replace(one, lightness=lightness, blur=max(1.0, (away / _NEAR) ** 2)))
    return lit


def _axis_pixels(one: Sighting, view: BoardView, part: Surface) -> Whole:
    """Of what stands there and stems are: depth's edges are not the picture's; counted row by row."""
    axis = [(one.x, one.y, share * one.height) for share in _ALONG]
    middle = np.rint(view.project(axis)).astype(int) - (part.columns.start, part.rows.start)
    beside = np.stack(np.meshgrid((-1, 0, 1), (-1, 0, 1)), axis=-1).reshape(-1, 2)
    u, v = (middle[:, None] + beside).reshape(-1, 2).T
    h, w = part.ground.shape
    within = (u >= 0) & (v >= 0) & (u < w) & (v < h)
    return np.unique(v[within] * w + u[within])


def clusters(
    points: Field, view: BoardView, beside: tuple[float, float], *, above: float = TALL, least: int = _LEAST_POINTS
) -> list[Whole]:
    """Indices of pixels, counted row by row, of each thing that rises ``above`` a height over the table [m], on the
    board or so far beside it along x and along y [m], but not in a box, and shows in as many pixels; these show points
    of the board frame (..., 3) [m].
    """
    half = 4.0 * view.table.square + np.array(beside)
    within = (np.abs(points[..., :2]) < half).all(axis=-1)  # false where depth is unknown
    for box in view.table.boxes():  # what is in there, nobody can tell
        middle, wide = (box.x, box.y), np.array((box.half_x, box.half_y)) + box.wall + _WALL
        within &= (np.abs(points[..., :2] - middle) > wide).any(axis=-1)
    up: Mask = within & (points[..., 2] > above) & (points[..., 2] < _CEILING)
    if not up.any():
        return []
    at = np.floor((points[up][:, :2] + half) / _CELL).astype(np.intp)
    size = (np.ceil(2.0 * half / _CELL) + 1).astype(int)
    occupied = np.zeros((size[0], size[1]), dtype=np.uint8)
    occupied[at[:, 0], at[:, 1]] = 1
    closed = cv2.morphologyEx(occupied, cv2.MORPH_CLOSE, np.ones((2, 2), np.uint8))
    _, numbers = cv2.connectedComponents(closed, connectivity=4)
    label = numbers[at[:, 0], at[:, 1]]
    order = np.argsort(label, kind="stable")
    found, starts = np.unique(label[order], return_index=True)
    each = np.split(np.flatnonzero(up).astype(np.int32)[order], starts[1:])
    return [mine for number, mine in zip(found.tolist(), each, strict=True) if number and mine.size >= least]


def _strange(
    points: Field, found: Sequence[Sighting], fit: Fit, view: BoardView, beside: tuple[float, float]
) -> tuple[tuple[float, float], ...]:
    """Where things rise beyond the feet of all that stands about where it is expected, as its outline or depth shows;
    what is in its place in a tray and is not seen to stand, as at the picture's edge, explains all that is about there.
    """
    spots = list[tuple[float, float, float]]()  # (x, y) and how far around it all is explained
    for place, kind, outline in zip(fit.stands, fit.kinds, fit.places.tolist(), strict=True):
        middle, foot = view.table.xy(place), PIECE_SHAPES[kind].foot_radius
        there = [(one.x, one.y) for one in found if one.upright and math.dist((one.x, one.y), middle) < _ABOUT]
        spots += [(x, y, foot + _BEYOND_FOOT) for x, y in (outline, *there)]
        if place.in_tray and not there:
            spots.append((*middle, foot + _ABOUT))
    half = 4.0 * view.table.square + np.array(beside)
    size = np.ceil(2.0 * half / _FINE).astype(int)
    explained = np.zeros((size[0] + 1, size[1] + 1), dtype=np.uint8)
    for x, y, reach in spots:
        u, v, radius = (round(along / _FINE) for along in (x + half[0], y + half[1], reach))
        cv2.circle(explained, (v, u), radius, 1, thickness=-1)
    high = points[points[..., 2] > _LOW]  # false where depth is unknown
    at = np.clip(np.rint((high[:, :2] + half) / _FINE).astype(np.intp), 0, size)
    rest = high[explained[at[:, 0], at[:, 1]] == 0]
    each = [rest[mine, :2] for mine in clusters(rest, view, beside, above=_LOW, least=_STRANGE)]
    middles = (one.mean(axis=0) for one in each if float(np.hypot(*np.ptp(one, axis=0))) < _LONGEST)
    return tuple((float(x), float(y)) for x, y in middles)


def _sighted(points: Field, white: float) -> Sighting:
    top = float(np.quantile(points[:, 2], _STRAY))
    x, y = np.median(points[points[:, 2] > top - _HEAD][:, :2], axis=0).tolist()
    least = 0.5 * min(shape.height + 2.0 * shape.foot_radius for shape in PIECE_SHAPES.values())
    wide = float(np.quantile(np.hypot(points[:, 0] - x, points[:, 1] - y), _STRAY))
    kind = min(Kind, key=lambda one: abs(PIECE_SHAPES[one].height - top))
    x, y = _axis(points[:: max(1, len(points) // _POINTS)], kind, x, y)
    upright = top > least and wide < _WIDEST
    return Sighting(x, y, top, upright, white, _breadth(points, top), reach=wide)


def _breadth(points: Field, top: float) -> float:
    """Of what is highest of a piece: rooks are broad there both ways, the heads of knights narrow [m]."""
    crown = points[points[:, 2] > top - _CROWN][:, :2]
    return math.sqrt(max(float(np.linalg.eigvalsh(np.cov(crown.T))[0]), 0.0)) if len(crown) > 2 else math.nan


def _axis(points: Field, kind: Kind, x: float, y: float) -> tuple[float, float]:
    """Where a kind that stands explains points best, near a place (x, y) [m]."""
    best = np.array([x, y])
    for step, count in _GRIDS:
        ticks = step * np.arange(-count, count + 1)
        places = best + np.stack(np.meshgrid(ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 2)
        off = off_standing(points, kind, places) / _OFF
        best = places[int(np.minimum(off**2, _MOST).sum(axis=1).argmin())]
    return float(best[0]), float(best[1])


def _unbiased(found: list[Sighting], fit: Fit) -> list[Sighting]:
    """Depth puts pieces some millimetres aside, by as much as those of known outline; these stand where that is."""
    sure = fit.places[np.flatnonzero(fit.agreement() > _AGREES)]
    pairs = np.array([
        ((one.x, one.y), place)
        for one in found if one.upright
        for place in sure.tolist() if math.dist((one.x, one.y), place) < _SAME
    ])  # fmt: skip
    bias = [_line(pairs[:, 0, axis], pairs[:, 0, axis] - pairs[:, 1, axis]) for axis in (0, 1)] if len(pairs) else []
    unbiased = []
    for one in found:
        x, y = (at - float(np.polyval(line, at)) for at, line in zip((one.x, one.y), bias, strict=True)) if bias else (
            one.x, one.y
        )  # fmt: skip
        if one.upright and len(sure):
            away = np.hypot(sure[:, 0] - x, sure[:, 1] - y)
            if away.min() < _OUTLINED:
                x, y = sure[int(away.argmin())].tolist()
        unbiased.append(replace(one, x=x, y=y))
    return unbiased


def _line(at: Field, off: Field) -> Field:
    """By how much places along an axis are off, as a polynomial of them; single ones err."""
    middle = float(np.median(off))
    good = np.abs(off - middle) < _STRAYS
    if np.count_nonzero(good) < _FEW or np.ptp(at[good]) < _SPREAD_OUT:
        return np.array([middle])
    return np.polyfit(at[good], off[good], 1)


def hidden_places(frame: Frame, view: BoardView, expected: Mapping[Place, PieceSpec]) -> Collection[Place]:
    """Places whose pieces something nearer hides, or that are out of the picture."""
    assert frame.depth is not None
    hidden = []
    for place, piece in expected.items():
        if place.in_box:
            continue
        axis = np.array([(*view.table.xy(place), share * PIECE_SHAPES[piece.kind].height) for share in (0.5, 0.7, 0.9)])
        pixels = np.rint(view.project(axis)).astype(int)
        nearer = 0
        for (u, v), z in zip(pixels.tolist(), view.depth(axis).tolist(), strict=True):
            inside = 0 <= u < view.intrinsics.width and 0 <= v < view.intrinsics.height
            nearer += not inside or float(frame.depth[v, u]) < z - _HIDES
        if nearer > 1:
            hidden.append(place)
    return hidden


def kind_cost(kind: Kind, one: Sighting, top: float) -> float:
    """What it costs that a piece which is seen is of a kind: how unlikely that is, as a logarithm, least for the kind
    that it looks like; ``top`` is how high the kind looks in this picture [m].
    """
    spread = one.blur * SPREADS[kind]
    off = min(abs(one.height - top) / spread, _FLUKE)
    broad = abs(one.breadth - _BREADTHS[kind]) / (one.blur * _BREADTH_SPREAD)
    by_breadth = 0.0 if math.isnan(broad) else 0.5 * min(broad, _BREADTH_FLUKE) ** 2
    return 0.5 * off**2 + by_breadth + math.log(SPREADS[kind] / SPREADS[Kind.ROOK])
