"""Plans of whole plies: approach; then of each transfer grasp, carry, and release with the way to the next, or home.

A way goes up, over and down again: vertical where fingers or piece are beside others, as high as what it passes over,
with corners as wide as that leaves room for. Fingers move while the arm travels.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from app.manipulation import Inventory, Stage, Transfer
from app.motion.gains import Softness
from app.motion.obstacles import Moving, Standing, blocking_neighbour, closed_position, needed_heights, standing
from app.motion.path import STRAIGHT, Vector, corner_points, turns
from app.motion.plan import Motion, Plan, PlanRefused, Style
from app.motion.route import NEAR, Route, Timed, timed
from app.motion.settings import MotionSettings
from app.motion.time_law import Bounds
from app.motion.torque import peak_torque
from controller.safety import Limits, default_limits
from hardware.parameters import RobotParameters
from hardware.table import PIECE_SHAPES, Kind, PieceShape, Place, TableSettings

_STEP = 0.0015
"""Ways over the board are looked at so closely [m]."""
_ASIDE = 0.001
"""A tool that is less than this beside a place is over it [m]."""
_SHARES = np.array([1.0, 0.85, 0.7, 0.55, 0.42, 0.3, 0.2, 0.12, 0.06])
"""Sizes of a corner that are tried, as shares of the largest."""
_ATTEMPTS = 6
"""So often a motion is slowed down until its torques are feasible."""
_VERTICAL = 0.003
"""The first bit of a way up and the last one of a way down is vertical [m]."""


@dataclass(frozen=True, slots=True)
class _Rig:
    settings: MotionSettings
    parameters: RobotParameters
    table: TableSettings
    limits: Limits

    @property
    def tick(self) -> float:
        return self.parameters.drive.tick

    @property
    def tip(self) -> float:
        return self.parameters.pads.half_height

    def base(self, x: float, y: float, height: float) -> Vector:
        """Tool point with the pads' centre at a height over a point of the board."""
        return self.table.base_from_board(np.array([x, y, height]))

    def board(self, point: Vector) -> Vector:
        return self.table.board_from_base(point)

    def motion(self, label: str, route: Route, transfer: int, stage: Stage) -> tuple[Motion, float]:
        """Time a route; with it where the fingers are in the end."""
        self._check(label, route)
        route, done = self._within_torque(label, route)
        motion = Motion(
            label, done.samples, done.expected, grips=route.grips, touches=route.touches, route=route,
            paths=done.paths, transfer=transfer, stage=stage,
        )  # fmt: skip
        return motion, done.finger

    def _within_torque(self, label: str, route: Route) -> tuple[Route, Timed]:
        """Timed, with slower accelerations where the drives could not follow otherwise."""
        limit = self.settings.torque_share * self.parameters.drive.peak_torque
        for _ in range(_ATTEMPTS):
            done = timed(route, self.settings, self.table, self.tick)
            if not route.bounds:
                return route, done
            peak, still = peak_torque(done.samples, self.parameters)
            if peak <= limit:
                return route, done
            share = 0.98 * max(limit - still, 0.1 * limit) / (peak - still)
            route = replace(route, bounds=tuple(bounds.scaled(share) for bounds in route.bounds))
        raise PlanRefused(
            f"{label} takes {peak:.1f} N m, the drives have {limit:.1f} N m for it, and holding still takes "
            f"{still:.1f} N m: move the board closer to the robot"
        )

    def _check(self, label: str, route: Route) -> None:
        """Every corner of the way lies in the workspace: with it the whole way, which is in their hull."""
        limits = self.limits
        for point in route.points[1:].tolist():
            x, y, height = self.board(np.array(point)).tolist()
            where = f"{label}: the way leads over ({x * 1e3:.0f}, {y * 1e3:.0f}) mm at {height * 1e3:.0f} mm"
            reach = float(np.hypot(point[0], point[1]))
            if reach > limits.reach:
                raise PlanRefused(
                    f"{where}, {reach * 1e3:.0f} mm from the robot's axis, which reaches {limits.reach * 1e3:.0f} mm: "
                    "use smaller squares or move the board"
                )
            for axis in range(3):
                value, centre, half = point[axis], limits.centre[axis], limits.half_size[axis]
                if abs(value - centre) > half:
                    raise PlanRefused(
                        f"{where}, where z{axis + 1} is {value * 1e3:.0f} mm; the workspace ends {half * 1e3:.0f} mm "
                        f"from {centre * 1e3:.0f} mm: use smaller squares or pieces, or move the board"
                    )


