"""Standing up a piece that lies, with a tool that cannot turn.

The closed fingers press on its pivot edge and draw it over. A lying piece rests on the rim of its foot. The closed
fingers come down on top of that rim, just inside of its edge, press, and go outwards, away from the head, round the rim
below. Friction takes the pivot edge along, the head rises, and once the centre of mass is over the rim the piece falls
onto its foot by itself. All contacts push within the plane in which it turns, so that it may lie in any direction; no
friction of the pads against turning is in the way, as it is when a piece hangs between them.
"""

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from app.motion.arcs import Arc, Workcell, homewards, over, polygon
from app.motion.fallen.lying import Lying, Strip, in_the_strip, meets_box, standing_near
from app.motion.fallen.pivot_edge import PivotEdge, PivotSettings, circle, pivot_of, reach, sweep
from app.motion.motions import motion_of, sampled_motion
from app.motion.obstacles import Crowd, Obstacle
from app.motion.path import Vector
from app.motion.plan import BoxInTheWay, InTheWay, Motion, Plan
from app.motion.planner import Planner
from app.motion.route import Route
from app.motion.timing.reference import eased
from hardware.piece_set import PIECE_SHAPES

_USUAL: Final = PivotSettings()
_UPRIGHT: Final = 0.025
"""So far above the pivot edge the fingers come straight down [m] …"""
_FEELING: Final = 0.010
"""… and from here on slowly, feeling for it: what lies on the foot of another piece is as much higher [m]."""


class StandUpPlan(NamedTuple):
    """A plan that stands a piece up, and where its foot's centre should be afterwards, board frame (x, y) [m]."""

    plan: Plan
    stands: tuple[float, float]


def plan_upright(
    planner: Planner, lying: Lying, standing: Iterable[Obstacle], others_lying: Iterable[Lying],
    how: PivotSettings = _USUAL, lower: float = 0.0,
) -> StandUpPlan:  # fmt: skip
    """Stand a piece up where it lies, and go home.

    All pieces that stand, and others that lie, are given where they are, and ``lower`` is by how much the board is
    lower than the table says [m]. Raises ``InTheWay`` if a piece is where the fingers or the foot have to go,
    ``BoxInTheWay`` if a box is, and ``PlanRefused`` if it lies beyond the arm's workspace.
    """
    cell, shape = planner.cell, PIECE_SHAPES[lying.kind]
    pivot, others = pivot_of(shape, how), standing_near(standing, others_lying, cell.table)
    strips = _strips(cell, lying, pivot, how)
    blocking = in_the_strip(strips, others, how.margin)
    if blocking is not None:
        raise InTheWay(
            f"the {lying.called} cannot be stood up: the {blocking.kind} near {blocking.place} is where the fingers "
            "must go; move that piece away first",
            blocking,
        )
    if any(meets_box(strip, others, how.wall_margin) for strip in strips):
        raise BoxInTheWay(f"the {lying.called} lies too near to a box for the fingers to stand it up: push it away")
    begin = _tool_point(cell, lying, pivot.contact)
    low = 2.0 * shape.foot_radius
    route = feeling_down(cell, begin, low, np.asarray(planner.start, dtype=float), planner.finger, others)
    first, finger = motion_of(cell, f"onto the pivot edge of the {lying.called}", route)
    first = replace(first, touches_at=float(begin[2]) + lower)
    second = _draw_over(cell, lying, pivot, begin, how)
    end = second.samples["position"][-1].astype(float)
    back = Route(*homewards(cell, end), contact=(0.0, 0.0), finger=finger, opens=finger)
    third, _ = motion_of(cell, "home", back)
    plan = planner.plan(f"stand up the {lying.called}", [first, second, third])
    x, y = (np.array(lying.base) + pivot.stands * lying.outwards).tolist()
    return StandUpPlan(plan, (x, y))


def _tool_point(cell: Workcell, lying: Lying, edge: tuple[float, float]) -> Vector:
    """The tool, base frame (3,) [m], with the fingers' inner lower edge at a point of frame ``over``."""
    pads = cell.parameters.pads
    x, y = (np.array(lying.base) + (edge[0] + reach(pads, lying.outwards)) * lying.outwards).tolist()
    point: Vector = cell.base([(x, y, edge[1] + pads.half_height)])[0]
    return point


