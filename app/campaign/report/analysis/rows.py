"""What a campaign's report is made from: the rows of games and plies as columns of numbers and words."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.campaign.folder import KeptCampaign
from app.campaign.report.analysis.statistics import Flags, Numbers

Words = NDArray[np.object_]
"""Texts; None where there is none."""


@dataclass(frozen=True, slots=True)
class RowTable:
    """Rows of one kind, by column, all of one length."""

    columns: Mapping[str, NDArray[Any]]

    @classmethod
    def of(cls, rows: Sequence[Mapping[str, Any]], names: Iterable[str] = ()) -> RowTable:
        """The columns of rows; one that a row does not have is None there. ``names`` are there also without a row."""
        wanted = dict.fromkeys(names)
        for row in rows:
            wanted.update(dict.fromkeys(row))
        return cls({name: _column([row.get(name) for row in rows]) for name in wanted})

    def __len__(self) -> int:
        return max((column.size for column in self.columns.values()), default=0)

    def numbers(self, name: str) -> Numbers:
        """A column of numbers, NaN where there is none; so throughout where there is no such column."""
        column = self.columns.get(name)
        if column is None:
            return np.full(len(self), np.nan)
        return column if column.dtype == np.float64 else np.full(column.size, np.nan)

    def words(self, name: str) -> Words:
        """A column of texts, None where there is none; so throughout where there is no such column."""
        column = self.columns.get(name)
        if column is None or column.dtype != np.object_:
            return np.full(len(self), None, dtype=np.object_)
        return column

    def where(self, chosen: Flags | NDArray[np.int64]) -> RowTable:
        """Some of the rows: by flags, or by their places in the order wanted."""
        return RowTable({name: column[chosen] for name, column in self.columns.items()})


def _column(values: Sequence[Any]) -> NDArray[Any]:
    """Numbers and truths as numbers, everything else as words."""
    if all(value is None or isinstance(value, (int, float)) for value in values):
        return np.array([np.nan if value is None else float(value) for value in values], dtype=np.float64)
    found = np.empty(len(values), dtype=np.object_)
    found[:] = [None if value is None else str(value) for value in values]
    return found


@dataclass(frozen=True, slots=True)
class CampaignRows:
    """All that a campaign has found so far, in the order of its seeds.

    Attributes:
        name: of the campaign's folder, as the command line had it.
        games: one row each.
        plies: one row each, in the order of games and plies.
        wanted: so many games the campaign has; None: nobody said.
        kept: what was drawn, and the environment; None: likewise.
        unread: why the campaign's file, which says that, cannot be read; empty: it can, or there is none.
    """

    name: str
    games: RowTable
    plies: RowTable
    wanted: int | None = None
    kept: KeptCampaign | None = None
    unread: str = ""

    @property
    def unfinished(self) -> bool:
        """Games are still to come."""
        return self.wanted is not None and self.wanted > len(self.games)

    @property
    def seeds(self) -> NDArray[np.int64]:
        """Of the games, shape (games,)."""
        return self.games.numbers("seed").astype(np.int64)

    def outcome_is(self, *outcomes: str) -> Flags:
        """Which games ended so."""
        return np.isin(self.games.words("outcome"), outcomes)

    @property
    def by_arm(self) -> Flags:
        """Which plies the arm made, shape (plies,); of the others nothing is measured."""
        return np.asarray(self.plies.words("by") != "hand", dtype=np.bool_)

    def game_of_plies(self) -> NDArray[np.int64]:
        """Of each ply the place of its game among the games, −1 where there is none."""
        seeds, of_plies = self.seeds, self.plies.numbers("seed").astype(np.int64)
        order = np.argsort(seeds, kind="stable")
        place = np.searchsorted(seeds[order], of_plies)
        found = np.minimum(place, max(seeds.size - 1, 0))
        if not seeds.size:
            return np.full(of_plies.size, -1)
        return np.where(seeds[order][found] == of_plies, order[found], -1)