class _Hop(NamedTuple):
    """A way from one point of the board to another; heights of the tool over the board [m].

    Attributes:
        start: (x, y), height.
        end: (x, y), height.
        least: on the way between [m].
        carried: piece in the fingers.
        opening: how far the fingers are open [m].
    """

    start: tuple[float, float, float]
    end: tuple[float, float, float]
    least: float
    carried: PieceShape | None
    opening: float


def plan_ply(
    label: str,
    transfers: Sequence[Transfer],
    inventory: Inventory,
    start: Vector,
    finger: float,
    settings: MotionSettings,
    parameters: RobotParameters,
    lead_ticks: int = 0,
    *,
    holding: bool = False,
    low: bool = False,
) -> Plan:
    """Plan all transfers of a ply, or what is left of them, from where the arm rests to home.

    Args:
        label: the move, for people.
        transfers: in order of execution.
        inventory: what stands where before the ply.
        start: the arm's present reference, base frame (3,) [m].
        finger: present finger position [m].
        settings: speeds, gains, heights.
        parameters: robot.
        lead_ticks: pause between motions, for announcing the next one.
        holding: the first transfer's piece is in the fingers already.
        low: the fingers may still be around a piece that stands: they open before the arm moves.

    Raises:
        PlanRefused: open fingers would touch a neighbour, or a way leads out of the workspace.
    """
    table = inventory.table
    rig = _Rig(settings, parameters, table, default_limits(parameters, table))
    motions: list[Motion] = []
    point = np.asarray(start, dtype=float)
    stands = {piece.name: standing([(piece.place, piece.kind)], table)[0] for piece in inventory}
    for index, transfer in enumerate(transfers):
        others = _others(stands, transfer)
        if index == 0 and not holding:
            route = _approach(rig, transfer, others, point, finger, low=low)
            motion, finger = rig.motion(f"to {transfer.source}", route, index, Stage.APPROACH)
            motions.append(motion)
            point = route.points[-1]
        if index > 0 or not holding:
            route = _grasp(rig, transfer, point, finger)
            motion, _ = rig.motion(f"grasp {transfer.kind} on {transfer.source}", route, index, Stage.GRASP)
            motions.append(replace(motion, expected=_grip_time(rig, transfer, finger)))
        route = _carry(rig, transfer, others, point, fresh=index > 0 or not holding)
        carried = f"{transfer.kind} {transfer.source} to {transfer.target}"
        motion, _ = rig.motion(carried, route, index, Stage.CARRY)
        motions.append(motion)
        point = rig.base(*table.xy(transfer.target), PIECE_SHAPES[transfer.kind].grip_height)
        stands[transfer.name] = standing([(transfer.target, transfer.kind)], table)[0]
        following = transfers[index + 1] if index + 1 < len(transfers) else None
        route = _release(rig, transfer, following, stands, point)
        where = "home" if following is None else f"to {following.source}"
        motion, finger = rig.motion(f"release {transfer.kind}, {where}", route, index, Stage.RELEASE)
        motions.append(motion)
        point = route.points[-1]
    return Plan(label, tuple(motions), lead_ticks * rig.tick, Style(settings, table, rig.tick))


