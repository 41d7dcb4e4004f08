"""Tests and bounds that a campaign's figures are judged by: functions of arrays, without any draw of their own.

Each returns a two-sided p-value, the chance of something at least as far from "no difference" where there is none, or
bounds at a stated confidence. Where few games say anything the tests are exact; ties and equal pairs are allowed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv
from scipy.stats import beta, binom, fisher_exact, mannwhitneyu, norm, rankdata, spearmanr
from scipy.stats import t as student

Numbers = NDArray[np.float64]
Flags = NDArray[np.bool_]

CONFIDENCE: Final = 0.95
"""Of all bounds and intervals that do not say another one."""
SIGNIFICANT: Final = 1.0 - CONFIDENCE
"""A corrected p-value below this is called a difference."""
_EXACT: Final = 60
"""Up to so many differing pairs the signed-rank test counts all signs; beyond, its normal limit errs by below 1 %."""
_ENOUGH_GAMES_HIT: Final = 5
"""With hits in fewer games, the variance between games says next to nothing."""
_ENOUGH_FOR_MEANS: Final = 10
"""Games of which the average is about normal."""


class RateBounds(NamedTuple):
    """Within which a rate lies."""

    low: float
    high: float


def rate_bounds(hits: float, trials: float, confidence: float = CONFIDENCE) -> RateBounds:
    """Clopper and Pearson's exact two-sided bounds of a rate, from ``hits`` of ``trials``, which may be fractions."""
    beyond = (1.0 - confidence) / 2.0
    low = 0.0 if hits <= 0.0 else float(beta.ppf(beyond, hits, trials - hits + 1.0))
    return RateBounds(low, rate_at_most(hits, trials, 1.0 - beyond))


def rate_at_most(hits: float, trials: float, confidence: float = CONFIDENCE) -> float:
    """The exact upper bound of a rate: of 0 hits in n, ``1 − (1 − confidence)^(1/n)``; 1 where nothing was tried."""
    if trials <= 0.0 or hits >= trials:
        return 1.0
    return float(beta.ppf(confidence, hits + 1.0, trials - hits))


def clustered_at_most(hits: Numbers, trials: Numbers, confidence: float = CONFIDENCE) -> float:
    """The upper bound of a share of plies, which come in games and resemble each other there.

    It is never less than where no ply was hit: a share of games that so few do not show may be hit in every ply. With
    hits in fewer than five games, which do not tell how games differ, it is the bound of the share of games, times the
    largest share within one; with more, that of the independent plies that they are worth.

    Args:
        hits: of each game, shape (games,).
        trials: likewise.
        confidence: of the bound.
    """
    hits, trials = hits[trials > 0.0], trials[trials > 0.0]
    games, hit = trials.size, int(np.count_nonzero(hits))
    unseen = rate_at_most(0, games, confidence)
    if hit < _ENOUGH_GAMES_HIT:
        largest = float(np.max(hits / trials, initial=0.0))
        return max(unseen, rate_at_most(hit, games, confidence) * largest)
    return max(unseen, rate_at_most(*_independent(hits, trials, confidence), confidence))


def _independent(hits: Numbers, trials: Numbers, confidence: float) -> tuple[float, float]:
    """How many independent hits and trials those of games are worth (Korn and Graubard, 1998).

    The variance between games says by how much fewer: trials are divided by its ratio to the variance of independent
    plies. That it is itself estimated, from so many games, is what Student's quantiles allow for.
    """
    total, found, games = float(trials.sum()), float(hits.sum()), trials.size
    rate = found / total
    if rate >= 1.0:
        return found, total
    spread = games / (games - 1.0) * float(np.sum((hits - rate * trials) ** 2)) / total**2
    effect = max(1.0, spread / (rate * (1.0 - rate) / total))
    effect *= float((student.ppf(confidence, games - 1) / student.ppf(confidence, total - 1.0)) ** 2)
    return found / effect, total / effect


def holm(p_values: Sequence[float]) -> list[float]:
    """Holm's corrected p-values: whoever calls those below α a difference is wrong about any with chance α at most."""
    corrected = [0.0] * len(p_values)
    largest = 0.0
    for rank, index in enumerate(sorted(range(len(p_values)), key=p_values.__getitem__)):
        largest = max(largest, min(1.0, (len(p_values) - rank) * p_values[index]))
        corrected[index] = largest
    return corrected


def mcnemar(only_one: int, only_other: int) -> float:
    """Exact test of pairs in which something happened only in the one, or only in the other."""
    both = only_one + only_other
    return min(1.0, 2.0 * float(binom.cdf(min(only_one, only_other), both, 0.5))) if both else 1.0


def fisher(hits: int, trials: int, other_hits: int, other_trials: int) -> float:
    """Fisher's exact test of two rates."""
    table = np.array([[hits, trials - hits], [other_hits, other_trials - other_hits]])
    return float(fisher_exact(table).pvalue)


