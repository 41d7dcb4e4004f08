"""Arrays by what they hold; shapes and units stand where each is used."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Field = NDArray[np.float32]
"""Of numbers by pixel."""
Mask = NDArray[np.bool_]
Picture = NDArray[np.uint8]
"""Bytes by pixel: RGB, (h, w, 3), where nothing else is said."""
Indices = NDArray[np.intp]
Whole = NDArray[np.int32]
"""Whole numbers: pixels, labels, bins."""


def cheapest_pairs(cost: Array) -> tuple[Indices, Indices]:
    """Rows and columns of the cheapest assignment, of costs (rows, columns); as many pairs as the fewer of them."""
    from scipy.optimize import linear_sum_assignment  # takes a third of a second to load: not before it is needed

    rows, columns = linear_sum_assignment(cost)
    return rows, columns
