"""Whether a square's content has changed between two sights, as logarithm of odds.

Two measures: how much brightness and colour have changed, and how much of the gradients has. Light, exposure and soft
shadows change the first over the whole board; gradients stay where things stay. Both are compared with the board's own
median, since few squares change at a time: noise, blur and a slight shake of the camera are in it.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from vision.loops import changes
from vision.reading.features import Light
from vision.reading.rectified_view import MARGIN, SQUARE_PX

Array = NDArray[np.float64]

MIDDLE: Final = 0.8
"""Share of a square's side that is compared: its edges are where neighbours and a shake show."""
BOUND: Final = 8.0
"""No square counts for more than this, in natural logarithms."""
WEIGHTS: Final = (1.3, 4.3, 3.0, 2.9)
OFFSET: Final = -0.1
"""Logistic regression over the measures below, fitted to photographs of six games on four boards; fitted without a game
and tried on it, the weights change little and the errors do not."""


def change_measures(light: Light, reference: Light) -> Array:
    """Change of colour and of gradients, each relative to the board's median and as it is: shape (64, 4).

    Args:
        light: of the sight, as if it had the exposure of the reference.
        reference: of the earlier one.
    """
    edge = round(0.5 * (1.0 - MIDDLE) * SQUARE_PX)
    colour, moved, size = changes(
        light.level, reference.level, light.slopes, reference.slopes, light.size, reference.size,
        MARGIN * SQUARE_PX, SQUARE_PX, edge,
    ).T  # fmt: skip
    colour, turned = np.log(colour + 0.01), np.log(moved / (size + 0.01) + 0.02)
    return np.stack([colour - np.median(colour), turned - np.median(turned), colour, turned], axis=1)


def change_odds(light: Light, reference: Light) -> Array:
    """Logarithm of the odds that a square's content has changed: shape (64,), within ±``BOUND``."""
    odds: Array = np.clip(change_measures(light, reference) @ np.array(WEIGHTS) + OFFSET, -BOUND, BOUND)
    return odds
