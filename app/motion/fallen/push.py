"""Pushing a piece a little aside with the closed fingers, where nothing else gets at it or past it.

The fingers come down beside a piece, its foot's height or lower, and go slowly along the board. A piece that stands is
pushed at its foot, far below where it would topple: at a height h it slides rather than tips while h < r / μ, 22 mm for
a pawn's foot on felt. One that lies is pushed through its centre of mass. Where exactly it comes to rest, only the
camera can tell: nothing relies on it.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np

from app.motion.arcs import Arc, Waypoints, Workcell, homewards, over, polygon
from app.motion.fallen.lying import LoosePieces, Strip, crowd_of, discs_of, in_the_strip, meets_box, radii
from app.motion.fallen.pivot_edge import MASS_HEIGHT, footprint, reach
from app.motion.motions import motion_of
from app.motion.obstacles import Crowd
from app.motion.path import Vector
from app.motion.plan import Motion, Plan
from app.motion.planner import Planner
from app.motion.route import Route
from hardware.parameters import Pads
from hardware.piece_set import PIECE_SHAPES
from hardware.table import TableSettings

_TIPS: Final = (0.004, 0.009, 0.014)
"""So far above the board the fingers' tips go [m], the lowest way first: at that, a board that is 3 mm too high is not
touched. Higher up they pass over what lies, and push what stands at its stem."""
_GAP: Final = 0.005
"""The fingers come down so far from the piece: where it is may be wrong by as much [m]."""
_SPEED: Final = 0.08
"""Of a push: what is let go of at this speed slides on by 0.7 mm [m/s]."""
_DIRECTIONS: Final = 16
_ABOUT: Final = 0.85  # cosine of the largest angle between a push and where it should go to
_FIRST, _STEP, _LAST = 0.006, 0.004, 0.042
"""Ways that are tried [m]."""
_SURE: Final = 0.004
"""A push must be of use over so much of its end: the piece may come to rest a little elsewhere [m]."""
_MARGIN: Final = 0.002
"""Other pieces stay so far from all that moves [m]."""
_SAMPLES: Final = 9
_PARALLEL: Final = 1e-9
_DISTURBS: Final = 0.020
"""So much further [m] may one be pushed that is out of place anyway, rather than one that is not."""
_OBLIQUE: Final = 0.008
"""… and so much further along the fingers' faces than over their corners, where a piece may slip aside."""
_EDGE: Final = 0.040
"""Nothing is pushed further beyond the first or the last rank [m]."""


@dataclass(frozen=True, slots=True)
class Nudge:
    """A push."""

    name: str
    """Of the piece."""
    direction: float
    """From the x axis of the board, counter-clockwise [rad]."""
    way: float
    """By so much [m]."""
    tips: float
    """How high above the board the fingers' tips are [m]."""
    begin: tuple[float, float]
    """The tool's centre when the fingers have come down, board frame (x, y) [m]."""
    end: tuple[float, float]
    """When they go up again [m]."""


