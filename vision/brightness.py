"""Logarithmic brightness: light that is twice as strong adds the same everywhere."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

DARKEST: Final = 0.08
"""Added to brightness (0 to 1) before its logarithm: below it there is more noise than picture."""
LOGARITHM: Final[NDArray[np.float32]] = np.log(np.arange(256) / 255.0 + DARKEST).astype(np.float32)
"""By the level of a pixel, 0 to 255."""
