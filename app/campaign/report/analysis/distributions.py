"""How figures of plies and games are distributed, and the bars that the product itself holds them against."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.campaign.report.analysis.metrics import ENDED_EARLY
from app.campaign.report.analysis.rows import CampaignRows
from app.campaign.report.analysis.statistics import CONFIDENCE, Numbers, clustered_at_most, rate_at_most
from app.pieces.inventory import MoveKind
from app.pieces.judging import most_off_centre
from app.report.plot import number
from controller.protection.limits import Limits, default_limits
from hardware.parameters import load_parameters
from hardware.table import TableSettings

QUANTILES: Final = (0.5, 0.9, 0.99, 0.999)
"""Of each distribution that are told."""


@dataclass(frozen=True, slots=True)
class ProductBar:
    """What a figure is held against.

    Attributes:
        value: in the figure's unit.
        says: where it is from.
        confidence: of the bound of the share beyond it.
        counted: each value is held against it; else it is one of averages, and only drawn.
    """

    value: float
    says: str
    confidence: float = CONFIDENCE
    counted: bool = True


@dataclass(frozen=True, slots=True)
class CampaignFigure:
    """Something that is measured in each ply, or in each game.

    Attributes:
        key: as a gate calls it.
        name: for people.
        unit: of it; empty for counts.
        column: where it stands in the rows.
        of_plies: each ply has one; else each game.
        kind: of the plies; None: of any.
    """

    key: str
    name: str
    unit: str
    column: str
    of_plies: bool = True
    kind: MoveKind | None = None


DURATIONS: Final = tuple(
    CampaignFigure(f"duration.{kind.value}", f"{kind.value.replace('_', ' ')} plies, from home to home", "s", "real_s",
                   kind=kind)
    for kind in MoveKind
)  # fmt: skip
PEAKS: Final = (
    CampaignFigure("placement", "placement", "mm", "error_mm"),
    CampaignFigure("torque", "peak torque", "N m", "peak_torque_Nm"),
    CampaignFigure("force", "peak force", "N", "peak_force_N"),
)
COUNTS: Final = (
    CampaignFigure("grips_lost", "grips lost", "", "grips_lost", of_plies=False),
    CampaignFigure("repairs", "repairs", "", "repairs", of_plies=False),
    CampaignFigure("asked", "questions to a person", "", "asked", of_plies=False),
    CampaignFigure("missed_ticks", "missed ticks", "", "missed_ticks", of_plies=False),
)
FIGURES: Final = (*DURATIONS, *PEAKS, *COUNTS)
"""All that distributions are told of."""


@dataclass(frozen=True, slots=True)
class Distribution:
    """The values of one figure, and the places of their plies or games in the rows; at least one."""

    figure: CampaignFigure
    values: Numbers
    places: NDArray[np.int64]

    def quantile(self, share: float) -> float:
        """The value that this share of them does not exceed: one of them, not one between two."""
        return float(np.quantile(self.values, share, method="inverted_cdf"))

    @property
    def most(self) -> float:
        """The largest."""
        return float(self.values.max())

    @property
    def place_of_most(self) -> int:
        """The row of the largest."""
        return int(self.places[int(np.argmax(self.values))])


def distribution(figure: CampaignFigure, rows: CampaignRows) -> Distribution | None:
    """What the rows say of a figure; None: nothing. Of games those played to the end: in others less happened."""
    values = (rows.plies if figure.of_plies else rows.games).numbers(figure.column)
    known = ~np.isnan(values)
    if figure.of_plies:
        known &= rows.by_arm
    else:
        known &= ~rows.outcome_is(*ENDED_EARLY)
    if figure.kind is not None:
        known &= rows.plies.words("kind") == figure.kind.value
    places = np.flatnonzero(known)
    return Distribution(figure, values[known], places) if places.size else None


class ShareBeyond(NamedTuple):
    """How many values exceed a bar, of how many, and what share of all does at most, at the bar's confidence."""

    hits: int
    trials: int
    at_most: float


def share_beyond(found: Distribution, rows: CampaignRows, bar: ProductBar) -> ShareBeyond:
    """What exceeds a bar; of games that ended early those which did so all the same: of the others nobody knows."""
    beyond = found.values > bar.value
    count = int(beyond.sum())
    if not found.figure.of_plies:
        early = rows.games.numbers(found.figure.column)[rows.outcome_is(*ENDED_EARLY)]
        more = int(np.sum(early > bar.value))
        count, games = count + more, beyond.size + more
        return ShareBeyond(count, games, rate_at_most(count, games, bar.confidence))
    game, games = rows.game_of_plies()[found.places], len(rows.games)
    hits = np.bincount(game[beyond & (game >= 0)], minlength=games).astype(np.float64)
    trials = np.bincount(game[game >= 0], minlength=games).astype(np.float64)
    return ShareBeyond(count, beyond.size, clustered_at_most(hits, trials, bar.confidence))


def worst_game(found: Distribution, rows: CampaignRows) -> tuple[int, int | None]:
    """The seed of the game with the largest value, and its ply."""
    table = rows.plies if found.figure.of_plies else rows.games
    seed = int(table.numbers("seed")[found.place_of_most])
    return seed, int(table.numbers("ply")[found.place_of_most]) if found.figure.of_plies else None


def product_bars(rows: CampaignRows) -> dict[str, tuple[ProductBar, ...]]:
    """What the product itself holds figures against, by the figure's key: the referee's rule and the limits."""
    table = _smallest_table(rows)
    limits = default_limits(load_parameters(), table)
    return {
        "placement": (_bar(1e3 * most_off_centre(table), "the referee's bar, a quarter square, {} mm"),),
        **{key: tuple(make(limits) for make in of_limits) for key, of_limits in _LIMITS.items()},
    }


_LIMITS: Final[dict[str, Sequence[Callable[[Limits], ProductBar]]]] = {
    "torque": (
        lambda limits: _bar(limits.torque, "peak of the drives, {} N m"),
        lambda limits: _bar(limits.rms_torque, "rated, on average, {} N m", counted=False),
    ),
    "force": (
        lambda limits: _bar(limits.tactile, "lets go at {} N"),
        lambda limits: _bar(limits.grip_force, "grip, if it lasts, {} N"),
    ),
}


def _bar(value: float, says: str, *, counted: bool = True) -> ProductBar:
    return ProductBar(value, says.format(number(value)), counted=counted)


def _smallest_table(rows: CampaignRows) -> TableSettings:
    """The table with the smallest squares that were drawn, or those of all: a bar that holds for it holds for all."""
    squares = rows.games.numbers("drawn.rig.square")
    if not np.all(np.isnan(squares)):
        return TableSettings(square=1e-3 * float(np.nanmin(squares)))
    fixed = None if rows.kept is None else rows.kept.spec.fixed.get("rig.square")
    return TableSettings() if fixed is None else TableSettings(square=1e-3 * float(fixed))
