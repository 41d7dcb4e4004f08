"""What stands on a square, by its looks: empty, white or black, learnt from positions that are known.

Nothing is known beforehand about a set of pieces. The start position shows 32 empty squares and both colours on both
shades, and every position that the rules have confirmed shows 64 squares more. What is learnt is a normal distribution
of the descriptions for each state, with one covariance for all (linear discriminant analysis), apart for light and dark
squares. The covariance is shrunk towards its diagonal, since there are about as many examples as dimensions at first.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from vision.arrays import Array, Indices

States = Indices

EMPTY, WHITE, BLACK = 0, 1, 2  # states of a square
MEMORY: Final = 0.9  # share of what was known that one more position leaves: light changes within ten plies
DIAGONAL: Final = 0.3  # how far the covariance is shrunk towards its diagonal
FLOOR: Final = 0.05  # share of its mean variance that is added to each: what has not varied yet may still
TEMPERATURE: Final = 12.0
"""Neighbouring blocks say much the same, so that squared distances overstate what is known. Measured on photographs:
with it, states given 95 % are right at least as often."""
BOUND: Final = 6.0  # no square's look counts for more than this, in natural logarithms: anything may look odd once
_LIGHT_SQUARES: Final = np.array([(square % 8 + square // 8) % 2 == 1 for square in range(64)])


class Appearance:
    """Learns looks of squares, given as descriptions of ``size`` numbers, and tells states by them."""

    def __init__(self, size: int) -> None:
        self._shades = (_Normal(size), _Normal(size))

    def learn(self, descriptions: list[Array], states: States) -> None:
        """Take in a position of known states (64,) by descriptions of one sight, (64, n) each: in place and shifted."""
        for shade, of_shade in enumerate((~_LIGHT_SQUARES, _LIGHT_SQUARES)):
            self._shades[shade].fade()
            for one in descriptions:
                self._shades[shade].add(one[of_shade], states[of_shade])

    def likelihood(self, description: Array) -> Array:
        """Logarithm of how likely each state is by the square's look: shape (64, 3).

        0 for the likeliest, at least ``-BOUND`` for the others. A state that was never seen on a shade gets 0.
        """
        likelihood = np.zeros((64, 3))
        for shade, of_shade in enumerate((~_LIGHT_SQUARES, _LIGHT_SQUARES)):
            likelihood[of_shade] = self._shades[shade].likelihood(description[of_shade])
        likelihood /= TEMPERATURE
        likelihood -= likelihood.max(axis=1, keepdims=True)
        return np.maximum(likelihood, -BOUND)


class _Normal:
    """Normal distributions of three states with a common covariance."""

    def __init__(self, size: int) -> None:
        self._count = np.zeros(3)
        self._mean = np.zeros((3, size))
        self._scatter = np.zeros((size, size))
        self._axes: Array | None = None

    def fade(self) -> None:
        self._count *= MEMORY
        self._scatter *= MEMORY

    def add(self, examples: Array, states: States) -> None:
        for state in (EMPTY, WHITE, BLACK):
            of_state = examples[states == state]
            if not len(of_state):
                continue
            total = self._count[state] + len(of_state)
            mean = of_state.mean(axis=0)
            self._mean[state] += (mean - self._mean[state]) * len(of_state) / total
            self._count[state] = total
            self._scatter += (of_state - mean).T @ (of_state - mean)
        self._axes = None

    def likelihood(self, examples: Array) -> Array:
        known = self._count > 0.0
        if not known.any():
            return np.zeros((len(examples), 3))
        if self._axes is None:
            covariance = self._scatter / self._count.sum()
            variance = np.diag(covariance)
            covariance = (1.0 - DIAGONAL) * covariance + np.diag(DIAGONAL * variance + FLOOR * variance.mean())
            self._axes = np.linalg.solve(covariance, self._mean.T)
        # with one covariance for all states, what is quadratic in the example is common to them and drops out
        offset = -0.5 * np.einsum("sj,js->s", self._mean, self._axes)
        likelihood: Array = examples @ self._axes + offset
        likelihood[:, ~known] = likelihood[:, known].max(axis=1, keepdims=True)
        return likelihood
