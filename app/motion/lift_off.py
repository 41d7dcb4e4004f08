"""Up from what holds the tool up: the reference, which is below it, comes to the tool before the arm moves off."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from app.motion.arcs import Workcell
from app.motion.fallen.pivot_edge import eased
from app.motion.path import Vector
from app.motion.plan import Motion
from app.motion.timing.reference import Segment, dwell, join, to_samples

_TIME: Final = 0.4
"""For the way, and as long again at its end: the tool, as soft as it is, comes to rest [s]."""


def loosened(cell: Workcell, start: Vector, tool: Vector) -> Motion:
    """As soft in height as at a touch, slowly, and nowhere but up.

    Args:
        cell: what is moved.
        start: the arm's present reference, base frame (3,) [m].
        tool: where the tool is held, base frame (3,) [m].
    """
    tick, gains = cell.tick, cell.settings.gains
    share = eased(math.ceil(_TIME / tick), tick)
    way = np.array([0.0, 0.0, min(0.0, float(tool[2] - start[2]))])  # z₃ points down
    table = np.hstack([np.outer(share[:, part], way) for part in range(3)])
    table[:, 0:3] += start
    path = join([dwell(start, 1), Segment(table), dwell(start + way, math.ceil(_TIME / tick))])
    stiff, soft, double = gains.frequency_in_air, gains.frequency_at_contact, 2.0 * gains.damping_ratio
    rows = np.tile([stiff**2, stiff**2, soft**2, double * stiff, double * stiff, double * soft], (len(path), 1))
    samples = to_samples(path, rows, np.zeros(len(path)))
    samples.flags.writeable = False
    return Motion("up from what was touched", samples, (len(path) - 1) * tick, continuation=cell.continuation())
