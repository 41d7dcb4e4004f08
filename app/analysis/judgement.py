"""How good a move was: winning chances, accuracy and judgements from evaluations; pure functions of numbers.

All formulas are those that Lichess publishes (lichess.org/page/accuracy) and uses (github.com/lichess-org/lila:
``WinPercent``, ``AccuracyPercent`` and ``Advice``), so that figures can be compared with what players know from there.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from enum import StrEnum
from typing import Final, NamedTuple

import chess
import chess.engine

STEEPNESS: Final = 0.00368208
"""Of the curve from centipawns to winning chances, fitted by Lichess to games of players rated 2300."""
CEILING: Final = 1000
"""A score beyond this counts as this much, and so does a mate [centipawns]."""
_SCALE, _DECAY, _OFFSET = 103.1668100711649, 0.04354415386753951, -3.166924740191411
"""Of the curve from winning chances lost to accuracy, fitted by Lichess."""
_BONUS: Final = 1.0
"""Lichess adds this to the accuracy of each move, because an analysis is never perfect."""
_LEAST_WEIGHT, _MOST_WEIGHT = 0.5, 12.0
"""Bounds on the weight of a move, which grows with how much winning chances vary around it."""


class Judgement(StrEnum):
    """What a move is called by the winning chances that it gives away."""

    INACCURACY = "inaccuracy"
    MISTAKE = "mistake"
    BLUNDER = "blunder"


LOST: Final = {Judgement.BLUNDER: 15.0, Judgement.MISTAKE: 10.0, Judgement.INACCURACY: 5.0}
"""Winning chances lost from which on a move is called so [percent]; the worst first. Lichess counts from -1 to 1: its
0.3, 0.2 and 0.1."""
_DECIDED, _CLEAR = 999, 700
"""Where a mate comes or goes: a position worth more than this was decided, or clear, without it [centipawns]."""


def win_percent(score: chess.engine.Score) -> float:
    """Winning chances of the side that the score is of, a draw counting half [percent]."""
    bounded = max(-CEILING, min(CEILING, centipawns(score)))
    return 100.0 / (1.0 + math.exp(-STEEPNESS * bounded))


def centipawns(score: chess.engine.Score) -> int:
    """A score as a number; a mate, also one on the board, is the ceiling [centipawns]."""
    mates = score.score(mate_score=100 * CEILING)
    return mates if score.score() is not None else CEILING if mates > 0 else -CEILING


def move_accuracy(before: float, after: float) -> float:
    """Accuracy of a move from its side's winning chances before and after it [percent, all three]."""
    if after >= before:
        return 100.0
    raw = _SCALE * math.exp(-_DECAY * (before - after)) + _OFFSET + _BONUS
    return max(0.0, min(100.0, raw))


class SidesAccuracy(NamedTuple):
    """Accuracy of both sides [percent]; None of one that has not moved."""

    white: float | None
    black: float | None


def game_accuracy(white_wins: Sequence[float], first: chess.Color) -> SidesAccuracy:
    """Accuracy of both sides in a game: between a mean that counts moves more where much is at stake, and the harmonic
    mean, which a single bad move lowers.

    Args:
        white_wins: White's winning chances at the start and after each ply [percent].
        first: the side that made the first move.
    """
    size = max(2, min(8, (len(white_wins) - 1) // 10))
    last = max(1, len(white_wins) - size + 1)
    windows = [white_wins[:size]] * (min(size, len(white_wins)) - 2)
    windows += [white_wins[n : n + size] for n in range(last)]
    sides: dict[chess.Color, list[tuple[float, float]]] = {chess.WHITE: [], chess.BLACK: []}
    turn = first
    for before, after, window in zip(white_wins, white_wins[1:], windows, strict=False):
        one, two = (before, after) if turn else (100.0 - before, 100.0 - after)
        weight = max(_LEAST_WEIGHT, min(_MOST_WEIGHT, statistics.pstdev(window)))
        sides[turn].append((move_accuracy(one, two), weight))
        turn = not turn
    return SidesAccuracy(_mean(sides[chess.WHITE]), _mean(sides[chess.BLACK]))


def _mean(weighted: Sequence[tuple[float, float]]) -> float | None:
    if not weighted:
        return None
    by_weight = sum(value * weight for value, weight in weighted) / sum(weight for _, weight in weighted)
    harmonic = len(weighted) / sum(1.0 / max(1.0, value) for value, _ in weighted)
    return (by_weight + harmonic) / 2.0


def judgement_of(before: chess.engine.Score, after: chess.engine.Score) -> Judgement | None:
    """What a move is called, from its side's scores before and after it; None: it is as good as any.

    A mate that is given away, or allowed, is judged by what the position is worth without it.
    """
    allowed = not _mates(before) and not _mated(before) and _mated(after)
    missed = _mates(before) and not _mates(after)
    if allowed or missed:
        worth = -centipawns(before) if allowed else centipawns(after)
        if worth > _DECIDED:
            return Judgement.INACCURACY
        return Judgement.MISTAKE if worth > _CLEAR else Judgement.BLUNDER
    if before.score() is None or after.score() is None:
        return None  # a mate that is only given later, or taken earlier
    lost = _uncapped(before) - _uncapped(after)
    return next((name for name, least in LOST.items() if lost >= least), None)


def _uncapped(score: chess.engine.Score) -> float:
    return 100.0 / (1.0 + math.exp(-STEEPNESS * max(-100 * CEILING, min(100 * CEILING, centipawns(score)))))


def _mates(score: chess.engine.Score) -> bool:
    return score.score() is None and score > chess.engine.Cp(0)


def _mated(score: chess.engine.Score) -> bool:
    return score.score() is None and score < chess.engine.Cp(0)
