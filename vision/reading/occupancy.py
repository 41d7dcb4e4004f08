"""What stands on a square, by depth: whether something does, and of which colour it is.

Something stands there if points of the square stand up; nothing does if a piece would have been seen
(:mod:`vision.reading.visibility`). Where neither is so, depth says nothing. Its colour is told by the colour of just
the points that stand up, so that neither light and dark squares nor pieces behind and before it matter. How many points
stand up by error, and the colours, are learnt from positions that are known.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from vision.arrays import Array, Indices, Mask
from vision.reading.appearance import BLACK, EMPTY, MEMORY, WHITE
from vision.reading.solids import Solids

BOUND: Final = 8.0  # neither counts for more than this, in natural logarithms
LEAST_SPREAD: Final = 0.02
"""Standard deviation of the share of standing points over an empty square that is allowed for at least: edges of
neighbours, points that fly. Of a pawn's square a fourth stands up where all of it is seen."""
LEAST_SHADE: Final = 0.25
"""Standard deviation of a piece's brightness that is allowed for at least, logarithmic: light varies over the board."""
ENOUGH: Final = 12  # standing points with which a colour is fully believed
FEW: Final = 0.25
"""Shares are of at least so many points, in those of an average square: of a square that is hardly seen, a few say
little."""
ABOVE: Final = 0.1  # where a larger share of points is above any piece, fingers may be what stands up
HARDLY: Final = 0.2  # a piece of whose square less than this is hidden shows its colour …
MOSTLY: Final = 0.4
"""… and where more than this is hidden it shows a rim past another piece. Depth is fat at edges: where it shows a rim,
the picture shows what lies behind."""
LITTLE: Final = 0.1  # so little does its colour count then: it tells only where nothing else does


class DepthOccupancy:
    """Learns errors and colours of points, and tells states by them."""

    def __init__(self) -> None:
        self._error = _Two(1)
        self._colour = _Two(3)

    def learn(self, solids: Solids, states: Indices) -> None:
        """Take in a position that is known; states of the squares, shape (64,)."""
        free = ~_reached(solids)
        none = np.zeros(64, dtype=np.bool_)
        self._error.learn(_share(solids)[:, None], free & (states == EMPTY), none)
        solid = free & (solids.standing >= ENOUGH) & (_shown(solids) == 1.0)
        self._colour.learn(solids.colour, solid & (states == WHITE), solid & (states == BLACK))

    def likelihood(self, solids: Solids) -> Array:
        """Logarithm of how likely empty, white and black are: shape (64, 3).

        0 for the likeliest; 0 for all until a position is known.
        """
        if not self._error.known:
            return np.zeros((64, 3))
        reached = _reached(solids)
        stands = np.where(reached, 0.0, self._error.surprise(_share(solids)[:, None], LEAST_SPREAD))
        # what stands up explains itself; otherwise a piece must have had room to stand unseen
        unseen = np.log(solids.room + np.exp(-BOUND))
        unseen = np.where(reached & (solids.standing > 0), 0.0, unseen)
        occupied = np.clip(stands + unseen, -BOUND, BOUND)
        believed = np.where(reached, 0.0, np.minimum(solids.standing / ENOUGH, 1.0))
        black = believed * _shown(solids) * self._colour.odds(solids.colour, LEAST_SHADE)
        likelihood = np.zeros((64, 3))
        likelihood[:, WHITE] = occupied - np.maximum(black, 0.0)
        likelihood[:, BLACK] = occupied + np.minimum(black, 0.0)
        likelihood -= likelihood.max(axis=1, keepdims=True)
        return likelihood


def _share(solids: Solids) -> Array:
    """Of the points over each square those that stand up."""
    least = max(FEW * float(solids.seen.mean()), 1.0)
    return np.asarray(solids.standing / np.maximum(solids.seen - solids.above, least))


def _shown(solids: Solids) -> Array:
    """How much the colour of what stands on each square counts, 0 to 1."""
    hidden = solids.other.mean(axis=1)
    return np.asarray(np.clip((MOSTLY - hidden) / (MOSTLY - HARDLY), LITTLE, 1.0))


def _reached(solids: Solids) -> Mask:
    """Whether a hand may reach into a square."""
    return solids.above > ABOVE * np.maximum(solids.seen, 1)


class _Two:
    """Two normal distributions with a common spread in each dimension."""

    def __init__(self, size: int) -> None:
        self._count = np.zeros(2)
        self._mean = np.zeros((2, size))
        self._scatter = np.zeros(size)

    def learn(self, values: Array, first: Mask, second: Mask) -> None:
        self._count *= MEMORY
        self._scatter *= MEMORY
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
        return np.asarray(np.clip(0.5 * (off[:, 0] - off[:, 1]), -BOUND, BOUND))

    @property
    def known(self) -> bool:
        """Whether there has been a first value."""
        return bool(self._count[0])

    def surprise(self, values: Array, least: float) -> Array:
        """Logarithm of how much less likely than the mean of the first values above it are: shape (n,), 0 to twice
        ``BOUND``. The first must be known.
        """
        spread = np.sqrt(np.maximum(self._scatter / self._count[0], least**2))
        above = np.maximum((values - self._mean[0]) / spread, 0.0)
        return np.asarray(np.minimum(0.5 * (above**2).mean(axis=1), 2.0 * BOUND))