def plan_return(
    start: Vector,
    finger: float,
    settings: MotionSettings,
    parameters: RobotParameters,
    table: TableSettings,
    release: Kind | None = None,
) -> Plan:
    """From anywhere to home: straight up to a safe height first, then over.

    Args:
        start: the arm's present reference, base frame (3,) [m].
        finger: present finger position [m].
        settings: speeds, gains, heights.
        parameters: robot.
        table: board and trays.
        release: the fingers open from a piece of this kind, which stands, before the arm moves; None: they stay.
    """
    rig = _Rig(settings, parameters, table, default_limits(parameters, table))
    point, home = np.asarray(start, dtype=float), np.asarray(settings.home, dtype=float)
    above = np.array([point[0], point[1], min(point[2], home[2])])
    opens = finger if release is None else max(finger, _least_opening(rig, release))
    wait = (opens - finger) / settings.grip.opening_speed
    low = 0.0 if release is None else PIECE_SHAPES[release].grip_height
    route = Route(
        *_polygon(rig, [point, above, home], [0.0], None), contact=(low, 0.0), finger=finger, wait=wait, opens=opens,
        soft_start=Softness.STIFF if release is None else Softness.LASTS,
    )  # fmt: skip
    motion, _ = rig.motion("home", route, 0, Stage.RETURN)
    return Plan("home", (motion,), style=Style(settings, table, rig.tick))


def _others(stands: Mapping[str, Standing], transfer: Transfer) -> tuple[Standing, ...]:
    return tuple(piece for name, piece in stands.items() if name != transfer.name)


# fingers


def _least_opening(rig: _Rig, kind: Kind) -> float:
    pads, gripper = rig.parameters.pads, rig.parameters.gripper
    position = closed_position(kind, pads) + rig.settings.grip.opening_margin
    if position > gripper.stroke:
        raise PlanRefused(
            f"a {kind} needs the fingers {position * 1e3:.1f} mm open, the gripper opens "
            f"{gripper.stroke * 1e3:.1f} mm: use thinner pieces or a wider gripper"
        )
    return position


def _opening(rig: _Rig, kind: Kind, place: Place, others: Sequence[Standing]) -> float:
    """As wide as is useful and as neighbours leave room for.

    Raises:
        PlanRefused: not even the least opening fits.
    """
    grip, pads = rig.settings.grip, rig.parameters.pads
    x, y = rig.table.xy(place)
    tip = PIECE_SHAPES[kind].grip_height - rig.tip
    least = _least_opening(rig, kind)
    widest = min(closed_position(kind, pads) + grip.widest_margin, rig.parameters.gripper.stroke)
    for opening in np.linspace(widest, least, 4).tolist():
        neighbour = blocking_neighbour(x, y, opening, tip, others, pads)
        if neighbour is None:
            return float(opening)
    assert neighbour is not None
    raise PlanRefused(
        f"at {place} the fingers, {least * 1e3:.1f} mm open, would touch the {neighbour.kind} on "
        f"{neighbour.place}: move that piece first or use larger squares"
    )


def _beside(rig: _Rig, kind: Kind) -> float:
    """Finger position beside a piece that may stand off its place, before the fingers close slowly [m]."""
    return closed_position(kind, rig.parameters.pads) + rig.settings.grip.beside


def _grip_time(rig: _Rig, transfer: Transfer, finger: float) -> float:
    """From the start of closing to the guard: the way, then the force, which grows with the gripper's and the tactile
    sensor's time constants [s].
    """
    gripper = rig.parameters.gripper
    rise = gripper.reflected_mass / gripper.velocity_gain + 1.0 / rig.parameters.tactile.bandwidth
    return (finger - closed_position(transfer.kind, rig.parameters.pads)) / rig.settings.grip.closing_speed + rise


# routes


def _approach(
    rig: _Rig, transfer: Transfer, others: Sequence[Standing], point: Vector, finger: float, *, low: bool
) -> Route:
    """Over to the piece with the fingers opening, then straight down to the grip height."""
    shape = PIECE_SHAPES[transfer.kind]
    opening = _opening(rig, transfer.kind, transfer.source, others)
    x, y, height = rig.board(point).tolist()
    wait = max(0.0, opening - finger) / rig.settings.grip.opening_speed if low else 0.0
    there = rig.table.xy(transfer.source)
    hop = _Hop((x, y, height), (*there, shape.grip_height), 0.0, None, max(opening, finger))
    around = (*others, Standing(transfer.source, *there, transfer.kind))
    return Route(
        *_over(rig, hop, point, around), contact=(shape.grip_height, shape.grip_height), finger=finger, wait=wait,
        opens=max(opening, finger) if low else opening, then=opening if low else None,
        closes=_beside(rig, transfer.kind),
    )  # fmt: skip


