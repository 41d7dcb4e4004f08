"""What a campaign is judged by: how often games end badly, and figures of each game. Less is better of all of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.campaign.report.analysis.rows import CampaignRows
from app.campaign.report.analysis.statistics import Numbers
from app.campaign.schema import TaskOutcome
from app.pieces.inventory import MoveKind

OUTCOMES: Final[Mapping[TaskOutcome, str]] = {
    TaskOutcome.RIGHT: "right, and nothing had to be mended",
    TaskOutcome.MENDED: "right, after something was mended or asked",
    TaskOutcome.UNMENDED: "ended early, and said so",
    TaskOutcome.WRONG: "silently wrong: the referee disagrees with what the program claims",
    TaskOutcome.CRASHED: "crashed, or its worker died each time, the last time alone",
}
"""How a game can end, and in words."""
FAILED: Final = (TaskOutcome.UNMENDED, TaskOutcome.WRONG, TaskOutcome.CRASHED)
"""Outcomes that are failures."""
ENDED_EARLY: Final = (TaskOutcome.UNMENDED, TaskOutcome.CRASHED)
"""Outcomes of games in which not all plies were played."""


class MetricSort(StrEnum):
    """What a figure of a game is, and so how two campaigns are compared."""

    RATE = "rate"
    FIGURE = "figure"


@dataclass(frozen=True, slots=True)
class Metric:
    """One figure of each game.

    Attributes:
        key: as in files.
        name: for people.
        unit: of it; empty for counts and rates.
        sort: of what sort it is.
        column: where it stands in the rows.
        outcomes: of a rate, the outcomes that are hits.
        of_plies: the column is one of plies, and a game's figure their average.
        kind: of the plies; None: of any.
    """

    key: str
    name: str
    unit: str
    sort: MetricSort
    column: str
    outcomes: tuple[str, ...] = ()
    of_plies: bool = False
    kind: MoveKind | None = None

    @property
    def of_whole_games(self) -> bool:
        """It grows with the number of plies: a count, or the largest value of a game."""
        return self.sort is MetricSort.FIGURE and not self.of_plies

    def of_each_ply(self, rows: CampaignRows) -> Numbers:
        """The figure of each ply, shape (plies,); NaN where it says nothing about it."""
        values = np.where(rows.by_arm, rows.plies.numbers(self.column), np.nan)
        if self.kind is None:
            return values
        return np.where(rows.plies.words("kind") == self.kind.value, values, np.nan)

    def of_each_game(self, rows: CampaignRows) -> Numbers:
        """The figure of each game, shape (games,); NaN where there is none.

        Nor is there one of a whole game that ended early, as less would happen in it, which is no better; and how those
        that went right did so is counted among them alone.
        """
        if self.outcomes:
            hits = rows.outcome_is(*self.outcomes).astype(np.float64)
            return hits if set(FAILED) & set(self.outcomes) else np.where(rows.outcome_is(*FAILED), np.nan, hits)
        if self.of_plies:
            return mean_by_game(self.of_each_ply(rows), rows.game_of_plies(), len(rows.games))
        return np.where(rows.outcome_is(*ENDED_EARLY), np.nan, rows.games.numbers(self.column))


def _rate(key: str, name: str, *outcomes: str) -> Metric:
    return Metric(key, name, "", MetricSort.RATE, "outcome", outcomes)


def _figure(column: str, name: str, unit: str = "") -> Metric:
    return Metric(column, name, unit, MetricSort.FIGURE, column)


def _duration(kind: MoveKind) -> Metric:
    said = kind.value.replace("_", " ")
    return Metric(
        f"duration.{kind.value}", f"time of {said} plies", "s", MetricSort.FIGURE, "real_s", of_plies=True, kind=kind
    )


FAILURES: Final = _rate("failed", "games that failed", *FAILED)
METRICS: Final = (
    FAILURES,
    _rate("wrong", "games silently wrong", TaskOutcome.WRONG),
    _rate("unmended", "games that ended early", TaskOutcome.UNMENDED),
    _rate("crashed", "games that crashed", TaskOutcome.CRASHED),
    _rate("mended", "games in which something was mended or asked", TaskOutcome.MENDED),
    *map(_duration, MoveKind),
    Metric("placement", "placement, mean of the plies", "mm", MetricSort.FIGURE, "error_mm", of_plies=True),
    _figure("placement_max_mm", "placement, worst of a game", "mm"),
    Metric("torque", "peak torque, mean of the plies", "N m", MetricSort.FIGURE, "peak_torque_Nm", of_plies=True),
    _figure("peak_torque_Nm", "peak torque of a game", "N m"),
    Metric("force", "peak force, mean of the plies", "N", MetricSort.FIGURE, "peak_force_N", of_plies=True),
    _figure("peak_force_N", "peak force of a game", "N"),
    _figure("grips_lost", "grips lost in a game"),
    _figure("repairs", "repairs in a game"),
    _figure("asked", "questions to a person in a game"),
    _figure("missed_ticks", "missed ticks in a game"),
)
"""All that two campaigns are compared by."""


def mean_by_game(values: Numbers, game: NDArray[np.int64], games: int) -> Numbers:
    """The average of what plies say, of each game; NaN where none says anything.

    Args:
        values: of plies; NaN says nothing.
        game: the place of each ply's game; negative: of none.
        games: how many there are.
    """
    known = ~np.isnan(values) & (game >= 0)
    count = np.bincount(game[known], minlength=games)
    total = np.bincount(game[known], values[known], minlength=games)
    mean: Numbers = np.divide(total, count, out=np.full(games, np.nan), where=count > 0)
    return mean