def signed_rank(differences: Numbers) -> float:
    """Wilcoxon's test of paired differences; equal pairs say nothing, and ties share their ranks."""
    moved = differences[differences != 0.0]
    if moved.size == 0:
        return 1.0
    ranks = rankdata(np.abs(moved))
    up = float(ranks[moved > 0.0].sum())
    if moved.size > _EXACT:
        z = (up - ranks.sum() / 2.0) / np.sqrt(np.sum(ranks**2) / 4.0)
        return float(2.0 * norm.sf(abs(z)))
    chances = _sums_of_signs(np.rint(2.0 * ranks).astype(np.int64))
    at = round(2.0 * up)
    return min(1.0, 2.0 * float(min(chances[: at + 1].sum(), chances[at:].sum())))


def _sums_of_signs(ranks: NDArray[np.int64]) -> Numbers:
    """The chance of each sum of those ranks that a fair coin chooses, shape (sum of all + 1,)."""
    chances = np.zeros(int(ranks.sum()) + 1)
    chances[0] = 1.0
    for rank in ranks:
        with_it = np.zeros_like(chances)
        with_it[rank:] = chances[:-rank]
        chances = (chances + with_it) / 2.0
    return chances


def mann_whitney(one: Numbers, other: Numbers) -> float:
    """Mann and Whitney's rank test of two samples; exact where one has at most eight values and none are equal."""
    if one.size == 0 or other.size == 0 or np.ptp(np.concatenate([one, other])) == 0.0:
        return 1.0
    return float(mannwhitneyu(one, other).pvalue)


def least_p_value(ones: int, others: int | None = None) -> float:
    """The least that a rank test of so many pairs, or of two samples of so many, can come to: all of one side lie above
    the other's.
    """
    return min(1.0, 2.0 / (2.0**ones if others is None else math.comb(ones + others, ones)))


def mean_difference(older: Numbers, newer: Numbers | None) -> float:
    """Welch's test of two averages, or Student's of the average of paired differences, where ``newer`` is None.

    It sees what a rank test hardly does, a large change in few games. 1 with fewer than ten, of which nobody knows
    how they are distributed.
    """
    sides = [older] if newer is None else [older, newer]
    if min(side.size for side in sides) < _ENOUGH_FOR_MEANS:
        return 1.0
    squared_errors = [float(side.var(ddof=1)) / side.size for side in sides]
    whole = sum(squared_errors)
    if whole == 0.0:
        return 1.0
    freedom = whole**2 / sum(one**2 / (side.size - 1) for one, side in zip(squared_errors, sides, strict=True))
    away = float(older.mean() if newer is None else newer.mean() - older.mean())
    return float(2.0 * student.sf(abs(away) / np.sqrt(whole), freedom))


def rank_correlation(one: Numbers, other: Numbers) -> float:
    """Spearman's test: whether one figure rises or falls with another; 1 where either is the same throughout."""
    if one.size < 3 or np.ptp(one) == 0.0 or np.ptp(other) == 0.0:
        return 1.0
    return float(spearmanr(one, other).pvalue)


def ranks_from_the_ends(values: Numbers) -> Numbers:
    """Siegel and Tukey's ranks: 1 for the least, 2 and 3 for the two largest, 4 and 5 for the next least, and so on.

    Small at both ends and large in the middle, without ties of their own: a test on them sees what happens at both ends
    of a range alike. Equal values share their ranks.
    """
    count = values.size
    ranks = np.empty(count)
    low, high, rank = 0, count - 1, 1
    from_below, left = True, 1
    while low <= high:
        ranks[low if from_below else high] = rank
        low, high = (low + 1, high) if from_below else (low, high - 1)
        rank, left = rank + 1, left - 1
        if not left:
            from_below, left = not from_below, 2
    _, group = np.unique(values, return_inverse=True)
    ordered = np.empty(count)
    ordered[np.argsort(values, kind="stable")] = ranks
    return np.asarray((np.bincount(group, ordered) / np.bincount(group))[group], dtype=np.float64)


def hits_needed(other_hits: int, trials: int, level: float, other_trials: int | None) -> int | None:
    """The least number of hits that a test at this level tells from what the others showed; None: no number does.

    Args:
        other_hits: of the older campaign; of pairs, those in which only the older one had a hit.
        trials: of the newer campaign, or pairs.
        level: of the test.
        other_trials: of the older campaign; None: these are pairs.
    """

    def tells(hits: int) -> bool:
        p = mcnemar(other_hits, hits) if other_trials is None else fisher(hits, trials, other_hits, other_trials)
        return p <= level

    most = trials if other_trials is not None else trials - other_hits
    least = other_hits if other_trials is None else int(np.ceil(other_hits * trials / max(other_trials, 1)))
    if least > most or not tells(most):
        return None
    while least < most:  # a p-value falls with the hits beyond what the others showed
        middle = (least + most) // 2
        least, most = (least, middle) if tells(middle) else (middle + 1, most)
    return least


def rate_that_gives(hits: int, trials: int, power: float) -> float:
    """The rate at which so many hits or more come with a chance of ``power``."""
    return float(betaincinv(hits, trials - hits + 1, power)) if hits else 0.0
