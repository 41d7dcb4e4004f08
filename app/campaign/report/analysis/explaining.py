"""Which of the drawn ranges something depends on: failures of one campaign, or the change between two.

Of a range of numbers four tests are made: one sees a rise or fall along it (Mann and Whitney, Spearman), one what is
different at both ends (the same on Siegel and Tukey's ranks), and two hold the lowest and the highest fifth against the
rest, as where something fails beyond some value; of categories each is held against the rest, and the surest in which
there is more of it is named. The p-value of a range is the best, or that of the category named, times how many tests
were made in it, and those of all ranges are corrected by Holm: of a campaign in which
nothing depends on any range, at most one in twenty names one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2, norm, rankdata

from app.campaign.report.analysis.conditions import DrawnRange
from app.campaign.report.analysis.statistics import (
    SIGNIFICANT,
    Flags,
    Numbers,
    fisher,
    holm,
    mann_whitney,
    rank_correlation,
    ranks_from_the_ends,
)


@dataclass(frozen=True, slots=True)
class GroupFigure:
    """What was found in a group of a range: of how many games, and their average; of flags that is a rate."""

    label: str
    games: int
    value: float
    rest: int
    """So many games are in the other groups."""
    rest_value: float
    """The average there."""


@dataclass(frozen=True, slots=True)
class Association:
    """How something goes with a range.

    Attributes:
        name: of the range.
        groups: in the order of the range.
        p: of the range alone.
        corrected: for the number of ranges.
        most: which of the groups stands out.
        both_ends: it is the ends of the range together that stand out.
    """

    name: str
    groups: tuple[GroupFigure, ...]
    p: float
    corrected: float
    most: int
    both_ends: bool = False

    @property
    def holds(self) -> bool:
        """It is more than chance."""
        return self.corrected < SIGNIFICANT

    @property
    def standing_out(self) -> GroupFigure:
        """The group in which there is most of it."""
        return self.groups[self.most]


def corrected(found: Sequence[Association]) -> tuple[Association, ...]:
    """Associations with p-values corrected for their number, the surest first."""
    p_values = holm([one.p for one in found])
    both = [replace(one, corrected=p) for one, p in zip(found, p_values, strict=True)]
    return tuple(sorted(both, key=lambda one: (one.corrected, one.p)))


def explained(values: Flags | Numbers, ranges: Sequence[DrawnRange], sign: float = 1.0) -> tuple[Association, ...]:
    """Which ranges a figure of each game goes with.

    Args:
        values: of each game; NaN: nothing is known of it.
        ranges: what was drawn for the same games.
        sign: whether groups stand out that have more of it (1) or less (−1).
    """
    numbers = np.asarray(values, dtype=np.float64)
    found = [_association(numbers, one, sign) for one in ranges]
    return corrected([one for one in found if one is not None])


def _association(values: Numbers, drawn: DrawnRange, sign: float) -> Association | None:
    known = ~np.isnan(values) & (drawn.group >= 0)
    group, figure = drawn.group[known], values[known]
    groups, places = group_figures(figure, group, drawn.labels)
    if len(groups) < 2:
        return None
    if drawn.values is None:
        return of_groups(drawn.name, groups, sign, [_differ(figure[group == at], figure[group != at]) for at in places])
    most = _largest(groups, sign)
    along = drawn.values[known]
    rising, ends = _goes_with(figure, along), _goes_with(figure, ranks_from_the_ends(along))
    outermost = [_differ(figure[group == place], figure[group != place]) for place in (places[0], places[-1])]
    outer, inner = groups[0].value + groups[-1].value, groups[len(groups) // 2].value
    both_ends = ends < min(rising, *outermost) and sign * (outer / 2.0 - inner) > 0.0
    p = min(1.0, 4.0 * min(rising, ends, *outermost))
    return Association(drawn.name, groups, p, 1.0, most, both_ends)


def of_groups(name: str, groups: tuple[GroupFigure, ...], sign: float, p_values: Sequence[float]) -> Association:
    """How something goes with groups without an order, each held against the rest.

    Named is the surest of the groups in which there is more than in the rest, and the p-value is its own: the largest
    rate may be that of a single game.

    Args:
        name: of what divides them.
        groups: two at least.
        sign: whether groups stand out that have more of it (1) or less (−1).
        p_values: of each group against the rest.
    """
    ahead = [place for place, one in enumerate(groups) if sign * (one.value - one.rest_value) > 0.0]
    if not ahead:
        return Association(name, groups, 1.0, 1.0, _largest(groups, sign))
    most = min(ahead, key=p_values.__getitem__)
    tests = 1 if len(groups) == 2 else len(groups)
    return Association(name, groups, min(1.0, tests * p_values[most]), 1.0, most)


def _largest(groups: Sequence[GroupFigure], sign: float) -> int:
    return max(range(len(groups)), key=lambda place: sign * groups[place].value)


def group_figures(
    values: Numbers, group: np.typing.NDArray[np.int64], labels: Sequence[str]
) -> tuple[tuple[GroupFigure, ...], tuple[int, ...]]:
    """Averages by group; those without a game are left out. Also which groups these are."""
    places = tuple(int(place) for place in np.unique(group))
    figures = []
    for place in places:
        inside, outside = values[group == place], values[group != place]
        rest = float(outside.mean()) if outside.size else float("nan")
        figures.append(GroupFigure(labels[place], inside.size, float(inside.mean()), outside.size, rest))
    return tuple(figures), places


def _differ(one: Numbers, other: Numbers) -> float:
    """Exact of flags, by ranks of figures."""
    if set(np.unique(np.concatenate([one, other]))) <= {0.0, 1.0}:
        return fisher(int(one.sum()), one.size, int(other.sum()), other.size)
    return mann_whitney(one, other)


def _goes_with(figure: Numbers, along: Numbers) -> float:
    if set(np.unique(figure)) <= {0.0, 1.0}:
        return mann_whitney(along[figure == 1.0], along[figure == 0.0])
    return rank_correlation(figure, along)


def where_a_change_sits(
    older: Numbers, newer: Numbers, ranges: Sequence[DrawnRange], sign: float
) -> tuple[Association, ...]:
    """In which ranges the difference between two sets of games differs from group to group.

    The differences of fifths are held against each other (Cochran's Q), and their rise along a range against 0; that
    of each category is held against the others'. This is done in the pooled ranks of the figures; groups say the
    difference in the figures themselves.

    Args:
        older: a figure of each game of the one; NaN: nothing is known of it.
        newer: of the other.
        ranges: what was drawn for the games of both, older ones first.
        sign: of the whole difference.
    """
    found = [_change_by_group(older, newer, one, sign) for one in ranges]
    return corrected([one for one in found if one is not None])


def _change_by_group(older: Numbers, newer: Numbers, drawn: DrawnRange, sign: float) -> Association | None:
    values = np.concatenate([older, newer])
    is_new = np.arange(values.size) >= older.size
    known = ~np.isnan(values) & (drawn.group >= 0)
    values, is_new, group = values[known], is_new[known], drawn.group[known]
    places = [
        place for place in np.unique(group) if min(np.sum(is_new[group == place]), np.sum(~is_new[group == place])) > 1
    ]
    if len(places) < 2:
        return None
    groups = tuple(_change_in(values, is_new, group, place, drawn.labels) for place in places)
    ranks = rankdata(values) / values.size
    cells = [(ranks[(group == place) & is_new], ranks[(group == place) & ~is_new]) for place in places]
    changed, variances = _changes(cells)
    if drawn.values is None:
        return of_groups(drawn.name, groups, sign, _contrasts(changed, variances))
    return Association(drawn.name, groups, _heterogeneity(changed, variances), 1.0, _largest(groups, sign))


def _change_in(
    values: Numbers, is_new: Flags, group: np.typing.NDArray[np.int64], place: int, labels: Sequence[str]
) -> GroupFigure:
    inside, outside = group == place, group != place

    def change(chosen: Flags) -> float:
        return float(values[chosen & is_new].mean() - values[chosen & ~is_new].mean())

    return GroupFigure(labels[place], int(inside.sum()), change(inside), int(outside.sum()), change(outside))


def _changes(cells: Sequence[tuple[Numbers, Numbers]]) -> tuple[Numbers, Numbers]:
    """The change of each group, newer less older, and its variance by the spread within all of them."""
    within = sum(float(np.sum((cell - cell.mean()) ** 2)) for pair in cells for cell in pair)
    spread = within / (sum(cell.size for pair in cells for cell in pair) - 2 * len(cells))
    changed = np.array([new.mean() - old.mean() for new, old in cells])
    return changed, spread * np.array([1.0 / new.size + 1.0 / old.size for new, old in cells])


def _contrasts(changed: Numbers, variances: Numbers) -> list[float]:
    """The p-value of each group's change being that of the others, weighted by how well theirs are known."""
    if not variances.any():
        return [1.0] * changed.size
    weights = 1.0 / variances
    others = weights.sum() - weights
    away = changed - (np.sum(weights * changed) - weights * changed) / others
    return [float(p) for p in 2.0 * norm.sf(np.abs(away) / np.sqrt(variances + 1.0 / others))]


def _heterogeneity(changed: Numbers, variances: Numbers) -> float:
    """The p-value of the changes of groups in an order being one (Cochran's Q), and of no rise along it."""
    if not variances.any():
        return 1.0
    weights, order = 1.0 / variances, np.arange(changed.size)
    away = changed - float(np.average(changed, weights=weights))
    different = float(chi2.sf(np.sum(weights * away**2), changed.size - 1))
    along = order - float(np.average(order, weights=weights))
    rise = float(np.sum(weights * along * changed) / np.sqrt(np.sum(weights * along**2)))
    return min(1.0, 2.0 * min(different, float(2.0 * norm.sf(abs(rise)))))
