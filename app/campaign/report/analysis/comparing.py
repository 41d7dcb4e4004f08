"""Two campaigns against each other: what became better or worse, how sure that is, how large, and where it sits.

Games of one seed are a pair, which takes out all that the seed decides; where few seeds are in both, the campaigns are
two samples. All metrics in which anything differs are tested, and their p-values corrected by Holm: of two campaigns
between which nothing changed, one comparison in twenty finds something in any metric.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.campaign.report.analysis.effects import (
    POWER,
    EffectEstimate,
    mean_change,
    paired_rate_change,
    paired_shift,
    rate_change,
    unpaired_shift,
    visible_mean_change,
    visible_paired_shift,
    visible_shift,
)
from app.campaign.report.analysis.explaining import Association
from app.campaign.report.analysis.metrics import METRICS, Metric, MetricSort
from app.campaign.report.analysis.rows import CampaignRows, RowTable
from app.campaign.report.analysis.statistics import (
    SIGNIFICANT,
    Numbers,
    fisher,
    hits_needed,
    holm,
    least_p_value,
    mann_whitney,
    mcnemar,
    mean_difference,
    rate_that_gives,
    signed_rank,
)

_ENOUGH_PAIRS: Final = 0.5
"""Of the games of the smaller campaign: with fewer in both, all games are compared, as two samples."""
_MOST_EQUAL: Final = 0.1
"""Of pairs: with more of them equal, the typical shift is 0 whatever happens to the rest."""
_PLACE_OF_PLY: Final = ("seed", "ply")
_SORT_OF_PLY: Final = ("uci", "kind", "piece", "by")
"""Columns in which plies of two campaigns are the same, so that one can be held against the other."""
_TESTS_OF_A_FIGURE: Final = 2
"""By ranks, which sees a small change of all games, and of the averages, which sees a large one of few."""


@dataclass(frozen=True, slots=True)
class GameMatch:
    """Which games are held against which.

    Attributes:
        older: the older campaign; of pairs, the games that are in both, in the order of their seeds.
        newer: the newer one, likewise.
        paired: game by game.
        left_out: games of either whose seed the other does not have.
        alike: pairs in which the world ended the same to the last bit.
        metrics: all that they are compared by.
    """

    older: CampaignRows
    newer: CampaignRows
    paired: bool
    left_out: int
    alike: int
    metrics: tuple[Metric, ...] = METRICS

    @property
    def empty(self) -> bool:
        """There is no game on one side at least, so nothing is compared."""
        return min(len(self.older.games), len(self.newer.games)) == 0

    @property
    def without_whole_games(self) -> GameMatch:
        """The match without what grows with the length of games, which says nothing where that is another."""
        return replace(self, metrics=tuple(one for one in self.metrics if not one.of_whole_games))


@dataclass(frozen=True, slots=True)
class MetricChange:
    """What became of one metric.

    Attributes:
        metric: which one.
        older: the figure of each game, shape (games,), NaN where there is none.
        newer: likewise; of pairs in the same order.
        estimate: the difference, newer less older.
        typical: the difference is a typical shift; else of the averages.
        p: of the metric alone.
        corrected: for the number of metrics tested.
        visible: a change so large would have been seen with 80 % power; None: none at all, there are too few games.
        where: in which ranges, kinds of plies or pieces a change that was found differs.
    """

    metric: Metric
    older: Numbers
    newer: Numbers
    estimate: EffectEstimate
    typical: bool
    p: float
    corrected: float = 1.0
    visible: float | None = None
    where: tuple[Association, ...] = field(default=())

    @property
    def found(self) -> bool:
        """It is more than chance."""
        return self.corrected < SIGNIFICANT

    @property
    def worse(self) -> bool:
        """It went up: less is better of all metrics."""
        return self.sign > 0.0

    @property
    def sign(self) -> float:
        """Of the change; where the estimate is none, of the averages."""
        return float(np.sign(self.estimate.value or np.nanmean(self.newer) - np.nanmean(self.older)))


def matched(older: CampaignRows, newer: CampaignRows) -> GameMatch:
    """Pair the games of one seed, or take all as two samples where too few seeds are in both."""
    _, old_places, new_places = np.intersect1d(older.seeds, newer.seeds, return_indices=True)
    smaller = min(len(older.games), len(newer.games))
    if old_places.size < max(1.0, _ENOUGH_PAIRS * smaller):
        return GameMatch(older, newer, False, 0, 0)
    left_out = len(older.games) + len(newer.games) - 2 * old_places.size
    old, new = older.games.where(old_places), newer.games.where(new_places)
    states, others = old.words("world_state"), new.words("world_state")
    alike = sum(one is not None and one == other for one, other in zip(states, others, strict=True))
    return GameMatch(replace(older, games=old), replace(newer, games=new), True, left_out, alike)


def plies_in_both(match: GameMatch) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The places of plies in both campaigns that are the same move of the same piece in the same place of a game."""

    def keys(rows: CampaignRows) -> list[tuple[object, ...]]:
        numbers, words = map(rows.plies.numbers, _PLACE_OF_PLY), map(rows.plies.words, _SORT_OF_PLY)
        return list(zip(*numbers, *words, strict=True))

    places = {key: place for place, key in enumerate(keys(match.older))}
    found = [(places[key], place) for place, key in enumerate(keys(match.newer)) if key in places]
    both = np.array(found, dtype=np.int64).reshape(-1, 2)
    return both[:, 0], both[:, 1]


