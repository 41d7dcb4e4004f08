"""All that a campaign's report says, found once: the page draws it, sentences tell it, ``--json`` hands it on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from pydantic import BaseModel

from app import UserError
from app.campaign.environment import CampaignEnvironment
from app.campaign.report.analysis.comparing import (
    GameMatch,
    MetricChange,
    changes,
    differ,
    known,
    level_of,
    matched,
    sides_of,
    visible_rate,
    with_the_same_plies,
)
from app.campaign.report.analysis.conditions import drawn_ranges
from app.campaign.report.analysis.distributions import FIGURES, Distribution, ProductBar, distribution, product_bars
from app.campaign.report.analysis.explaining import Association, explained
from app.campaign.report.analysis.locating import located
from app.campaign.report.analysis.metrics import FAILED, OUTCOMES, Metric, MetricSort
from app.campaign.report.analysis.rows import CampaignRows
from app.campaign.report.analysis.statistics import Numbers, RateBounds, rate_at_most, rate_bounds
from app.campaign.report.gate import GateBars, GateVerdict, QuantileBar, bars_by_figure, judged
from app.settings.toml import ConfigError, toml_value


@dataclass(frozen=True, slots=True)
class OutcomeRate:
    """How often games ended in a certain way.

    Attributes:
        outcome: which, or a word for several.
        says: in words.
        hits: so many games.
        games: of all.
        bounds: of the rate, with 95 % confidence.
        at_most: the upper bound alone, likewise.
    """

    outcome: str
    says: str
    hits: int
    games: int
    bounds: RateBounds
    at_most: float


@dataclass(frozen=True, slots=True)
class FailedGame:
    """A game that failed.

    Attributes:
        seed: of it.
        outcome: how it ended.
        reason: why.
        said: the last sentence that a person was told.
        folder: where its folder was kept, in that of the campaign; empty: it was not.
        log: of a crash, its last words.
        repeatable: the world ends the same to the last bit each time.
    """

    seed: int
    outcome: str
    reason: str
    said: str
    folder: str
    log: str
    repeatable: bool


@dataclass(frozen=True, slots=True)
class HostThroughput:
    """What the workers of one machine came to.

    Attributes:
        host: its name.
        cpu: its processor.
        games: so many.
        wall: what they took together, each on one worker [s].
        plant: what they lasted in plant time [s].
    """

    host: str
    cpu: str
    games: int
    wall: float
    plant: float

    @property
    def games_an_hour(self) -> float:
        """Of one worker, which is one core."""
        return 3600.0 * self.games / self.wall if self.wall > 0.0 else float("nan")

    @property
    def speed(self) -> float:
        """Plant time in one second of a worker."""
        return self.plant / self.wall if self.wall > 0.0 else float("nan")


@dataclass(frozen=True, slots=True)
class CampaignComparison:
    """What came of holding a campaign against an older one.

    Attributes:
        older: the older campaign, all of it.
        match: which games were held against which.
        changes: of each metric in which anything differs, those that were found located; in the order of the metrics.
        same: metrics that were measured and of which there is nothing to test, since every figure is the same.
        visible: something that happened in a larger share of the newer games, and in none of the older, would have been
            seen; None: there are too few games.
        differences: in what was drawn, and in the environments; None: nobody can say.
    """

    older: CampaignRows
    match: GameMatch
    changes: tuple[MetricChange, ...]
    same: tuple[Metric, ...]
    visible: float | None
    differences: tuple[str, ...] | None

    @property
    def found(self) -> tuple[MetricChange, ...]:
        """The changes that are more than chance: first how games end, if that is worse, then the surest first."""
        return tuple(sorted(
            (one for one in self.changes if one.found),
            key=lambda one: (not (one.worse and one.metric.sort is MetricSort.RATE), one.corrected),
        ))  # fmt: skip

    @property
    def told(self) -> tuple[MetricChange, ...]:
        """The same without one of the same games as another: all failures may be of one sort."""
        told: list[MetricChange] = []
        for change in reversed(self.found):
            same = any(np.array_equal(change.newer, one.newer, True) and np.array_equal(change.older, one.older, True)
                       for one in told)  # fmt: skip
            told += [] if same else [change]
        return tuple(told[::-1])


@dataclass(frozen=True, slots=True)
class CampaignFindings:
    """The whole.

    Attributes:
        rows: what it was found in.
        rates: of all outcomes, and of failures together first.
        distributions: of the figures of which there are any.
        product_bars: what the product holds figures against, by key.
        gate_bars: what the gate does.
        failures: every game that failed, in the order of seeds.
        explains_failures: ranges that failures were held against, the surest first.
        explains_mending: the same for games in which something was mended or asked.
        throughput: by machine.
        comparison: with an older campaign; None: none was given.
        verdicts: of the gate; None: none was given.
    """

    rows: CampaignRows
    rates: tuple[OutcomeRate, ...]
    distributions: tuple[Distribution, ...]
    product_bars: Mapping[str, tuple[ProductBar, ...]]
    gate_bars: Mapping[str, QuantileBar]
    failures: tuple[FailedGame, ...]
    explains_failures: tuple[Association, ...]
    explains_mending: tuple[Association, ...]
    throughput: tuple[HostThroughput, ...]
    comparison: CampaignComparison | None
    verdicts: tuple[GateVerdict, ...] | None

    @property
    def holds(self) -> bool:
        """The gate is held; without one, no game failed."""
        return not self.failures if self.verdicts is None else all(verdict.held for verdict in self.verdicts)


_FAILURES: Final = "failed"
_LENGTHS: Final = ("game.plies", "session.acts")
"""What decides how long games and sessions are."""


class CampaignComparisonError(UserError):
    """Two campaigns cannot be held against each other."""


def findings(rows: CampaignRows, older: CampaignRows | None = None, bars: GateBars | None = None) -> CampaignFindings:
    """Find out all that there is to say of a campaign.

    Raises:
        ConfigError: the campaign's file cannot be read; or the gate asks for a comparison, and there is no older one.
        CampaignComparisonError: the older campaign is of another kind.
    """
    if rows.unread:  # it says how many games there will be; without it a campaign that goes on would seem finished
        raise ConfigError(rows.unread)
    comparison = None if older is None else compared(older, rows)
    ranges = drawn_ranges(rows)
    failed, mended = rows.outcome_is(*FAILED), rows.outcome_is("mended")
    found = [distribution(figure, rows) for figure in FIGURES]
    return CampaignFindings(
        rows, _rates(rows), tuple(one for one in found if one is not None), product_bars(rows), bars_by_figure(bars),
        _failures(rows), explained(failed, ranges) if failed.any() else (),
        explained(mended, ranges) if mended.any() else (), _throughput(rows), comparison,
        None if bars is None else _judged(bars, rows, comparison),
    )  # fmt: skip


def _judged(bars: GateBars, rows: CampaignRows, comparison: CampaignComparison | None) -> tuple[GateVerdict, ...]:
    return judged(bars, rows) if comparison is None else judged(bars, rows, comparison.match, comparison.changes)


def compared(older: CampaignRows, newer: CampaignRows) -> CampaignComparison:
    """Hold a campaign against an older one.

    Raises:
        CampaignComparisonError: they are of different kinds.
    """
    _require_one_kind(older, newer)
    match = with_the_same_plies(matched(older, newer))
    if _lengths_differ(older, newer):
        match = match.without_whole_games
    found = tuple(
        replace(change, where=located(change, match)) if change.found else change for change in changes(match)
    )
    same = tuple(metric for metric in match.metrics if _the_same(*sides_of(metric, match), match.paired))
    none = np.zeros(len(match.older.games)), np.zeros(len(match.newer.games))
    visible = visible_rate(*none, match.paired, level_of(len(found) + 1))
    return CampaignComparison(older, match, found, same, visible, _differences(older, newer))


def _require_one_kind(older: CampaignRows, newer: CampaignRows) -> None:
    before, now = _kinds(older), _kinds(newer)
    if before and now and before != now:
        raise CampaignComparisonError(
            f"'{newer.name}' is a campaign of kind {' and '.join(sorted(now))}, and '{older.name}' one of kind "
            f"{' and '.join(sorted(before))}: compare two of the same kind"
        )


def _kinds(rows: CampaignRows) -> set[str]:
    """What was played; empty: nobody knows."""
    return {rows.kept.spec.kind.value} if rows.kept is not None else set(rows.games.words("kind")) - {None}


def _lengths_differ(older: CampaignRows, newer: CampaignRows) -> bool:
    """Whether the games of one campaign were to be longer than those of the other; by its games if its file is not."""
    if older.unread:
        was, is_now = (known(rows.games.numbers("plies_asked_for")) for rows in (older, newer))
        return bool(np.max(was, initial=0.0) != np.max(is_now, initial=0.0))
    if older.kept is None or newer.kept is None:
        return False
    before, now = older.kept.spec.draw, newer.kept.spec.draw
    return any(before.get(name) != now.get(name) for name in _LENGTHS)


def _the_same(older: Numbers, newer: Numbers, paired: bool) -> bool:
    measured = min(known(older).size, known(newer).size) > 0
    return measured and not differ(older, newer, paired)


def _differences(older: CampaignRows, newer: CampaignRows) -> tuple[str, ...] | None:
    """What is otherwise in the newer campaign, a phrase each: what its file draws, then its environment."""
    if older.kept is None or newer.kept is None:
        return None
    before, now = older.kept.spec.draw, newer.kept.spec.draw
    drawn = tuple(
        _otherwise(name, before, now) for name in sorted({*before, *now}) if before.get(name) != now.get(name)
    )
    return drawn + _named(older.kept.environment).differences(_named(newer.kept.environment))


def _named(environment: CampaignEnvironment) -> CampaignEnvironment:
    """With a word for the engine where none plays."""
    return environment.model_copy(update={"engine": environment.engine or "none"})


def _otherwise(name: str, before: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    if name not in before:
        return f"{name} is given only here, as {_drawn(now[name])}"
    if name not in now:
        return f"{name} is not given here, and was {_drawn(before[name])}"
    return f"{name} is {_drawn(now[name])} instead of {_drawn(before[name])}"


def _drawn(value: Any) -> str:
    return toml_value(value.model_dump(by_alias=True) if isinstance(value, BaseModel) else value)


def _rates(rows: CampaignRows) -> tuple[OutcomeRate, ...]:
    rates = [_rate(_FAILURES, "failed in any way", rows, *FAILED)]
    return (*rates, *(_rate(outcome, says, rows, outcome) for outcome, says in OUTCOMES.items()))


def _rate(name: str, says: str, rows: CampaignRows, *outcomes: str) -> OutcomeRate:
    hits, games = int(rows.outcome_is(*outcomes).sum()), len(rows.games)
    return OutcomeRate(name, says, hits, games, rate_bounds(hits, games), rate_at_most(hits, games))


def _failures(rows: CampaignRows) -> tuple[FailedGame, ...]:
    games = rows.games.where(np.flatnonzero(rows.outcome_is(*FAILED)))
    seeds, repeatable = games.numbers("seed").astype(np.int64), games.numbers("repeatable") != 0.0

    def text(name: str, place: int) -> str:
        return games.words(name)[place] or ""

    return tuple(
        FailedGame(
            int(seeds[place]), text("outcome", place), text("reason", place), text("said", place),
            text("folder", place), text("log", place), bool(repeatable[place]),
        )
        for place in np.argsort(seeds, kind="stable")
    )  # fmt: skip


def _throughput(rows: CampaignRows) -> tuple[HostThroughput, ...]:
    games = rows.games
    hosts = np.array([one or "unknown" for one in games.words("host")], dtype=np.object_)
    cpus, walls, plants = games.words("cpu"), games.numbers("wall_s"), games.numbers("sim_s")
    found = []
    for host in sorted(set(hosts)):
        here = (hosts == host) & (walls > 0.0)
        if here.any():
            cpu = next((one for one in cpus[here] if one is not None), "")
            found.append(
                HostThroughput(host, cpu, int(here.sum()), float(walls[here].sum()), float(np.nansum(plants[here])))
            )
    return tuple(found)
