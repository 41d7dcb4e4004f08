"""What torques come to over the time in which a servomotor warms up."""

from __future__ import annotations

from typing import Final

import numpy as np

from app.motion.path import Vector

WINDOW: Final = 10.0
"""Over so long a time the mean square must stay within the servomotors' rating, as protection has it [s]."""


def worst_rms(torques: Vector, tick: float) -> list[float]:
    """Of each servomotor over any `WINDOW` of torques a tick [s] apart, (n, 3) [N m]; none of a shorter series."""
    window = round(WINDOW / tick)
    if len(torques) < window:
        return []
    squared = np.cumsum(np.vstack([np.zeros((1, 3)), torques**2]), axis=0)
    found: list[float] = np.sqrt((squared[window:] - squared[:-window]).max(axis=0) / window).tolist()
    return found