def with_the_same_plies(match: GameMatch) -> GameMatch:
    """The match with only those plies, and figures of them, that both campaigns have: like is held against like.

    A figure is null where something went wrong in a ply; averages of the others alone would be better for it.
    """
    if not match.paired:
        return match
    old, new = plies_in_both(match)
    older, newer = match.older.plies.where(old), match.newer.plies.where(new)
    return replace(
        match,
        older=replace(match.older, plies=_where_known(older, newer)),
        newer=replace(match.newer, plies=_where_known(newer, older)),
    )


def _where_known(plies: RowTable, others: RowTable) -> RowTable:
    """The plies without the numbers that the same rows of the others do not have."""
    columns = {
        name: np.where(np.isnan(others.numbers(name)), np.nan, column) if column.dtype == np.float64 else column
        for name, column in plies.columns.items()
    }
    return RowTable(columns)


@dataclass(frozen=True, slots=True)
class MetricTest:
    """A metric in which something differs.

    Attributes:
        metric: which one.
        older: the figure of each game, NaN where there is none.
        newer: likewise.
        p: of the metric alone; of figures that of the surer of two tests, by ranks and of the averages, times two.
        by_ranks: the test by ranks is the surer one: what differs is typical.
        corrected: for the number of metrics.
    """

    metric: Metric
    older: Numbers
    newer: Numbers
    p: float
    by_ranks: bool
    corrected: float


def tested(match: GameMatch) -> tuple[MetricTest, ...]:
    """Test each metric in which anything differs; p-values are corrected for their number.

    Args:
        match: with the same plies in both, where games are paired.
    """
    sides = [(metric, *sides_of(metric, match)) for metric in match.metrics]
    varied = [one for one in sides if differ(one[1], one[2], match.paired)]
    found = [_p_value(*one, match.paired) for one in varied]
    corrected = holm([p for p, _ in found])
    return tuple(MetricTest(*one, *p, surely) for one, p, surely in zip(varied, found, corrected, strict=True))


def changes(match: GameMatch) -> tuple[MetricChange, ...]:
    """What became of each metric in which anything differs: how sure, and how large; in the order of the metrics."""
    found = tested(match)
    level = level_of(len(found))
    return tuple(_measured(one, match.paired, level) for one in found)


def level_of(tests: int) -> float:
    """What the surest of so many tests has to reach, so that a change is called one."""
    return SIGNIFICANT / max(tests, 1)