def _grasp(rig: _Rig, transfer: Transfer, point: Vector, finger: float) -> Route:
    """Close until both pads feel the piece."""
    height = PIECE_SHAPES[transfer.kind].grip_height
    patience = _grip_time(rig, transfer, finger) + rig.settings.grip.patience
    return Route(
        np.array([point]), np.zeros(0), (), contact=(height, height), finger=finger, wait=patience,
        soft_start=Softness.BEGINS, grips=True,
    )  # fmt: skip


def _carry(rig: _Rig, transfer: Transfer, others: Sequence[Standing], point: Vector, *, fresh: bool) -> Route:
    """Up from where it is, over, down, and slowly on until it stands."""
    settings, shape = rig.settings, PIECE_SHAPES[transfer.kind]
    x, y, height = rig.board(point).tolist()
    closed = closed_position(transfer.kind, rig.parameters.pads)
    _opening(rig, transfer.kind, transfer.target, others)
    low = shape.grip_height
    hop = _Hop(
        (x, y, height), (*rig.table.xy(transfer.target), low + settings.touch_height), low + settings.clearance, shape,
        closed,
    )  # fmt: skip
    return Route(
        *_over(rig, hop, point, others), contact=(low, low), finger=closed, wait=settings.grip.settle,
        soft_start=Softness.LASTS if fresh else Softness.STIFF, touches=True,
    )  # fmt: skip


def _release(
    rig: _Rig, transfer: Transfer, following: Transfer | None, stands: Mapping[str, Standing], point: Vector
) -> Route:
    """Open, up from the piece, and over to the next one, or home."""
    settings, table, shape = rig.settings, rig.table, PIECE_SHAPES[transfer.kind]
    pads = rig.parameters.pads
    beside = _others(stands, transfer)
    opening, closed = _opening(rig, transfer.kind, transfer.target, beside), closed_position(transfer.kind, pads)
    wait = settings.release_wait + settings.grip.freed / settings.grip.opening_speed
    wait += rig.parameters.gripper.reflected_mass / rig.parameters.gripper.velocity_gain
    here = (*table.xy(transfer.target), float(rig.board(point)[2]))
    everything = tuple(stands.values())
    if following is None:
        home = rig.board(np.asarray(settings.home)).tolist()
        end, low, then = (home[0], home[1], home[2]), 0.0, None
    else:
        low = PIECE_SHAPES[following.kind].grip_height
        then = _opening(rig, following.kind, following.source, _others(stands, following))
        end = (*table.xy(following.source), low)
    hop = _Hop(here, end, 0.0, None, max(opening, then or 0.0))
    return Route(
        *_over(rig, hop, point, everything), contact=(shape.grip_height, low), finger=closed, wait=wait, opens=opening,
        then=then, closes=None if following is None else _beside(rig, following.kind), soft_start=Softness.BEGINS,
    )  # fmt: skip


# ways


def _over(rig: _Rig, hop: _Hop, point: Vector, others: Sequence[Standing]) -> tuple[Vector, Vector, tuple[Bounds, ...]]:
    """Up, over and down: as high as it must be, with corners as wide as there is room for."""
    settings = rig.settings
    (x0, y0, z0), (x1, y1, z1) = hop.start, hop.end
    way = float(np.hypot(x1 - x0, y1 - y0))
    if way < _ASIDE:
        # there already: a carried piece comes down from above all the same, as its way ends with a touch
        top = max(z0, z1 + (settings.lift if hop.carried is not None else 0.0))
        return _polygon(rig, [point, rig.base(x1, y1, top), rig.base(x1, y1, z1)], [0.0], hop.carried)
    count = max(int(np.ceil(way / _STEP)) + 1, 5)  # also of the shortest way some points are within it
    share = np.linspace(0.0, 1.0, count)
    points = np.column_stack([x0 + share * (x1 - x0), y0 + share * (y1 - y0)])
    moving = Moving.of(rig.parameters.pads, hop.opening, hop.carried)
    needed = needed_heights(points, moving, others, settings.beside, settings.clearance)
    at = share * way
    needed[1:-1] = np.maximum(needed[1:-1], hop.least)
    needed[0], needed[-1] = min(z0, hop.least), min(z1, hop.least)  # straight over either place it may stand there
    first, last = _heights(share, needed, hop, settings)
    swing = 0.0 if hop.carried is not None else settings.swing
    first, last = (first + swing if first > z0 else first), (last + swing if last > z1 else last)
    _check_height(rig, max(first, last), needed, points, others)
    corners = [point, rig.base(x0, y0, first), rig.base(x1, y1, last), rig.base(x1, y1, z1)]
    ups, downs = first - z0, last - z1
    tangents = [
        _corner(at, needed, ups, way / 2.0, first, (last - first) / way, settings.corner),
        _corner(way - at[::-1], needed[::-1], downs, way / 2.0, last, (first - last) / way, settings.corner),
    ]
    return _polygon(rig, corners, tangents, hop.carried)


