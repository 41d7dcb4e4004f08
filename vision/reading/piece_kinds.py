"""Which kind a piece is, by its height: asked only of pieces that have just been promoted."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import chess
import numpy as np

from vision.arrays import Array
from vision.reading.evidence import Codes
from vision.reading.moves import PROMOTIONS, MoveReading

SPREAD: Final = 0.0015
"""Standard deviation of a height as seen [m]; what a D435 errs by over a piece's head at 0.6 m."""
CLEAR: Final = 3.0  # a kind is known where every other is so many standard deviations less likely


class KindClassifier:
    """Learns how high each kind looks from positions that are known."""

    def __init__(self) -> None:
        self._seen: dict[int, list[float]] = {kind: [] for kind in chess.PIECE_TYPES}

    def learn(self, heights: Array, codes: Codes) -> None:
        """Take in a known position; heights of what stands on each square, shape (64,) [m]."""
        for square in np.flatnonzero(codes):
            if heights[square] > 0.0:
                seen = self._seen[abs(int(codes[square]))]
                seen.append(float(heights[square]))
                del seen[:-50]

    def heights(self) -> dict[int, float]:
        """How high each kind of ``chess.PIECE_TYPES`` looks [m]; kinds that were not seen are left out."""
        return {kind: float(np.median(seen)) for kind, seen in self._seen.items() if seen}

    def promoted(self, decision: MoveReading, heights: Array | None) -> MoveReading:
        """The decision with the piece that was promoted to; ``promotion_unsure`` where it is not seen for certain.

        Heights are those in the look; None: it has no depth.
        """
        if not any(move.promotion for move in decision.moves):
            return decision
        move, kind = decision.move, None
        if heights is not None and move is not None:
            kind = self._kind(float(heights[move.to_square]))
        if kind is None or move is None:
            return replace(decision, promotion_unsure=True)
        return replace(decision, moves=(chess.Move(move.from_square, move.to_square, kind),))

    def _kind(self, height: float) -> int | None:
        """The kind so high, if it is clear; a pawn that still stands there is none. A third king it cannot be."""
        known = {kind: height for kind, height in self.heights().items() if kind != chess.KING}
        if not set(PROMOTIONS) <= set(known):
            return None
        off = sorted((abs(height - known[kind]) / SPREAD, kind) for kind in known)
        (nearest, kind), (second, _) = off[0], off[1]
        return kind if kind in PROMOTIONS and nearest < CLEAR and second - nearest > CLEAR else None