def sides_of(metric: Metric, match: GameMatch) -> tuple[Numbers, Numbers]:
    """The figures of both campaigns; of pairs only those that both have, NaN otherwise."""
    older, newer = metric.of_each_game(match.older), metric.of_each_game(match.newer)
    if match.paired:
        unknown = np.isnan(older) | np.isnan(newer)
        older, newer = np.where(unknown, np.nan, older), np.where(unknown, np.nan, newer)
    return older, newer


def differ(older: Numbers, newer: Numbers, paired: bool) -> bool:
    """Whether there is anything to test: a pair that differs, or two figures that do. No label decides it."""
    one, other = known(older), known(newer)
    if min(one.size, other.size) == 0:
        return False
    varied = np.any(one != other) if paired else np.ptp(np.concatenate([one, other])) > 0.0
    return bool(varied)


def known(values: Numbers) -> Numbers:
    """Those that are there."""
    return values[~np.isnan(values)]


def _p_value(metric: Metric, older: Numbers, newer: Numbers, paired: bool) -> tuple[float, bool]:
    """The p-value, and whether it is that of the test by ranks."""
    one, other = known(older), known(newer)
    if metric.sort is MetricSort.RATE:
        if paired:
            return mcnemar(int(np.sum(one > other)), int(np.sum(other > one))), False
        return fisher(int(other.sum()), other.size, int(one.sum()), one.size), False
    return figure_test(one, other, paired)


def figure_test(older: Numbers, newer: Numbers, paired: bool) -> tuple[float, bool]:
    """The p-value of the surer of two tests, by ranks and of averages, times two; and whether that is by ranks."""
    by_ranks = signed_rank(newer - older) if paired else mann_whitney(older, newer)
    of_means = mean_difference(newer - older, None) if paired else mean_difference(older, newer)
    return min(1.0, _TESTS_OF_A_FIGURE * min(by_ranks, of_means)), by_ranks <= of_means


def _measured(one: MetricTest, paired: bool, level: float) -> MetricChange:
    """How large the difference is, and how large one would have been seen at this level."""
    older, newer = known(one.older), known(one.newer)
    typical = one.by_ranks and _typical_says_something(older, newer, paired)
    if one.metric.sort is MetricSort.RATE:
        old, new = older > 0.0, newer > 0.0
        estimate = paired_rate_change(old, new) if paired else rate_change(old, new)
        visible = visible_rate(older, newer, paired, level)
    else:
        estimate, visible = _figure_measures(older, newer, paired, typical, level / _TESTS_OF_A_FIGURE)
    return MetricChange(one.metric, one.older, one.newer, estimate, typical, one.p, one.corrected, visible)


def _typical_says_something(older: Numbers, newer: Numbers, paired: bool) -> bool:
    if paired:
        return float(np.mean(older == newer)) <= _MOST_EQUAL
    _, counts = np.unique(np.concatenate([older, newer]), return_counts=True)
    return bool(counts.max() <= _MOST_EQUAL * counts.sum())


def _figure_measures(
    older: Numbers, newer: Numbers, paired: bool, typical: bool, level: float
) -> tuple[EffectEstimate, float | None]:
    if paired:
        away = newer - older
        enough = least_p_value(away.size) <= level
        if typical:
            return paired_shift(away), visible_paired_shift(away, level) if enough else None
        return mean_change(away, None), visible_mean_change(away, None, level) if enough else None
    enough = least_p_value(older.size, newer.size) <= level
    if typical:
        return unpaired_shift(older, newer), visible_shift(older, newer, level) if enough else None
    return mean_change(older, newer), visible_mean_change(older, newer, level) if enough else None


def visible_rate(older: Numbers, newer: Numbers, paired: bool, level: float) -> float | None:
    """How much more often than in the older campaign something would have to happen to be seen."""
    if paired:
        before = int(np.sum(older > newer))
        needed = hits_needed(before, newer.size, level, None)
    else:
        before = int(older.sum())
        needed = hits_needed(before, newer.size, level, older.size)
    if needed is None:
        return None
    return rate_that_gives(needed, newer.size, POWER) - before / older.size