def _heights(share: Vector, needed: Vector, hop: _Hop, settings: MotionSettings) -> tuple[float, float]:
    """Heights at both ends of the way over, as low as what it passes over admits.

    From high above it begins with the way down to the target; else both ends are balanced: the line lies on the
    highest edge of the hull of all that is needed, half way.
    """
    lift = settings.lift if hop.carried is not None else 0.0
    least_first, least_last = hop.start[2] + lift, hop.end[2] + lift
    inner, asked = share[1:-1], needed[1:-1]
    if hop.start[2] >= asked[0] and not lift:
        first = hop.start[2]
        last = float(((asked - (1.0 - inner) * first) / inner).max(initial=least_last))
        if last <= first or last <= least_last:
            return first, last
    if hop.end[2] >= asked[-1] and not lift:
        last = hop.end[2]
        first = float(((asked - inner * last) / (1.0 - inner)).max(initial=least_first))
        if first <= last or first <= least_first:
            return first, last
    heights = np.array(needed)
    heights[0], heights[-1] = max(heights[0], least_first), max(heights[-1], least_last)
    slope, half = _over_the_middle(share, heights)
    first, last = half - 0.5 * slope, half + 0.5 * slope
    return max(first, least_first), max(last, least_last)


def _over_the_middle(share: Vector, heights: Vector) -> tuple[float, float]:
    """The edge of the upper hull of heights over the middle: its slope, and its height there."""
    hull: list[int] = []
    for i in range(len(share)):
        while len(hull) > 1 and _bends_up(share, heights, hull[-2], hull[-1], i):
            hull.pop()
        hull.append(i)
    after = next(k for k in range(1, len(hull)) if share[hull[k]] >= 0.5)
    i, j = hull[after - 1], hull[after]
    slope = float((heights[j] - heights[i]) / (share[j] - share[i]))
    return slope, float(heights[i] + slope * (0.5 - share[i]))


def _bends_up(share: Vector, heights: Vector, i: int, j: int, k: int) -> bool:
    """Whether the middle one of three points does not stand out above the line of the outer two."""
    rise = (heights[j] - heights[i]) * (share[k] - share[i])
    return bool(rise <= (heights[k] - heights[i]) * (share[j] - share[i]))


def _corner(
    at: Vector, needed: Vector, upright: float, level: float, height: float, slope: float, most: float
) -> float:
    """How far before its point a corner may begin, between an upright line of a length and a line over the board [m].

    Args:
        at: ways over the board from the corner's point, rising, (n,) [m].
        needed: heights the tool needs there, (n,) [m].
        upright: length of the upright line [m].
        level: way over the board that the corner may take [m].
        height: of the corner's point [m].
        slope: of the line over the board, upwards positive.
        most: the answer is not larger [m].
    """
    along = np.hypot(1.0, slope)
    largest = min(most, upright - _VERTICAL, 0.97 * level * along)
    if largest < NEAR:
        return 0.0
    turn = float(np.arccos(slope / along))  # between straight up and the line away; straight down is the same corner
    back, onwards = corner_points(turn)
    sizes = largest * _SHARES[:, None]
    aside, level_at = sizes * onwards[None] / along, height + sizes * (back[None] + onwards[None] * slope / along)
    # the points of the way that were looked at on either side; the first one is the place itself
    index = np.clip(np.searchsorted(at, aside), 1, len(at) - 1)
    wanted = np.where(aside > _ASIDE, np.maximum(needed[index], needed[np.maximum(index - 1, 1)]), 0.0)
    free = (level_at >= wanted - 1e-9).all(axis=1)
    found = np.flatnonzero(free)
    return float(sizes[found[0], 0]) if found.size else 0.0