def room_to_stand_up(lying: Lying, others: Crowd, cell: Workcell) -> bool:
    """Whether nothing else is where the fingers or the foot have to go."""
    strips = _strips(cell, lying, pivot_of(PIECE_SHAPES[lying.kind], _USUAL), _USUAL)
    return in_the_strip(strips, others, _USUAL.margin) is None and not any(
        meets_box(strip, others, _USUAL.wall_margin) for strip in strips
    )


def _strips(cell: Workcell, lying: Lying, pivot: PivotEdge, how: PivotSettings) -> list[Strip]:
    """Where the fingers go, and where the foot comes to stand."""
    pads, out = cell.parameters.pads, lying.outwards
    block, aside = 2.0 * reach(pads, out), reach(pads, np.array([-out[1], out[0]]))
    base, foot = np.array(lying.base), PIECE_SHAPES[lying.kind].foot_radius
    strips = [
        Strip(_xy(base + edge * out), out, block, aside, max(0.0, up - how.margin)) for edge, up in sweep(pivot, how)
    ]
    return [*strips, Strip(_xy(base + pivot.stands * out), out, 0.0, 0.0, around=foot)]


def _xy(point: Vector) -> tuple[float, float]:
    x, y = point.tolist()
    return x, y


def feeling_down(cell: Workcell, begin: Vector, top: float, start: Vector, finger: float, others: Crowd) -> Route:
    """Over to something with the fingers closing, down to it, and slowly on until it is felt.

    The tool is at ``begin`` when it touches, and now at ``start``, both base frame (3,) [m]; the thing is as high as
    ``top`` over the board [m].
    """
    x, y, height = cell.board(begin)
    low = top + cell.parameters.pads.half_height + cell.settings.clearance
    above, end = (x, y, height + _UPRIGHT), (x, y, height + _FEELING)
    way = over(cell, Arc(cell.board(start), above, low, None, finger), others)
    down = polygon(cell, cell.base([above, end]), [], None)
    return Route(
        np.concatenate([way.points, down.points[1:]]), np.append(way.tangents, 0.0), (*way.bounds, *down.bounds),
        contact=(0.0, height), finger=finger, opens=0.0, touches=True,
    )  # fmt: skip


def _draw_over(cell: Workcell, lying: Lying, pivot: PivotEdge, begin: Vector, how: PivotSettings) -> Motion:
    """Press, go round the rim, on outwards, and wait until the piece stands still."""
    tick, mass = cell.tick, cell.parameters.inertia.moving_platform_mass
    stiffness = mass * how.frequency**2
    ticks = [math.ceil(time / tick) for time in (how.pressing_time, how.turning_time, how.leaving_time)]
    press = np.zeros((ticks[0], 2, 3))
    press[:, 0, 0] = pivot.contact[0]
    press[:, 1] = -how.press / stiffness * eased(ticks[0], tick)
    press[:, 1, 0] += pivot.contact[1]
    turn = circle(pivot, how, stiffness, ticks[1], tick)
    share = eased(ticks[2], tick)
    leave = np.zeros((ticks[2], 2, 3))
    leave[:, 0] = how.away * share
    leave[:, 1] = (max(how.lowest, turn[-1, 1, 0]) + how.rise - turn[-1, 1, 0]) * share
    leave[:, :, 0] += turn[-1, :, 0]
    way = np.concatenate([press, turn, leave])
    away = np.array([lying.outwards[0], -lying.outwards[1], 0.0])  # in the base frame: x = z₁, y = −z₂
    down = np.array([0.0, 0.0, 1.0])
    outwards, upwards = way[:, 0], way[:, 1]
    table = np.zeros((len(way), 9))
    for part in range(3):
        table[:, 3 * part : 3 * part + 3] = np.outer(outwards[:, part], away) - np.outer(upwards[:, part], down)
    table[:, 0:3] += begin - pivot.contact[0] * away + pivot.contact[1] * down
    upright = _frequencies(cell, ticks, 1 + len(table) + math.ceil(how.settling_time / tick), how)
    label = f"draw the {lying.called} over its pivot edge"
    return sampled_motion(cell, label, table, begin, how.settling_time, upright)


def _frequencies(cell: Workcell, ticks: list[int], count: int, how: PivotSettings) -> Vector:
    """Height as soft as at a touch in the beginning, then so that forces are as planned, and stiff on the way out."""
    gains = cell.settings.gains
    knots = np.array([0.0, ticks[0], ticks[0] + ticks[1], sum(ticks)])
    values = np.array([gains.frequency_at_contact, how.frequency, how.frequency, gains.frequency_in_air])
    upright: Vector = np.interp(np.arange(float(count)), knots, values)
    return upright
