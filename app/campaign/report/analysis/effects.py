"""How large a difference is, with an interval, and how large one would have been seen.

A shift is Hodges and Lehmann's: the middle of all averages of two paired differences, or of all differences between two
samples. It is robust, belongs to the rank tests, and its interval holds whatever the distribution. Where many pairs are
equal, as in counts, it would be 0 whatever happens to the rest; there the difference of the averages is told, with an
interval by bootstrap.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from scipy.stats import norm

from app.campaign.report.analysis.statistics import CONFIDENCE, Flags, Numbers

POWER: Final = 0.80
"""With which chance a change that is said to be visible would have been seen."""
_MOST_VALUES: Final = 1000
"""Of a sample all of whose pairs are looked at, half a million or a million; of a larger one so many are chosen."""
_RESAMPLES: Final = 2000
_BLOCK: Final = 100  # of them at once
_SEED: Final = 20
"""Of what is chosen by chance here: the same campaigns give the same page."""


class EffectEstimate(NamedTuple):
    """A difference, newer less older, and the interval in which it lies with 95 % confidence."""

    value: float
    low: float
    high: float


def paired_shift(differences: Numbers, confidence: float = CONFIDENCE) -> EffectEstimate:
    """Hodges and Lehmann's shift of paired differences, with Wilcoxon's interval."""
    walsh = _walsh(_some(differences))
    count = min(differences.size, _MOST_VALUES)
    z = float(norm.ppf((1.0 + confidence) / 2.0))
    half = z * math.sqrt(count * (count + 1.0) * (2.0 * count + 1.0) / 24.0)
    return _middle_of(walsh, half)


def unpaired_shift(older: Numbers, newer: Numbers, confidence: float = CONFIDENCE) -> EffectEstimate:
    """Hodges and Lehmann's shift between two samples, with Mann and Whitney's interval."""
    one, other = _some(older), _some(newer)
    between = np.sort(np.subtract.outer(other, one), axis=None)
    z = float(norm.ppf((1.0 + confidence) / 2.0))
    half = z * math.sqrt(one.size * other.size * (one.size + other.size + 1.0) / 12.0)
    return _middle_of(between, half)


def _middle_of(ordered: Numbers, half: float) -> EffectEstimate:
    """The median of ordered values, and those that lie so many ranks to either side."""
    below = max(0, math.floor(ordered.size / 2.0 - half) - 1)
    return EffectEstimate(float(np.median(ordered)), float(ordered[below]), float(ordered[ordered.size - 1 - below]))


def _walsh(differences: Numbers) -> Numbers:
    """The averages of all pairs of differences, each with itself among them, in their order."""
    first, second = np.triu_indices(differences.size)
    return np.sort((differences[first] + differences[second]) / 2.0)


def _some(values: Numbers) -> Numbers:
    if values.size <= _MOST_VALUES:
        return values
    return np.random.default_rng(_SEED).choice(values, _MOST_VALUES, replace=False)


def mean_change(older: Numbers, newer: Numbers | None, confidence: float = CONFIDENCE) -> EffectEstimate:
    """The difference of two averages, with an interval by bootstrap over games.

    Args:
        older: a figure of each game, or of each pair the difference.
        newer: likewise; None: ``older`` holds differences.
        confidence: of the interval.
    """
    rng = np.random.default_rng(_SEED)
    means = (
        _resampled_means(older, rng) if newer is None else _resampled_means(newer, rng) - _resampled_means(older, rng)
    )
    value = float(older.mean() if newer is None else newer.mean() - older.mean())
    low, high = np.quantile(means, [(1.0 - confidence) / 2.0, (1.0 + confidence) / 2.0])
    return EffectEstimate(value, float(low), float(high))


def _resampled_means(values: Numbers, rng: np.random.Generator) -> Numbers:
    """Of ``_RESAMPLES`` samples with replacement; values that are equal are drawn together, so counts are quick."""
    distinct, counts = np.unique(values, return_counts=True)
    if distinct.size < values.size // 4:
        return np.asarray(rng.multinomial(values.size, counts / values.size, _RESAMPLES) @ distinct / values.size)
    blocks = [
        values[rng.integers(0, values.size, (_BLOCK, values.size))].mean(axis=1) for _ in range(_RESAMPLES // _BLOCK)
    ]
    return np.concatenate(blocks)


def paired_rate_change(older: Flags, newer: Flags, confidence: float = CONFIDENCE) -> EffectEstimate:
    """The difference of two rates in pairs, with Newcombe's interval (1998, method 10)."""
    both, neither = int(np.sum(older & newer)), int(np.sum(~older & ~newer))
    only_old, only_new = int(np.sum(older & ~newer)), int(np.sum(newer & ~older))
    margins = (both + only_new) * (both + only_old) * (only_old + neither) * (only_new + neither)
    cross = float(both * neither - only_old * only_new)
    if cross > 0.0:  # Newcombe's correction: a correlation that may be chance does not narrow the interval
        cross = max(0.0, cross - older.size / 2.0)
    alike = cross / math.sqrt(margins) if margins else 0.0
    return _newcombe(float(older.mean()), older.size, float(newer.mean()), newer.size, alike, confidence)


