"""What was drawn for each game, in groups that can be held against each other: fifths of numbers, or categories."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.campaign.report.analysis.rows import CampaignRows
from app.campaign.report.analysis.statistics import Numbers
from app.campaign.schema import DRAWN
from app.report.plot import number

GROUPS: Final = 5
"""Numbers fall into so many groups of one size; with no more different values, each value is a group."""
_MOST_CATEGORIES: Final = 40
"""Words that differ from game to game, such as positions, explain nothing."""
BESIDE_DRAWN: Final = {"kind": "the kind of game", "host": "the machine"}
"""Columns that no range draws, and that games may differ by all the same; and how people call them."""


@dataclass(frozen=True, slots=True)
class DrawnRange:
    """A range, and what it was drawn to in each game.

    Attributes:
        name: of the range.
        values: shape (games,), NaN where it was not drawn; None: these are words, or few numbers.
        group: to which group each game belongs, shape (games,); −1: to none.
        labels: what the groups are called, from the least to the largest.
    """

    name: str
    values: Numbers | None
    group: NDArray[np.int64]
    labels: tuple[str, ...]


def drawn_ranges(*campaigns: CampaignRows) -> tuple[DrawnRange, ...]:
    """The ranges of one campaign, or of several put together, game after game; those that do not vary are left out."""
    names = [name for rows in campaigns for name in rows.games.columns if name.startswith(DRAWN)]
    found = [_range(name, campaigns) for name in dict.fromkeys([*names, *BESIDE_DRAWN])]
    return tuple(one for one in found if one is not None)


def _range(name: str, campaigns: tuple[CampaignRows, ...]) -> DrawnRange | None:
    shown = BESIDE_DRAWN.get(name, name.removeprefix(DRAWN))
    numbers = np.concatenate([rows.games.numbers(name) for rows in campaigns])
    words = np.concatenate([rows.games.words(name) for rows in campaigns])
    if np.any(words != None):  # noqa: E711 - of each of an array's elements
        texts = [number(n) if w is None and not np.isnan(n) else w for w, n in zip(words, numbers, strict=True)]
        return _categories(shown, texts)
    distinct = np.unique(numbers[~np.isnan(numbers)])
    if distinct.size <= GROUPS:
        return _few_numbers(shown, numbers, distinct)
    return DrawnRange(shown, numbers, *_fifths(numbers))


def _categories(name: str, texts: list[str | None]) -> DrawnRange | None:
    labels = sorted({text for text in texts if text is not None})
    if not 1 < len(labels) <= _MOST_CATEGORIES:
        return None
    places = {label: place for place, label in enumerate(labels)}
    group = np.array([-1 if text is None else places[text] for text in texts], dtype=np.int64)
    return DrawnRange(name, None, group, tuple(labels))


def _few_numbers(name: str, numbers: Numbers, distinct: Numbers) -> DrawnRange | None:
    if distinct.size < 2:
        return None
    group = np.where(np.isnan(numbers), -1, np.searchsorted(distinct, np.nan_to_num(numbers, nan=distinct[0])))
    return DrawnRange(name, None, group.astype(np.int64), tuple(number(float(value)) for value in distinct))


def _fifths(numbers: Numbers) -> tuple[NDArray[np.int64], tuple[str, ...]]:
    known = numbers[~np.isnan(numbers)]
    edges = np.unique(np.quantile(known, np.linspace(0.0, 1.0, GROUPS + 1)))
    group = np.searchsorted(edges[1:-1], np.nan_to_num(numbers, nan=edges[0]), side="right")
    labels = tuple(f"{number(float(low))} to {number(float(high))}" for low, high in pairwise(edges))
    return np.where(np.isnan(numbers), -1, group).astype(np.int64), labels
