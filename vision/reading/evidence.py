"""What a look says for and against positions: every placement of pieces is a hypothesis, and squares speak one by one.

For each square there is a likelihood of its three states by its looks, and odds that its content has changed since the
last position that is known. A position's score is the sum over its squares, in natural logarithms; differences between
scores are what counts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import chess
import numpy as np
from numpy.typing import NDArray

from vision.arrays import Array, Indices, Mask
from vision.reading.appearance import BLACK, EMPTY, WHITE
from vision.reading.features import BOUND

Codes = NDArray[np.int8]  # pieces by square: 0 empty, 1 to 6 white pawn to king, -1 to -6 black; shape (..., 64)
NUDGE: Final = -4.0
"""Nothing that looks changed counts for more than this against the same piece, or none, still being there: people brush
past pieces, and shadows wander."""
HARD_TO_SEE: Final = -2.0  # no look that is unchanged behind another piece counts for more against a change
BESIDE_DEPTH: Final = 0.5
"""What looks count for where depth tells a state: they see what lies behind a piece as well, and depth does not."""
ALTERED: Final = 4.0  # above such odds of a change another piece may stand there, if nothing else shows it [nat]
PASSED: Final = 0.05
"""Where more than this has come to be hidden by measurement, or is hidden no more, a change of looks says nothing."""
SURE: Final = 0.9  # with less probability a square may well be something else; far less where another piece hides it
MOSTLY: Final = 0.4  # a square of whose middle more than this is hidden looks like what hides it
COVERED: Final = 0.15  # a square of whose middle another piece covers more than this is not seen as it is


HIGH: Final = np.array([-1, 0, 1, 1, 1, 2, 2])
"""Which of ``vision.reading.visibility.HEIGHTS`` a piece has, by code without its sign; -1: there is none."""


@dataclass(frozen=True, slots=True, eq=False)
class Cover:
    """How much of each square's middle the picture does not show, as depth has measured it: shares, shape (64,)."""

    now: Array  # something that stands elsewhere hides so much
    before: Array  # so much was hidden in the picture that this one is compared with
    differs: Array  # so much was hidden in one of the two pictures alone


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """What one look says."""

    states: Array  # logarithm of how likely empty, white and black are by looks, shape (64, 3), at most 0
    changed: Array  # logarithm of the odds that the content has changed, shape (64,)
    cover: Array
    """Share of the squares (columns) that a piece on a square (rows) covers, shape (64, 64); or one of these for each
    of the heights of ``HIGH``, (3, 64, 64)."""
    solid: Array | None = None  # as ``states``, by depth: no piece hides another; None: the camera has none
    measured: Cover | None = None  # what hides squares, by depth, in place of ``cover``

    def read(self, before: Codes) -> Indices:
        """The likeliest state of each square by its looks and by whether it has changed, whatever the rules: (64,)."""
        return np.asarray(self._each(before, before).argmax(axis=1))

    def likelihood(self, before: Codes) -> Array:
        """How likely each square is empty, white or black, by the same: shape (64, 3), rows that sum to one."""
        each = self._each(before, before)
        weights = np.exp(each - each.max(axis=1, keepdims=True))
        return np.asarray(weights / weights.sum(axis=1, keepdims=True))

    def _each(self, codes: Codes, before: Codes) -> Array:
        """How well states explain each square, the others being as a position says: natural logarithms, (64, 3)."""
        looks, did, kept = (one[0] for one in self._terms(codes[None], before))
        as_before = np.arange(3) == states_of(before)[:, None]
        return np.asarray(looks + np.where(as_before, kept[:, None], did[:, None]))

    def unsure(self, before: Codes) -> tuple[int, ...]:
        """Squares whose state may well be another one than ``read`` says."""
        return tuple(int(square) for square in np.flatnonzero(self.likelihood(before).max(axis=1) < SURE))

    def altered(self, before: Codes) -> tuple[int, ...]:
        """Squares whose piece looks changed though nothing hides it: perhaps another of its side; the most first."""
        changed = (self.read(before) == states_of(before)) & (before != 0) & (self.changed > ALTERED)
        if self.measured is not None:
            changed &= ~self._passed(self.measured)
        squares = np.flatnonzero(changed)
        return tuple(int(square) for square in squares[np.argsort(-self.changed[squares], kind="stable")])

    def scores(self, codes: Codes, before: Codes) -> Array:
        """How well positions (n, 64) explain the look after the last known one (64,), square by square: natural
        logarithms (n, 64), at most 0.
        """
        looks, did, kept = self._terms(codes, before)
        return np.take_along_axis(looks, states_of(codes)[..., None], axis=2)[..., 0] + np.where(
            codes != before, did, kept
        )

    def doubt(self, codes: Codes, before: Codes) -> Array:
        """By how much other states explain each square better than a position (64,) does, everything else being as it
        says: natural logarithms (64, 3), minus infinity for the position's own states.
        """
        states = states_of(codes)
        doubt: Array = self._each(codes, before) - self.scores(codes[None], before)[0][:, None]
        doubt[np.arange(64), states] = -np.inf
        return doubt

    def _terms(self, codes: Codes, before: Codes) -> tuple[Array, Array, Array]:
        """Likelihood of states, of a change and of none, for each square as the pieces around it let it be seen.

        Shapes (n, 64, 3), (n, 64), (n, 64).
        """
        if self.measured is None:
            taller = np.where(HIGH[np.abs(codes)] >= HIGH[np.abs(before)], codes, before)
            differs = self._covered(np.where(codes != before, taller, 0)) > COVERED
            once = self.hidden(before)
        else:
            differs = np.broadcast_to(self._passed(self.measured), codes.shape)
            once = self.measured.before
        hidden = np.minimum(self.hidden(codes), 1.0)
        shown = np.maximum(1.0 - hidden / MOSTLY, 0.0)
        if self.measured is None:  # what a move has done must be seen, as far as it can be
            shown = np.where(codes != before, 1.0 - hidden, shown)
        looks = self.states * shown[..., None]
        if self.solid is not None:
            looks = self._weight() * looks + self.solid
        # what has come to hide a square, or does so no more, changes its looks whether or not its content has changed
        either = np.log(0.5)
        did = np.where(np.maximum(hidden, once) > COVERED, HARD_TO_SEE, -BOUND)
        did = np.maximum(-np.logaddexp(0.0, -self.changed), did)
        did = np.where(differs, np.minimum(did, either), did)
        kept = np.where(differs, either, NUDGE)
        kept = np.maximum(-np.logaddexp(0.0, self.changed), kept)
        return looks, did, kept

    def _passed(self, measured: Cover) -> Mask:
        """Squares whose looks may well change without their content: shape (64,)."""
        most = np.maximum(measured.now, measured.before)
        # what hides a part of a square may change its looks and not move
        return (measured.differs > PASSED) | ((most > COVERED) & (self.changed > 0.0))

    def _weight(self) -> Array:
        """What looks count for beside depth: in full where it says nothing, shape (64, 1)."""
        if self.solid is None:
            return np.ones((64, 1))
        told = 1.0 - np.exp(np.partition(self.solid, 1, axis=1)[:, 1:2])
        return 1.0 - (1.0 - BESIDE_DEPTH) * told

    def hidden(self, codes: Codes) -> Array:
        """Share of each square's middle that other pieces of a position cover, or that is measured: shape (..., 64)."""
        if self.measured is not None:
            return np.broadcast_to(np.where(self.measured.now > COVERED, self.measured.now, 0.0), codes.shape)
        hidden = self._covered(codes)
        return np.where(hidden > COVERED, hidden, 0.0)

    def _covered(self, codes: Codes) -> Array:
        """Share of each square's middle that pieces on the other squares cover: shape (..., 64)."""
        high, layers = HIGH[np.abs(codes)], np.broadcast_to(self.cover, (HIGH.max() + 1, 64, 64))
        return np.asarray(sum((high == k).astype(float) @ layer for k, layer in enumerate(layers)) - (high >= 0))


def codes_of(board: chess.BaseBoard) -> Codes:
    """The pieces of a position."""
    kinds = (board.pawns, board.knights, board.bishops, board.rooks, board.queens, board.kings)
    sets = [kind & side for side in (board.occupied_co[chess.WHITE], board.occupied_co[chess.BLACK]) for kind in kinds]
    bits = np.unpackbits(np.array(sets, dtype="<u8").view(np.uint8), bitorder="little").reshape(12, 64)
    return _CODES @ bits.astype(np.int8)


_CODES: Final = np.array([1, 2, 3, 4, 5, 6, -1, -2, -3, -4, -5, -6], dtype=np.int8)


def states_of(codes: Codes) -> Indices:
    """Empty, white or black for each square."""
    return np.where(codes > 0, WHITE, np.where(codes < 0, BLACK, EMPTY))