def _check_height(rig: _Rig, height: float, needed: Vector, points: Vector, others: Sequence[Standing]) -> None:
    top = rig.table.centre_in_base[2] - (rig.limits.centre[2] - rig.limits.half_size[2])
    if height <= top:
        return
    x, y = points[int(needed.argmax())].tolist()
    piece = min(others, key=lambda one: float(np.hypot(one.x - x, one.y - y)))
    raise PlanRefused(
        f"the way over the {piece.kind} on {piece.place} needs a height of {height * 1e3:.0f} mm, the workspace ends "
        f"at {top * 1e3:.0f} mm: use lower pieces or mount the robot higher"
    )


def _polygon(
    rig: _Rig, corners: Sequence[Vector], tangents: Sequence[float], carried: PieceShape | None
) -> tuple[Vector, Vector, tuple[Bounds, ...]]:
    """Without points that coincide; with the bounds of each line."""
    points, sizes = [np.asarray(corners[0], dtype=float)], list[float]()
    for i, corner in enumerate(corners[1:], start=1):
        if np.linalg.norm(corner - points[-1]) < NEAR:
            if sizes and i == len(corners) - 1:
                sizes.pop()
            continue
        points.append(np.asarray(corner, dtype=float))
        if i < len(corners) - 1:
            sizes.append(tangents[i - 1])
    if len(points) < 2:
        return np.array(points), np.zeros(0), ()
    sizes = sizes[-(len(points) - 2) :] if len(points) > 2 else []
    polygon = np.array(points)
    straight = turns(polygon) < STRAIGHT if len(points) > 2 else np.zeros(0, dtype=bool)
    polygon, kept = polygon[np.concatenate([[True], ~straight, [True]])], np.array(sizes, dtype=float)[~straight]
    polygon, kept = _divided(rig, polygon, kept)
    return polygon, kept, tuple(_bounds(rig, a, b, carried) for a, b in pairwise(polygon))


def _divided(rig: _Rig, polygon: Vector, tangents: Vector) -> tuple[Vector, Vector]:
    """Lines that lead down into the zone near the board are two: above it, the tool may go down faster."""
    near = rig.table.centre_in_base[2] - rig.table.limits.near_height
    points, sizes = [polygon[0]], []
    for i, (start, end) in enumerate(pairwise(polygon)):
        if start[2] < near < end[2]:
            before, after = (tangents[i - 1] if i > 0 else 0.0), (tangents[i] if i < len(tangents) else 0.0)
            length = float(np.linalg.norm(end - start))
            way = (near - start[2]) / (end[2] - start[2]) * length
            if before + _VERTICAL < way < length - after - _VERTICAL:
                points.append(start + way / length * (end - start))
                sizes.append(0.0)
        points.append(end)
        if i < len(tangents):
            sizes.append(float(tangents[i]))
    return np.array(points), np.array(sizes)


def _bounds(rig: _Rig, start: Vector, end: Vector, carried: PieceShape | None) -> Bounds:
    """Of a line; slower where it goes down near the board."""
    settings, limits = rig.settings, rig.table.limits
    bounds = Bounds(min(settings.speed, limits.tool_speed), settings.acceleration, settings.jerk)
    if carried is not None:
        bounds = bounds.scaled(settings.carrying)
    near = min(float(rig.board(point)[2]) for point in (start, end)) < limits.near_height - NEAR
    if near and end[2] > start[2]:
        bounds = replace(bounds, downward=limits.downward_speed)
    return bounds
