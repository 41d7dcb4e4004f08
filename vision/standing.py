"""What stands on a square, by depth: whether something does, and of which colour it is.

Both are learnt from positions that are known. Whether something stands there is told by the share of a square's points
that stand up; its colour by the colour of just those points, so that neither light and dark squares nor pieces behind
and before it matter.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from vision.appearance import BLACK, EMPTY, MEMORY, WHITE
from vision.solids import Solids

Array = NDArray[np.float64]

BOUND: Final = 8.0
"""Neither counts for more than this, in natural logarithms."""
LEAST_SPREAD: Final = 0.10
"""Standard deviation of the share of standing points that is allowed for at least."""
LEAST_SHADE: Final = 0.25
"""Standard deviation of a piece's brightness that is allowed for at least, logarithmic: light varies over the board."""
ENOUGH: Final = 12
"""Points over a square with which the share is fully believed."""
ABOVE: Final = 0.1
"""Where a larger share of points is above any piece, something else is over the square, which says nothing of it."""


class Standing:
    """Learns shares and colours of points, and tells states by them."""

    def __init__(self) -> None:
        self._share = _Two(1)
        self._colour = _Two(3)

    def learn(self, solids: Solids, states: NDArray[np.intp], memory: float = MEMORY) -> None:
        """Take in a position that is known; states of the squares, shape (64,)."""
        clear = _believed(solids) > 0.99
        occupied = states != EMPTY
        self._share.learn(_share(solids)[:, None], clear & ~occupied, clear & occupied, memory)
        solid = clear & (solids.standing >= ENOUGH)
        self._colour.learn(solids.colour, solid & (states == WHITE), solid & (states == BLACK), memory)

    def likelihood(self, solids: Solids) -> Array:
        """Logarithm of how likely empty, white and black are: shape (64, 3); 0 for the likeliest."""
        believed = _believed(solids)
        occupied = believed * self._share.odds(_share(solids)[:, None], LEAST_SPREAD)
        black = believed * np.minimum(solids.standing / ENOUGH, 1.0) * self._colour.odds(solids.colour, LEAST_SHADE)
        likelihood = np.zeros((64, 3))
        likelihood[:, WHITE] = occupied - np.maximum(black, 0.0)
        likelihood[:, BLACK] = occupied + np.minimum(black, 0.0)
        likelihood -= likelihood.max(axis=1, keepdims=True)
        return likelihood


def _share(solids: Solids) -> Array:
    share: Array = solids.standing / np.maximum(solids.seen - solids.above, 1)
    return share


def _believed(solids: Solids) -> Array:
    """How far the points over each square can be believed, 0 to 1: shape (64,)."""
    free = solids.seen - solids.above
    believed: Array = np.minimum(free / ENOUGH, 1.0).astype(float) * (
        solids.above <= ABOVE * np.maximum(solids.seen, 1)
    )
    return believed


class _Two:
    """Two normal distributions with a common spread in each dimension."""

    def __init__(self, size: int) -> None:
        self._count = np.zeros(2)
        self._mean = np.zeros((2, size))
        self._scatter = np.zeros(size)

    def learn(self, values: Array, first: NDArray[np.bool_], second: NDArray[np.bool_], memory: float) -> None:
        self._count *= memory
        self._scatter *= memory
        for which, of_class in enumerate((first, second)):
            new = values[of_class]
            if len(new):
                self._count[which] += len(new)
                self._mean[which] += (new.mean(axis=0) - self._mean[which]) * len(new) / self._count[which]
                self._scatter += ((new - new.mean(axis=0)) ** 2).sum(axis=0)

    def odds(self, values: Array, least: float) -> Array:
        """Logarithm of the odds of the second: shape (n,); 0 until both are known.

        Dimensions of a colour vary together, so that their mean counts.
        """
        if not self._count.all():
            return np.zeros(len(values))
        variance = np.maximum(self._scatter / self._count.sum(), least**2)
        off = ((values[:, None, :] - self._mean) ** 2 / variance).mean(axis=2)
        odds: Array = np.clip(0.5 * (off[:, 0] - off[:, 1]), -BOUND, BOUND)
        return odds
