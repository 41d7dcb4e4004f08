"""How high the board is: the closed fingers come down on a free spot of it until they touch.

Everything else that is put down or taken does not tell: a piece is grasped where it stands, so that it stands again
where the tool is at the same height, however low the board is.
"""

import math
from collections.abc import Iterable
from typing import Final, NamedTuple

import chess
import numpy as np

from app.motion.fallen.lying import Lying, Strip, in_the_strip, standing_near
from app.motion.fallen.pivot_edge import reach
from app.motion.fallen.stand_up import feeling_down
from app.motion.motions import motion_of
from app.motion.obstacles import Obstacle
from app.motion.plan import Plan, PlanRefused
from app.motion.planner import Planner
from hardware.table import square_place

MARGIN: Final = 0.006
"""The fingers keep so far from all pieces [m]."""


class FeelPlan(NamedTuple):
    """A plan that ends where the board is felt, and how low the tool is then if the board is as believed, z₃ [m]."""

    plan: Plan
    expected: float


def plan_feeling(
    planner: Planner, near: tuple[float, float], standing: Iterable[Obstacle], lying: Iterable[Lying]
) -> FeelPlan:
    """Come down on the middle of the square that is nearest to a point, board frame [m], and free of pieces that stand
    and lie. Raises ``PlanRefused`` if the arm gets down on none.
    """
    cell = planner.cell
    others, pads = standing_near(standing, lying, cell.table), cell.parameters.pads
    along = np.array([1.0, 0.0])
    half, aside = reach(pads, along), reach(pads, np.array([0.0, 1.0]))
    squares = [cell.table.xy(square_place(square)) for square in chess.SQUARES]
    for x, y in sorted(squares, key=lambda at: math.dist(at, near)):
        if in_the_strip([Strip((x - half, y), along, 2.0 * half, aside)], others, MARGIN) is not None:
            continue
        begin = cell.base([(x, y, pads.half_height)])[0]
        try:
            route = feeling_down(cell, begin, 0.0, np.asarray(planner.start, dtype=float), planner.finger, others)
            motion, _ = motion_of(cell, "down onto the board", route)
        except PlanRefused:
            continue
        return FeelPlan(planner.plan("feel how high the board is", [motion]), float(begin[2]))
    raise PlanRefused("no square is free for the fingers to feel how high the board is")
