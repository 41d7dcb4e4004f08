"""Ways of the tool over the board: up, over and down, as high as what they pass over, with corners as wide as fit.

Vertical where fingers or piece are beside others. The way over is one straight line, on the highest edge of the hull
of all heights that are needed below it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from app.motion.curves import STRAIGHT, turns, widest_corner
from app.motion.obstacles import Crowd, Moving, needed_heights
from app.motion.path import Vector
from app.motion.plan import Continuation, PlanRefused
from app.motion.route import NEAR, Route
from app.motion.settings import MotionSettings
from app.motion.timing.time_law import Bounds
from app.motion.timing.torque import TorqueModel
from controller.model.compiled import PAIR, ROW, FloatArray, compiled, compiled_as
from controller.protection.limits import Limits, default_limits
from hardware.parameters import RobotParameters
from hardware.piece_set import PIECE_SHAPES, Kind, PieceShape
from hardware.table import Place, TableSettings

_STEP = 0.0015
"""Ways over the board are looked at so closely [m]."""
_ASIDE = 0.001
"""A tool that is less than this beside a place is over it [m]."""
_VERTICAL = 0.003
"""The first bit of a way up and the last one of a way down is vertical [m]."""
_SHARES = np.linspace(1.0, 0.05, 20)
"""Sizes of a corner that are tried, as shares of the largest."""


@dataclass(frozen=True, slots=True)
class Workcell:
    """What plans are made for: how to move, the robot and its dynamics, the table, and what protection allows."""

    settings: MotionSettings
    parameters: RobotParameters
    table: TableSettings
    limits: Limits
    torque: TorqueModel

    @classmethod
    def of(cls, settings: MotionSettings, parameters: RobotParameters, table: TableSettings) -> Workcell:
        """With the controller's own limits."""
        return cls(settings, parameters, table, default_limits(parameters, table), TorqueModel(parameters))

    @property
    def tick(self) -> float:
        """Of the loop [s]."""
        return self.parameters.drive.tick

    def continuation(self, route: Route | None = None) -> Continuation:
        """Of a motion along a route, or of samples of another origin."""
        return Continuation(self.settings, self.table, self.tick, route)

    def height(self, kind: Kind, place: Place) -> float:
        """Of the tool over the board where it takes a piece from a place or lets go of it there [m].

        Over a box the foot stays clear of whatever may lie in it, so that nothing of the arm is ever between the walls.
        """
        height = PIECE_SHAPES[kind].grip_height
        return height + self.table.box_fill + self.settings.clearance if place.in_box else height

    def base(self, points: Sequence[tuple[float, float, float]]) -> Vector:
        """Tool points with the pads' centre at heights over points (x, y) of the board, (n, 3) [m]."""
        return self.table.base_from_board(np.array(points))

    def board(self, point: Vector) -> tuple[float, float, float]:
        """A tool point by (x, y) on the board and its height over it [m]."""
        x, y, height = self.table.board_from_base(point).tolist()
        return x, y, height


class Arc(NamedTuple):
    """A pick-and-place arc from one point of the board to another; heights of the tool over the board [m]."""

    start: tuple[float, float, float]
    """(x, y), height."""
    end: tuple[float, float, float]
    """(x, y), height."""
    least: float
    """On the way between [m]."""
    carried: PieceShape | None
    """Piece in the fingers."""
    opening: float
    """How far the fingers are open [m]."""
    drops: bool = False
    """What is carried is let go at the end, in the air: it need not come down from above."""


class Waypoints(NamedTuple):
    """Corners, base frame (n, 3); how far before each inner one the path leaves it, (n - 2,) [m]; lines' bounds."""

    points: Vector
    tangents: Vector
    bounds: tuple[Bounds, ...]


