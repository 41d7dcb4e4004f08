"""The time law along a path, warped until it is as quick as the bounds allow.

Given is a way s(u) along the path, cubic between nodes, and it is sought how fast u runs: u̇² = b(u). `limits` says what
the bounds are for b, `interior_point` finds the quickest. Every result obeys the bounds at the nodes, however early it
stops; by what they are exceeded between them, some tenths of a percent, `excess` finds.
"""

from __future__ import annotations

import numpy as np

from app.motion.path import Vector
from app.motion.timing.interior_point import minimise
from app.motion.timing.limits import LOOKS, excess, gather

SPARE = 0.8
"""The refinement begins so much slower than the bounds admit."""
_FIRST_LOOKS = 2
"""Parts of an interval at whose ends the bounds are looked at in the beginning."""


def quickest(path: Vector, bounds: Vector, rows: Vector, end_rate: float, gap: float) -> float:
    """The quickest b(u) within all bounds at the nodes.

    Args:
        path: `Path.table`.
        bounds: of each piece: speed, acceleration, jerk, downward speed, (p, 4).
        rows: intervals, columns as of `curves.ROWS`, with b = 1; out: b.
        end_rate: u̇ at the end, where there is no acceleration; it must be within all bounds everywhere. 0: at rest,
            whatever u does.
        gap: how far from the optimum the result may be, as a share of the duration.

    Returns:
        What `excess` does.
    """
    begin = end_rate or SPARE / excess(path, bounds, rows, _FIRST_LOOKS)
    caps, where, table = np.empty((len(rows), 2)), np.empty((9 * len(rows), 2)), np.empty((9 * len(rows), 5))
    count = gather(path, bounds, rows, caps, where, table)
    minimise(rows, caps, where[:count], table[:count], begin * begin, gap, end_rate > 0.0)
    return excess(path, bounds, rows, LOOKS)
