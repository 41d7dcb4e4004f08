"""Bars that a release has to reach, from a TOML file; each is judged in one sentence.

What is judged are bounds and not what was counted: 0 of 50 games wrong does not show that fewer than 1 % are.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from pydantic import BaseModel, ConfigDict, Field

from app.campaign.report.analysis.comparing import GameMatch, MetricChange
from app.campaign.report.analysis.distributions import (
    FIGURES,
    CampaignFigure,
    ProductBar,
    distribution,
    share_beyond,
)
from app.campaign.report.analysis.metrics import METRICS, Metric
from app.campaign.report.analysis.rows import CampaignRows
from app.campaign.report.analysis.statistics import CONFIDENCE, rate_at_most
from app.campaign.report.wording import amount, counted, percent
from app.settings.toml import ConfigError, load_toml

Confidence = Field(default=CONFIDENCE, gt=0.5, lt=1.0)


class GatePart(BaseModel):
    """A table of the file; a name that there is not is refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class RateBar(GatePart):
    """How often something may happen to a game: the upper bound of its rate."""

    at_most: float = Field(ge=0.0, lt=1.0)
    confidence: float = Confidence


class QuantileBar(GatePart):
    """What a share of all plies, or games, may not exceed: the rest's share, by its upper bound."""

    quantile: float = Field(gt=0.0, lt=1.0)
    at_most: float = Field(ge=0.0)
    confidence: float = Confidence


class DurationBars(GatePart):
    """Of plies by kind, from home to home [s]."""

    quiet: QuantileBar | None = None
    capture: QuantileBar | None = None
    castling: QuantileBar | None = None
    en_passant: QuantileBar | None = None
    promotion: QuantileBar | None = None


class GamesBar(GatePart):
    """So many games have to be played."""

    at_least: int = Field(ge=1)


class ComparisonBar(GatePart):
    """What a comparison may find: with ``nothing_worse`` no metric that is worse."""

    nothing_worse: bool


class GateBars(GatePart):
    """The whole file: every table may be left out, but not all that ask for something."""

    games: GamesBar | None = None
    failed: RateBar | None = None
    wrong: RateBar | None = None
    unmended: RateBar | None = None
    crashed: RateBar | None = None
    mended: RateBar | None = None
    duration: DurationBars | None = None
    placement: QuantileBar | None = None
    torque: QuantileBar | None = None
    force: QuantileBar | None = None
    grips_lost: QuantileBar | None = None
    repairs: QuantileBar | None = None
    asked: QuantileBar | None = None
    missed_ticks: QuantileBar | None = None
    compare: ComparisonBar | None = None

    def of_metrics(self) -> Iterator[tuple[Metric, RateBar]]:
        """The bars of rates."""
        for metric in METRICS:
            bar = getattr(self, metric.key, None) if metric.outcomes else None
            if bar is not None:
                yield metric, bar

    def of_figures(self) -> Iterator[tuple[CampaignFigure, QuantileBar]]:
        """The bars of figures."""
        for figure in FIGURES:
            group, _, kind = figure.key.partition(".")
            bar = getattr(self, group)
            bar = getattr(bar, kind) if kind and bar is not None else bar
            if bar is not None:
                yield figure, bar

    @property
    def asks(self) -> bool:
        """Whether any campaign could miss it: an empty table, or one that switches itself off, asks for nothing."""
        compares = self.compare is not None and self.compare.nothing_worse
        return self.games is not None or compares or any(self.of_metrics()) or any(self.of_figures())


@dataclass(frozen=True, slots=True)
class GateVerdict:
    """One bar: its name in the file, whether it is held, and a sentence."""

    bar: str
    held: bool
    sentence: str


_WRITE: Final = "docs/examples/bars.toml is one to begin with"


def load_bars(path: Path) -> GateBars:
    """Read a gate.

    Raises:
        ConfigError: it cannot be read, something in it is wrong, or it asks for nothing.
    """
    bars = load_toml(path, GateBars, "gate", _WRITE)
    if not bars.asks:
        raise ConfigError(f"gate file {path} asks for nothing, so that nothing could miss it: {_WRITE}")
    return bars