def over(cell: Workcell, arc: Arc, others: Crowd) -> Waypoints:
    """Up, over and down; raises ``PlanRefused`` if what stands there is higher than the workspace."""
    settings = cell.settings
    (x0, y0, z0), (x1, y1, z1) = arc.start, arc.end
    way = math.hypot(x1 - x0, y1 - y0)
    if way < _ASIDE:
        # there already: a carried piece comes down from above all the same, as its way ends with a touch
        top = max(z0, z1 + (settings.lift if arc.carried is not None and not arc.drops else 0.0))
        return polygon(cell, cell.base([arc.start, (x1, y1, top), arc.end]), [0.0], arc.carried)
    count = max(math.ceil(way / _STEP) + 1, 5)  # also of the shortest way some points are within it
    share = np.linspace(0.0, 1.0, count)
    moving = Moving.of(cell.parameters.pads, arc.opening, arc.carried)
    needed = needed_heights(share, (x0, y0), (x1, y1), moving, others, settings.beside, settings.clearance)
    np.maximum(needed, arc.least, out=needed)
    needed[0], needed[-1] = min(z0, arc.least), min(z1, arc.least)  # straight over either place it may stand there
    first, last = _heights(share, needed, arc, settings)
    if arc.carried is None:
        first += settings.swing if first > z0 else 0.0
        last += settings.swing_down if last > z1 else 0.0
    _check_height(cell, max(first, last), arc, float(share[int(needed.argmax())]), others)
    at, slope = share * way, (last - first) / way
    tangents = [
        _corner(at, needed, first - z0, first, slope, settings.corner),
        _corner(way - at[::-1], needed[::-1].copy(), last - z1, last, -slope, settings.corner),
    ]
    corners = cell.base([arc.start, (x0, y0, first), (x1, y1, last), arc.end])
    return polygon(cell, corners, tangents, arc.carried)


def polygon(cell: Workcell, corners: Vector, tangents: Sequence[float], carried: PieceShape | None) -> Waypoints:
    """A way along points (n, 3), without those that coincide or that it does not turn at; with bounds of each line."""
    points, sizes = [corners[0].tolist()], list[float]()
    last = len(corners) - 1
    for i, corner in enumerate(corners[1:].tolist(), start=1):
        if math.dist(corner, points[-1]) < NEAR:
            if sizes and i == last:
                sizes.pop()
            continue
        points.append(corner)
        if i < last:
            sizes.append(tangents[i - 1])
    if len(points) < 2:
        return Waypoints(np.array(points), np.zeros(0), ())
    sizes = sizes[len(sizes) - (len(points) - 2) :]
    turn = turns(np.array(points)).tolist()
    bends = [i for i, angle in enumerate(turn) if angle >= STRAIGHT]
    points = [points[0], *(points[i + 1] for i in bends), points[-1]]
    points, sizes = _divided(cell, points, [sizes[i] for i in bends])
    bounds = tuple(_bounds(cell, a, b, carried) for a, b in pairwise(points))
    return Waypoints(np.array(points), np.array(sizes, dtype=float), bounds)


def homewards(cell: Workcell, point: Vector) -> Waypoints:
    """From a tool point, base frame (3,) [m], straight up to a safe height, then over to home."""
    home = np.asarray(cell.settings.home, dtype=float)
    above = np.array([point[0], point[1], min(point[2], home[2])])
    return polygon(cell, np.array([point, above, home]), [0.0], None)


def _heights(share: Vector, needed: Vector, arc: Arc, settings: MotionSettings) -> tuple[float, float]:
    """Heights at both ends of the way over, as low as what it passes over admits.

    From high above it begins with the way down to the target; else both ends are balanced: the line lies on the
    highest edge of the hull of all that is needed, half way.
    """
    lift = settings.lift if arc.carried is not None else 0.0
    least_first, least_last = arc.start[2] + lift, arc.end[2] + (0.0 if arc.drops else lift)
    inner, asked = share[1:-1], needed[1:-1]
    if arc.start[2] >= asked[0] and not lift:
        first = arc.start[2]
        last = float(((asked - (1.0 - inner) * first) / inner).max(initial=least_last))
        if last <= first or last <= least_last:
            return first, last
    if arc.end[2] >= asked[-1] and not lift:
        last = arc.end[2]
        first = float(((asked - inner * last) / (1.0 - inner)).max(initial=least_first))
        if first <= last or first <= least_first:
            return first, last
    heights = np.array(needed)
    heights[0], heights[-1] = max(heights[0], least_first), max(heights[-1], least_last)
    slope, half = _crest(share, heights)
    return max(half - 0.5 * slope, least_first), max(half + 0.5 * slope, least_last)


@compiled
def _rises_above(share: FloatArray, heights: FloatArray, i: int, j: int, k: int) -> bool:
    """Whether the middle one of three points stands out above the line of the outer two."""
    rise = (heights[j] - heights[i]) * (share[k] - share[i])
    return bool(rise > (heights[k] - heights[i]) * (share[j] - share[i]))