def rate_change(older: Flags, newer: Flags, confidence: float = CONFIDENCE) -> EffectEstimate:
    """The difference of two rates of different games, with Newcombe's interval of two samples (1998)."""
    return _newcombe(float(older.mean()), older.size, float(newer.mean()), newer.size, 0.0, confidence)


def _newcombe(old: float, olds: int, new: float, news: int, alike: float, confidence: float) -> EffectEstimate:
    """Wilson's intervals of both rates put together; ``alike`` is the correlation within pairs."""
    old_low, old_high = _wilson(old, olds, confidence)
    new_low, new_high = _wilson(new, news, confidence)

    def away(one: float, other: float) -> float:
        return math.sqrt(max(0.0, one**2 - 2.0 * alike * one * other + other**2))

    value = new - old
    return EffectEstimate(
        value, value - away(new - new_low, old_high - old), value + away(new_high - new, old - old_low)
    )


def _wilson(rate: float, count: int, confidence: float) -> tuple[float, float]:
    z = float(norm.ppf((1.0 + confidence) / 2.0))
    middle = (rate + z**2 / (2.0 * count)) / (1.0 + z**2 / count)
    half = z / (1.0 + z**2 / count) * math.sqrt(rate * (1.0 - rate) / count + z**2 / (4.0 * count**2))
    return middle - half, middle + half


def visible_paired_shift(differences: Numbers, level: float, power: float = POWER) -> float | None:
    """The shift of all pairs that Wilcoxon's test would have seen (Noether, 1987); None: none, there are too few.

    The chance that the average of two shifted differences lies above 0 has to be this far from a half; how large a
    shift does that is read off the differences that are there.
    """
    share = 0.5 + _z_of_both(level, power) / math.sqrt(3.0 * max(differences.size, 1))
    return None if share >= 1.0 else _above_the_middle(_walsh(_some(differences)), share)


def visible_shift(older: Numbers, newer: Numbers, level: float, power: float = POWER) -> float | None:
    """The same of two samples and Mann and Whitney's test."""
    one, other = _some(older), _some(newer)
    count, part = older.size + newer.size, older.size / max(older.size + newer.size, 1)
    if not 0.0 < part < 1.0:
        return None
    share = 0.5 + _z_of_both(level, power) / math.sqrt(12.0 * part * (1.0 - part) * count)
    return None if share >= 1.0 else _above_the_middle(np.sort(np.subtract.outer(other, one), axis=None), share)


def _above_the_middle(ordered: Numbers, share: float) -> float:
    upper, middle, lower = np.quantile(ordered, [share, 0.5, 1.0 - share])
    return float(max(upper - middle, middle - lower))


def visible_mean_change(older: Numbers, newer: Numbers | None, level: float, power: float = POWER) -> float:
    """The difference of averages that would have been seen, by the spread that is there (normal limit)."""
    spread = older.var(ddof=1) / older.size
    if newer is not None:
        spread += newer.var(ddof=1) / newer.size
    return _z_of_both(level, power) * math.sqrt(float(spread))


def _z_of_both(level: float, power: float) -> float:
    return float(norm.ppf(1.0 - level / 2.0) + norm.ppf(power))