def judged(
    bars: GateBars, rows: CampaignRows, match: GameMatch | None = None, changes: tuple[MetricChange, ...] = ()
) -> tuple[GateVerdict, ...]:
    """Hold a campaign against the bars.

    Args:
        bars: of the file.
        rows: of the campaign.
        match: which of its games were held against which of an older one; None: it was not compared.
        changes: what that found.

    Raises:
        ConfigError: the bars ask for a comparison, and there is none.
    """
    verdicts = [] if bars.games is None else [_games(bars.games, rows)]
    verdicts += [_rate(metric, bar, rows) for metric, bar in bars.of_metrics()]
    verdicts += [_quantile(figure, bar, rows) for figure, bar in bars.of_figures()]
    if bars.compare is not None and bars.compare.nothing_worse:
        verdicts.append(_nothing_worse(match, changes))
    return tuple(replace(one, sentence=f"so far, {one.sentence}") if rows.unfinished else one for one in verdicts)


def _games(bar: GamesBar, rows: CampaignRows) -> GateVerdict:
    count = len(rows.games)
    played = f"{counted(count, 'game')} {'was' if count == 1 else 'were'} played"
    wanted = f"at least {bar.at_least} {'is' if bar.at_least == 1 else 'are'} wanted"
    return GateVerdict("games", count >= bar.at_least, f"{played}, {wanted}")


def _rate(metric: Metric, bar: RateBar, rows: CampaignRows) -> GateVerdict:
    hits, games = int(rows.outcome_is(*metric.outcomes).sum()), len(rows.games)
    bound = rate_at_most(hits, games, bar.confidence)
    held = bound <= bar.at_most
    sentence = (
        f"{metric.name}: {hits} of {games}, so at most {percent(bound)} with {percent(bar.confidence)} confidence; "
        f"the bar is {percent(bar.at_most)}"
    )
    if hits == 0 and not held:
        sentence += f", which takes {games_for(bar)} without one"
    return GateVerdict(metric.key, held, sentence)


def games_for(bar: RateBar) -> str:
    """So many games without a hit it takes to show a bar."""
    if bar.at_most == 0.0:
        return "more than any number of games"
    return counted(math.ceil(math.log(1.0 - bar.confidence) / math.log(1.0 - bar.at_most)), "game")


def _quantile(figure: CampaignFigure, bar: QuantileBar, rows: CampaignRows) -> GateVerdict:
    found = distribution(figure, rows)
    if found is None:
        return GateVerdict(figure.key, False, f"{figure.name}: there was none to judge")
    beyond = share_beyond(found, rows, ProductBar(bar.at_most, "", bar.confidence))
    allowed = 1.0 - bar.quantile
    what = "plies" if figure.of_plies else "games played to the end"
    held = beyond.at_most <= allowed + 1e-12
    sentence = (
        f"{figure.name}: {percent(bar.quantile)} of the {what} are within {amount(found.quantile(bar.quantile))}"
        f"{_unit(figure)}; {beyond.hits} of {beyond.trials} are beyond {amount(bar.at_most)}{_unit(figure)}, so at "
        f"most {percent(beyond.at_most)} with {percent(bar.confidence)} confidence; the bar is {percent(allowed)}"
    )
    if beyond.hits == 0 and not held:
        sentence += f", which takes {games_for(RateBar(at_most=allowed, confidence=bar.confidence))} without one"
    return GateVerdict(figure.key, held, sentence)


def _unit(figure: CampaignFigure) -> str:
    return f" {figure.unit}" if figure.unit else ""


def _nothing_worse(match: GameMatch | None, changes: tuple[MetricChange, ...]) -> GateVerdict:
    if match is None:
        raise ConfigError("the gate asks that nothing is worse than in an older campaign: say which, by --compare")
    if match.empty:
        return GateVerdict("compare", False, nothing_compared(match))
    worse = [change.metric.name for change in changes if change.found and change.worse]
    said = f"worse than before: {', '.join(worse)}" if worse else "nothing was found to be worse than before"
    return GateVerdict("compare", not worse, said)


def nothing_compared(match: GameMatch) -> str:
    """That there was nothing to compare, and when there will be, as a sentence without capital and stop."""
    empty = " and ".join(dict.fromkeys(f"'{one.name}'" for one in (match.older, match.newer) if not len(one.games)))
    return f"there was nothing to compare, as no game is done in {empty}: compare again once some are"


def bars_by_figure(bars: GateBars | None) -> Mapping[str, QuantileBar]:
    """The bars of figures by their keys; of no gate none."""
    return {} if bars is None else {figure.key: bar for figure, bar in bars.of_figures()}