@compiled_as(PAIR(ROW, ROW))
def _crest(share: FloatArray, heights: FloatArray) -> tuple[float, float]:
    """The edge of the upper hull of heights over the middle of rising shares: its slope, and its height there."""
    hull, size = np.zeros(share.size, dtype=np.int64), 0
    for k in range(share.size):
        while size > 1 and not _rises_above(share, heights, hull[size - 2], hull[size - 1], k):
            size -= 1
        hull[size] = k
        size += 1
    after = 1
    while share[hull[after]] < 0.5:
        after += 1
    i, j = hull[after - 1], hull[after]
    slope = (heights[j] - heights[i]) / (share[j] - share[i])
    return slope, heights[i] + slope * (0.5 - share[i])


def _corner(at: Vector, needed: Vector, upright: float, height: float, slope: float, most: float) -> float:
    """How far before its point a corner may begin, between an upright line of a length and a line over the board [m].

    ``at`` are ways over the board from the corner's point, rising, (n,) [m], of which it may take half, ``needed`` the
    heights of the tool there; ``slope`` of the line over the board is positive upwards, and the answer is at most
    ``most``.
    """
    along = math.hypot(1.0, slope)
    largest = min(most, upright - _VERTICAL, 0.97 * 0.5 * float(at[-1]) * along)
    if largest < NEAR:
        return 0.0
    turn = math.acos(slope / along)  # between straight up and the line away; straight down is the same corner
    return widest_corner(at, needed, height, slope, turn, largest * _SHARES)


def _check_height(cell: Workcell, height: float, arc: Arc, share: float, others: Crowd) -> None:
    """Refuse a height above the workspace, which something needs that stands near a share of the way."""
    top = cell.table.centre_in_base[2] - float(cell.limits.centre[2] - cell.limits.half_size[2])
    if height <= top:
        return
    x, y = (a + share * (b - a) for a, b in zip(arc.start[:2], arc.end[:2], strict=True))
    if not others.pieces:
        raise PlanRefused(
            f"the path over a box needs a height of {height * 1e3:.0f} mm, the workspace ends at {top * 1e3:.0f} mm: "
            "use lower boxes or mount the robot higher"
        )
    piece = min(others.pieces, key=lambda one: math.hypot(one.x - x, one.y - y))
    raise PlanRefused(
        f"the path over the {piece.kind} on {piece.place} needs a height of {height * 1e3:.0f} mm, the workspace ends "
        f"at {top * 1e3:.0f} mm: use lower pieces or mount the robot higher"
    )


def _divided(
    cell: Workcell, corners: Sequence[list[float]], tangents: Sequence[float]
) -> tuple[list[list[float]], list[float]]:
    """Lines that lead down into the zone near the board are two: above it, the tool may go down faster."""
    near = cell.table.centre_in_base[2] - cell.table.limits.near_height
    points, sizes = [corners[0]], list[float]()
    for i, (start, end) in enumerate(pairwise(corners)):
        if start[2] < near < end[2]:
            before, after = (tangents[i - 1] if i > 0 else 0.0), (tangents[i] if i < len(tangents) else 0.0)
            length, share = math.dist(start, end), (near - start[2]) / (end[2] - start[2])
            if before + _VERTICAL < share * length < length - after - _VERTICAL:
                points.append([a + share * (b - a) for a, b in zip(start, end, strict=True)])
                sizes.append(0.0)
        points.append(end)
        if i < len(tangents):
            sizes.append(tangents[i])
    return points, sizes


def _bounds(cell: Workcell, start: list[float], end: list[float], carried: PieceShape | None) -> Bounds:
    """Of a line; slower where it goes down near the board."""
    settings, limits = cell.settings, cell.table.limits
    bounds = Bounds(min(settings.speed, limits.tool_speed), settings.acceleration, settings.jerk)
    if carried is not None:
        bounds = bounds.scaled(settings.carrying)
    near = cell.table.centre_in_base[2] - limits.near_height
    if max(start[2], end[2]) > near + NEAR and end[2] > start[2]:
        bounds = replace(bounds, downward=min(settings.downward_speed, limits.downward_speed))
    return bounds
