"""Which move was made: every legal move and no move are weighed, with a margin that every other placement must keep.

A move is accepted only if three things hold. No other legal move, nor none, explains the look nearly as well. No square
says by itself that something else stands there; so a piece too many, a piece missing, two moves at once or a half-made
castling are never taken for a move, without anybody having to list them. And the look as a whole is explained. Else
there is doubt, which is told as such.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import chess
import numpy as np

from vision.arrays import Array
from vision.reading.appearance import EMPTY
from vision.reading.evidence import Codes, Evidence, codes_of
from vision.reading.outcome import ReadingOutcome

Line = tuple[chess.Move, ...]
PROMOTIONS: Final = (chess.QUEEN, chess.ROOK, chess.BISHOP, chess.KNIGHT)  # what a pawn may become
MARGIN: Final = 6.0  # by which a move must be better explained than any other legal one: e⁶ ≈ 400 times as likely [nat]
ELSEWHERE: Final = 4.0
"""By which a square that the move leaves alone must be explained better than by anything else standing there: e⁴ ≈ 50
times. A move read rightly while a piece is gone elsewhere is no wrong move, and the next look shows that [nat]."""
MISSING: Final = 4.5
STRAY: Final = 6.0
"""How much rarer than a legal move it is that, besides, a piece is missing; that one too many stands there, or one of
the other colour [nat]. Every square must keep the margin against that by itself. Of a square that is not seen nothing
can be said, so that there even a missing piece counts as the latter: it would take a wonder."""
UNEXPLAINED: Final = 12.0  # the most that may be left unexplained over the whole board: three pieces brushed past [nat]
MANY: Final = 4.0  # two plies in one look must keep the margin by so much more: there are hundreds of them [nat]


@dataclass(frozen=True, slots=True)
class MoveReading:
    """What is believed to have been played."""

    verdict: ReadingOutcome  # what the look came to
    moves: tuple[chess.Move, ...]  # what was played; in doubt the likeliest, which must not be taken
    confidence: float  # probability of ``moves`` among everything weighed
    margin: float  # what is left of the margins, in natural logarithms; negative in doubt
    squares: tuple[int, ...]  # those that speak against ``moves``, the loudest first
    promotion_unsure: bool = False  # the promoted piece was not seen; a queen is written

    @property
    def move(self) -> chess.Move | None:
        """The one that ``moves`` are; None: they are none, or several."""
        return self.moves[0] if len(self.moves) == 1 else None

    @property
    def possible(self) -> tuple[chess.Move, ...]:
        """What ``move`` may have been, the likeliest first: a pawn may have become any piece where it was not seen."""
        if self.move is None:
            return ()
        kinds = PROMOTIONS if self.promotion_unsure else (self.move.promotion,)
        return tuple(chess.Move(self.move.from_square, self.move.to_square, kind) for kind in kinds)


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """Positions that could have come about."""

    lines: tuple[Line, ...]  # the moves to each; empty for none
    codes: Codes  # the pieces after them, shape (n, 64)


def candidates(board: chess.Board, plies: int = 1) -> Candidates:
    """No move, and every line of up to ``plies`` legal moves; of promotions only the queen's."""
    lines, codes = zip(((), codes_of(board)), *_walk(board.copy(stack=False), plies, ()), strict=True)
    return Candidates(lines, np.array(codes))


def _walk(board: chess.Board, plies: int, line: Line) -> Iterator[tuple[Line, Codes]]:
    """Every line that begins so, and the pieces after it."""
    for move in list(board.legal_moves):
        if move.promotion in (None, chess.QUEEN):
            board.push(move)
            yield (*line, move), codes_of(board)
            if plies > 1:
                yield from _walk(board, plies - 1, (*line, move))
            board.pop()


def decide(evidence: Evidence, board: chess.Board, plies: int = 1, looked_like: Codes | None = None) -> MoveReading:
    """Weigh a look at a board after the last known position.

    ``plies`` may have been made since; in a game one. ``looked_like`` are the pieces in the picture that
    ``evidence.changed`` compares with; ``board``'s unless given.
    """
    before = codes_of(board) if looked_like is None else looked_like
    decision = _weigh(evidence, candidates(board), before, MARGIN)
    for more in range(2, plies + 1):
        if decision.verdict is not ReadingOutcome.DOUBT:
            break
        decision = _weigh(evidence, candidates(board, more), before, MARGIN + MANY)
    return decision


def _weigh(evidence: Evidence, among: Candidates, before: Codes, margin: float) -> MoveReading:
    scores = evidence.scores(among.codes, before).sum(axis=1)
    best = int(scores.argmax())
    codes = among.codes[best]
    # lines that lead to the same placement are the same to the eye: the first counts, the others are no rivals
    rivals = scores[(among.codes != codes).any(axis=1)]
    lead = float(scores[best] - rivals.max()) if len(rivals) else np.inf
    same = [line for line, one in zip(among.lines, among.codes, strict=True) if np.array_equal(one, codes)]
    doubt = evidence.doubt(codes, before)
    rest = float(np.maximum(doubt.max(axis=1), 0.0).sum())
    missing = MISSING + (STRAY - MISSING) * np.minimum(evidence.hidden(codes), 1.0)
    strange = (doubt - np.where(np.arange(3) == EMPTY, missing[:, None], STRAY)).max(axis=1)
    over = strange + np.where(codes != before, MARGIN, ELSEWHERE)
    left = min(lead - margin, -float(over.max()), UNEXPLAINED - rest)
    squares = tuple(int(square) for square in np.argsort(-over) if over[square] > 0.0)
    clear = ReadingOutcome.MOVE if among.lines[best] else ReadingOutcome.NOTHING
    verdict = clear if left >= 0.0 and len(same) == 1 else ReadingOutcome.DOUBT
    confidence = _probability(scores, best, strange)
    return MoveReading(verdict, among.lines[best], confidence, left, squares)


def _probability(scores: Array, best: int, strange: Array) -> float:
    """Of the best among all candidates, and among placements that differ from it in one square."""
    others = np.exp(np.minimum(scores - scores[best], 50.0)).sum() - 1.0
    return float(1.0 / (1.0 + others + np.exp(np.minimum(strange, 50.0)).sum()))