def find_nudge(
    names: tuple[str, ...], scene: LoosePieces, kept: frozenset[str], helps: Callable[[LoosePieces], bool], pads: Pads,
    table: TableSettings, towards: float | None = None, short: float = 0.0,
    at: tuple[float, float] | None = None,
) -> Nudge | None:  # fmt: skip
    """The least push of one of the named pieces that helps, if there is one.

    The scene has all pieces on the table; ``kept`` are the names of those that stand where they should, and ``helps``
    says whether the arm can go on in a scene. Pushes are about ``towards`` a direction [rad]; None: wherever to.
    ``short``: by so much less than it is pushed does it go [m]; ``at``: a point through which it is pushed, board frame
    [m]; None: its centre of mass.
    """
    best, least = None, math.inf
    bodies = _bodies(scene)
    for name in names:
        others = crowd_of(scene, table, without=name)
        heights = _TIPS[: 1 if any(piece.name == name for piece in scene.lying) else None]
        for number in range(_DIRECTIONS):
            direction = 2.0 * math.pi * number / _DIRECTIONS
            if towards is not None and math.cos(direction - towards) < _ABOUT:
                continue
            oblique = _OBLIQUE if number % (_DIRECTIONS // 4) else 0.0
            dearer = oblique + (_DISTURBS if name in kept else 0.0)
            for way in _ways(bodies, name, direction, table):
                if way + dearer >= least:
                    break
                pushes = (nudge_of(scene, name, direction, way, tips, pads, at) for tips in heights)
                nudge = next((one for one in pushes if _is_free(one, others, pads)), None)
                if nudge is None:
                    break
                goes = [way - short + more for more in (-0.5 * _SURE, 0.5 * _SURE)]
                if goes[0] > 0.0 and all(helps(_pushed(scene, nudge, far)) for far in goes):
                    best, least = nudge, way + dearer
                    break
    return best


def plan_nudge(planner: Planner, nudge: Nudge, scene: LoosePieces) -> Plan:
    """To the piece, the push, and home, in a scene of all pieces; ``PlanRefused`` if it leads out of the workspace."""
    cell = planner.cell
    height = nudge.tips + cell.parameters.pads.half_height
    begin, end = cell.base([(*nudge.begin, height), (*nudge.end, height)])
    arc = Arc(cell.board(np.asarray(planner.start, dtype=float)), (*nudge.begin, height), 0.0, None, planner.finger)
    to = over(cell, arc, crowd_of(scene, cell.table))
    push = polygon(cell, np.array([begin, end]), [], None)
    push = push._replace(bounds=tuple(replace(one, speed=min(one.speed, _SPEED)) for one in push.bounds))
    motions = [
        _motion(cell, f"to the {nudge.name}", to, planner.finger),
        _motion(cell, f"push the {nudge.name} by {1e3 * nudge.way:.0f} mm", push, 0.0),
        _motion(cell, "home", homewards(cell, end), 0.0),
    ]
    return planner.plan(f"push the {nudge.name}", motions)


def _motion(cell: Workcell, label: str, way: Waypoints, finger: float) -> Motion:
    """Stiff all along, with the fingers closed."""
    return motion_of(cell, label, Route(*way, contact=(0.0, 0.0), finger=finger, opens=0.0))[0]


def _bodies(scene: LoosePieces) -> dict[str, Vector]:
    """Of each piece what it covers of the table: x, y and radius of discs, (n, 3) [m]."""
    bodies = {piece.name: np.array([[piece.x, piece.y, PIECE_SHAPES[piece.kind].foot_radius]])
              for piece in scene.standing}  # fmt: skip
    for piece in scene.lying:
        bodies[piece.name] = np.array([[*piece.along(way), radius] for way, radius, _ in discs_of(piece.kind)])
    return bodies


def _unit(direction: float) -> Vector:
    return np.array([math.cos(direction), math.sin(direction)])


def _ways(bodies: dict[str, Vector], name: str, direction: float, table: TableSettings) -> Iterator[float]:
    """How far a piece may be pushed: on the table, and coming near to no other that it is not leaving."""
    body, unit = bodies[name], _unit(direction)
    rest = [other for one, other in bodies.items() if one != name]
    # up to the table's edge, or the inner walls of boxes
    walls = [abs(box.x) - box.half_x - box.wall - _MARGIN for box in table.boxes()]
    most_x, most_y = min([table.half_width, *walls]), 4.0 * table.square + _EDGE
    at_first = [_apart(body, other) for other in rest]
    wide = body[:, 2] if walls else 0.0
    # what lies beyond already may be pushed away from there
    far_x, far_y = np.maximum(most_x, np.abs(body[:, 0]) + wide), np.maximum(most_y, np.abs(body[:, 1]))
    for way in np.arange(_FIRST, _LAST, _STEP).tolist():
        moved = body + np.append(way * unit, 0.0)
        if (np.abs(moved[:, 0]) + wide > far_x).any() or (np.abs(moved[:, 1]) > far_y).any():
            return
        for other, first in zip(rest, at_first, strict=True):
            nearest = min(_apart(body + np.append(s * unit, 0.0), other) for s in np.linspace(0.0, way, _SAMPLES))
            if nearest < min(_MARGIN, first - 0.5e-3):
                return
        yield way


def _apart(one: Vector, other: Vector) -> float:
    """Between two rows of discs [m]; less than 0: they overlap."""
    away = np.hypot(one[:, None, 0] - other[None, :, 0], one[:, None, 1] - other[None, :, 1])
    return float((away - one[:, None, 2] - other[None, :, 2]).min())


def nudge_of(
    scene: LoosePieces, name: str, direction: float, way: float, tips: float, pads: Pads,
    at: tuple[float, float] | None = None,
) -> Nudge:  # fmt: skip
    """A push of a piece of a scene through its centre of mass, or another point, as `find_nudge`: the fingers come down
    behind it, meet it, and go on by ``way`` [m], their tips so high [m].
    """
    unit, centre = _unit(direction), np.array(_centre(scene, name) if at is None else at)
    touching = centre + _until_met(pads, _outline(scene, name, tips, pads) - centre, unit) * unit
    begin, end = (touching - _GAP * unit).tolist(), (touching + way * unit).tolist()
    return Nudge(name, direction, way, tips, (begin[0], begin[1]), (end[0], end[1]))


def _until_met(pads: Pads, outline: Vector, unit: Vector) -> float:
    """Where on the line through the origin along ``unit`` the closed fingers, which come from behind, meet what has
    this outline, (n, 2) [m]: they enter a point of it as they come past the last of their sides that face there.
    """
    sides = _sides(pads)
    facing = sides[:, :2] @ unit
    beyond = outline @ sides[:, :2].T + sides[:, 2]
    ahead, behind = facing > _PARALLEL, facing < -_PARALLEL
    enters = (beyond[:, ahead] / facing[ahead]).max(axis=1)
    leaves = (beyond[:, behind] / facing[behind]).min(axis=1)
    met = (enters < leaves) & (beyond[:, ~(ahead | behind)] < 0.0).all(axis=1)
    return float(enters[met].min())


@lru_cache(maxsize=4)
def _sides(pads: Pads) -> Vector:
    """Of the closed fingers, seen from above: outwards, and how far from the tool's centre, negative, (n, 3) [m]."""
    from scipy.spatial import ConvexHull  # a part of SciPy that takes its time, for what is seldom wanted

    return np.asarray(ConvexHull(footprint(pads)).equations)


def _outline(scene: LoosePieces, name: str, tips: float, pads: Pads) -> Vector:
    """What closed fingers meet of a piece whose tips are so high, seen from above, board frame (n, 2) [m]."""
    lying = next((piece for piece in scene.lying if piece.name == name), None)
    if lying is not None:
        along = np.linspace(0.0, PIECE_SHAPES[lying.kind].height, 4 * _SAMPLES)
        half = np.linspace(-1.0, 1.0, 2 * _SAMPLES)
        aside = np.array([-lying.outwards[1], lying.outwards[0]])
        grid = [np.array(lying.along(way)) + radius * half[:, None] * aside
                for way, radius in zip(along, radii(lying.kind, along), strict=True)]  # fmt: skip
        return np.concatenate(grid)
    piece = next(piece for piece in scene.standing if piece.name == name)
    heights = np.linspace(tips, tips + 2.0 * pads.half_height, _SAMPLES)
    angles = np.linspace(0.0, 2.0 * math.pi, 8 * _SAMPLES, endpoint=False)
    radius = float(radii(piece.kind, heights).max())
    return np.array([piece.x, piece.y]) + radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _centre(scene: LoosePieces, name: str) -> tuple[float, float]:
    """Of a piece's mass, seen from above [m]."""
    for piece in scene.lying:
        if piece.name == name:
            return piece.along(MASS_HEIGHT * PIECE_SHAPES[piece.kind].height)
    return next((piece.x, piece.y) for piece in scene.standing if piece.name == name)


def _is_free(nudge: Nudge, others: Crowd, pads: Pads) -> bool:
    """Whether the fingers touch nothing else."""
    unit = _unit(nudge.direction)
    ahead, wide = reach(pads, unit), reach(pads, np.array([-unit[1], unit[0]]))
    x, y = (np.array(nudge.begin) - ahead * unit).tolist()
    strip = Strip((x, y), unit, 2.0 * ahead + math.dist(nudge.begin, nudge.end), wide, max(0.0, nudge.tips - _MARGIN))
    return in_the_strip([strip], others, _MARGIN) is None and not meets_box(strip, others, _MARGIN)


def _pushed(scene: LoosePieces, nudge: Nudge, way: float) -> LoosePieces:
    """The scene after a push of some length [m]."""
    dx, dy = (way * _unit(nudge.direction)).tolist()
    standing = (one._replace(x=one.x + dx, y=one.y + dy) if one.name == nudge.name else one for one in scene.standing)
    lying = (
        replace(one, base=(one.base[0] + dx, one.base[1] + dy)) if one.name == nudge.name else one
        for one in scene.lying
    )
    return LoosePieces(tuple(standing), tuple(lying))
