"""When an engine resigns, offers or accepts a draw, or claims one: rules on its own scores.

By default it accepts and claims draws, offers none and never resigns. A game on a board that people watch should end by
mate, a beginner should learn to give it, and a score may come from an engine that is about to fail; an offer stops a
person who thinks. An engine that is asked for a draw ought to be able to say yes.
"""

from collections.abc import Sequence
from typing import Final

import chess
import chess.engine
from pydantic import BaseModel, ConfigDict, NonNegativeInt, PositiveInt

MATE = 100_000
"""Score of a mate [centipawns]."""


class DrawResignPolicy(BaseModel):
    """The rules; scores are from the engine's own side [centipawns]."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    resign_below: PositiveInt | None = None
    """It resigns when its last scores were all this much below zero or worse; None: never. 1000 is a queen."""
    resign_for: PositiveInt = 4
    """How many scores of its own in a row."""
    offer_within: NonNegativeInt | None = None
    """It offers a draw when its last scores were all within this of zero; None: never."""
    accept_within: NonNegativeInt | None = 30
    """It accepts one when its last scores were all at most this; None: never."""
    draw_for: PositiveInt = 6
    """How many scores of its own in a row."""
    draw_from: PositiveInt = 60
    """No draw is offered or accepted before so many plies."""
    claim_within: NonNegativeInt | None = 50
    """It claims a draw by repetition or fifty moves unless its last score was better than this; None: never."""

    def resigns(self, scores: Sequence[chess.engine.Score]) -> bool:
        """Whether it gives up, after these scores of its own, the last one last."""
        last = _last(scores, self.resign_for)
        return self.resign_below is not None and bool(last) and all(score <= -self.resign_below for score in last)

    def offers_draw(self, scores: Sequence[chess.engine.Score], board: chess.Board) -> bool:
        """Whether it offers a draw with its move in this position."""
        last, within = self._for_draw(scores, board), self.offer_within
        return within is not None and bool(last) and all(abs(score) <= within for score in last)

    def accepts_draw(self, scores: Sequence[chess.engine.Score], board: chess.Board) -> bool:
        """Whether it accepts a draw in this position: also when it is worse, however much."""
        last, within = self._for_draw(scores, board), self.accept_within
        return within is not None and bool(last) and all(score <= within for score in last)

    def claims_draw(self, scores: Sequence[chess.engine.Score], board: chess.Board) -> bool:
        """Whether it claims the draw that the rules grant it in this position, before its move."""
        last = _last(scores, 1)
        if self.claim_within is None or not board.can_claim_draw():
            return False
        return not last or last[0] <= self.claim_within

    def _for_draw(self, scores: Sequence[chess.engine.Score], board: chess.Board) -> list[int]:
        return _last(scores, self.draw_for) if board.ply() >= self.draw_from else []


RESIGNING: Final = DrawResignPolicy(resign_below=900)
"""Of an engine that may resign: with a queen less, four times in a row."""


def _last(scores: Sequence[chess.engine.Score], n: int) -> list[int]:
    """The last scores in centipawns; none where there are not so many."""
    return [score.score(mate_score=MATE) for score in scores[-n:]] if len(scores) >= n else []
