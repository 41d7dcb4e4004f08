"""What a report says, in words that need no statistics; the numbers behind them stand in tables."""

from __future__ import annotations

import math

from app.campaign.report.analysis.comparing import MetricChange, known
from app.campaign.report.analysis.effects import POWER
from app.campaign.report.analysis.explaining import Association
from app.campaign.report.analysis.metrics import METRICS, Metric, MetricSort
from app.campaign.report.analysis.statistics import CONFIDENCE
from app.campaign.report.findings import CampaignComparison, CampaignFindings, OutcomeRate
from app.campaign.report.gate import nothing_compared
from app.campaign.report.wording import amount, capital, chance, counted, interval, percent, signed

SAID_FIRST = ("failed", "duration.quiet", "duration.capture", "placement", "force")
"""Metrics of which it is said in words how large a change would have been seen."""


def lead(found: CampaignFindings) -> str:
    """How many games there are, and how many failed."""
    rows, failed = found.rows, found.rates[0]
    done = counted(failed.games, "game")
    if rows.unfinished:
        done = f"{failed.games} of {rows.wanted} games so far"
    plies = counted(len(rows.plies), "ply") if len(rows.plies) == 1 else f"{len(rows.plies)} plies"
    return f"{done}, {plies}: {failed.hits or 'none'} failed."


def rate_sentence(rate: OutcomeRate) -> str:
    """A rate with its bounds; of none the bound that remains."""
    what = _OF_GAMES[rate.outcome]
    if rate.games == 0:
        return "No game is done, so there is nothing to say."
    if rate.hits == 0:
        do = "are" if what.startswith("was ") else "do"
        return f"No game of {rate.games} {what}: at most {percent(rate.at_most)} {do}, with {_SURE} confidence."
    if rate.hits > 1:
        what = what.replace("was silently", "were silently")
    return (
        f"{rate.hits} of {counted(rate.games, 'game')} {what}: {percent(rate.hits / rate.games)}, with {_SURE} "
        f"confidence {interval(rate.bounds.low, rate.bounds.high)}."
    )


_SURE = percent(CONFIDENCE)
_OF_GAMES = {
    "failed": "failed",
    "right": "went right without any mending",
    "mended": "went right after something was mended or asked",
    "unmended": "ended early and said so",
    "wrong": "was silently wrong",
    "crashed": "crashed",
}


def explanation(what: str, found: tuple[Association, ...]) -> list[str]:
    """In which ranges failures come; a range is named only where that is more than chance."""
    if not found:
        return []
    holding = [one for one in found if one.holds]
    if not holding:
        tried = "the one range" if len(found) == 1 else f"any of {len(found)} ranges"
        return [f"{what} are not found to depend on {tried}: what differs is no more than chance."]
    return [_where_they_come(what, one, len(found)) for one in holding]


def _where_they_come(what: str, one: Association, tests: int) -> str:
    most = one.standing_out
    hits, rest = round(most.value * most.games), round(most.rest_value * most.rest)
    where = f"{one.name} is {most.label}"
    if one.both_ends:
        where = f"{one.name} is near either of its ends, most where it is {most.label}"
    return (
        f"{what} come where {where}: {hits} of {counted(most.games, 'game')} there, {rest} of {most.rest} elsewhere "
        f"(p {_p(one.corrected)}, corrected for {counted(tests, 'range')})."
    )


def _p(p: float) -> str:
    said = chance(p)
    return said.replace(" ", "\u00a0") if said.startswith("<") else f"=\u00a0{said}"


def comparison_lead(comparison: CampaignComparison) -> list[str]:
    """What was held against what."""
    match = comparison.match
    said = []
    if match.empty:
        said.append(f"{counted(len(match.older.games), 'older game')} and {len(match.newer.games)} newer.")
    elif match.paired:
        pairs = len(match.newer.games)
        said.append(f"{counted(pairs, 'pair')} of games with the same seed in both campaigns "
                    f"{'is' if pairs == 1 else 'are'} compared, ply by ply where the move is the same.")  # fmt: skip
        if match.left_out:
            said.append(f"{counted(match.left_out, 'game')} of either campaign, without a partner, left out.")
        alike = counted(match.alike, "pair") if match.alike else "No pair"
        said.append(f"{alike} ended with the world the same to the last bit.")
    else:
        said.append(f"Few seeds are in both campaigns, so all games are compared as two samples: "
                    f"{len(match.older.games)} older, {len(match.newer.games)} newer.")  # fmt: skip
    if match.metrics != METRICS:
        said.append("Their games have another number of plies, so counts and largest values of whole games are left "
                    "out; how games end may differ by that alone.")  # fmt: skip
    if match.older.unread:
        said.append(f"What was drawn in the older campaign is not known ({match.older.unread}).")
    elif comparison.differences is not None:
        said.append(
            f"What differs in this campaign: {'; '.join(comparison.differences)}." if comparison.differences
            else "Both draw the same, and were played by the same program, engine and packages."
        )  # fmt: skip
    return said


def comparison_sentences(comparison: CampaignComparison) -> list[str]:
    """What became better or worse, where it sits, and what would have been seen."""
    if comparison.match.empty:
        return [f"{capital(nothing_compared(comparison.match))}."]
    tests = len(comparison.changes)
    said = [change_sentence(change, tests, comparison.match.paired) for change in comparison.told]
    if not said:
        said.append(f"No difference was found in {_tested(tests)}.")
    visible = [one for one in comparison.changes if not one.found and one.metric.key in SAID_FIRST]
    seen = [f"{one.metric.name} {_size(one.metric, one.visible)}" for one in visible if one.visible is not None]
    if seen:
        said.append(f"A change of more than this would have been seen with {percent(POWER)} power: {'; '.join(seen)}.")
    too_few = [one.metric.name for one in comparison.changes
               if not one.found and one.visible is None and one.metric.sort is not MetricSort.RATE]  # fmt: skip
    if too_few:
        said.append(f"There are too few games for a change of these to be found, however large: {'; '.join(too_few)}.")
    if comparison.same:
        said.append(_all_the_same(comparison))
    return said


def _tested(tests: int) -> str:
    if tests < 2:
        return "the one metric that differs at all" if tests else "anything: every figure is the same"
    return f"any of {tests} metrics"


def _all_the_same(comparison: CampaignComparison) -> str:
    names = "; ".join(metric.name for metric in comparison.same)
    said = f"Nothing at all differs in: {names}."
    if comparison.visible is not None:
        said += (
            f" What was in no older game and is now in more than {percent(comparison.visible)} of them would have been "
            f"seen with {percent(POWER)} power."
        )
    return said


def change_sentence(change: MetricChange, tests: int, paired: bool) -> str:
    """One change that was found, and where it sits."""
    metric, estimate = change.metric, change.estimate
    word = "Worse" if change.worse else "Better"
    low, high = sorted((abs(estimate.low), abs(estimate.high)))
    if estimate.low * estimate.high <= 0.0:
        interval = f"{_signed(metric, estimate.low)} to {_signed(metric, estimate.high)}"
    else:
        interval = f"{_size(metric, low)} to {_size(metric, high)}"
    size = _size(metric, abs(estimate.value))
    if metric.sort is MetricSort.RATE:
        size = size.replace(" %", " points of a hundred")
    more = "more" if change.worse else "less"
    if metric.sort is MetricSort.FIGURE:
        more += " in a typical game" if change.typical else " on average"
    said = (
        f"{word}: {metric.name}: {size} {more} ({before_and_after(change)}; {_SURE} "
        f"interval {interval}; p {_p(change.corrected)}, corrected for {counted(tests, 'metric')})."
    )
    places = [one for one in change.where if one.holds]
    if places:
        return f"{said} {' '.join(_place(metric, one, paired) for one in places)}"
    if change.where:
        return f"{said} It was not found to sit in any particular range, kind of ply or piece."
    return said


def before_and_after(change: MetricChange) -> str:
    """The average before and after, of all games that are compared."""
    before, after = (float(known(side).mean()) for side in (change.older, change.newer))
    return f"{_plain(change.metric, before)} → {_size(change.metric, after)}"


def _place(metric: Metric, one: Association, paired: bool) -> str:
    most = one.standing_out
    there = f"{_signed(metric, most.value)} there, {_signed(metric, most.rest_value)} elsewhere"
    if metric.sort is MetricSort.RATE and paired:
        there = f"{percent(most.value)} of {counted(most.games, 'game')} there, {percent(most.rest_value)} elsewhere"
    ends = "near either of its ends, most at " if one.both_ends else ""
    return f"It sits where {one.name} is {ends}{most.label}: {there} (p {_p(one.corrected)})."


def _size(metric: Metric, value: float | None) -> str:
    if value is None or math.isnan(value):
        return "–"
    if metric.sort is MetricSort.RATE:
        return percent(value)
    return f"{amount(value)} {metric.unit}".rstrip()


def _plain(metric: Metric, value: float) -> str:
    return percent(value) if metric.sort is MetricSort.RATE else amount(value)


def _signed(metric: Metric, value: float) -> str:
    if metric.sort is MetricSort.RATE:
        return f"{signed(100.0 * round(value, 4))} %"
    return f"{signed(value)} {metric.unit}".rstrip()


def change_row(change: MetricChange) -> tuple[str, ...]:
    """A change as a row of a table: metric, games, before, after, difference, interval, p, corrected p, visible."""
    metric, estimate = change.metric, change.estimate
    before, after = known(change.older), known(change.newer)
    games = str(after.size) if before.size == after.size else f"{before.size} and {after.size}"
    return (
        _with_unit(metric), games, _plain(metric, float(before.mean())), _plain(metric, float(after.mean())),
        _signed_alone(metric, estimate.value),
        f"{_signed_alone(metric, estimate.low)} to {_signed_alone(metric, estimate.high)}",
        chance(change.p), chance(change.corrected), "–" if change.visible is None else _plain(metric, change.visible),
        ("worse" if change.worse else "better") if change.found else "not\u00a0found",
    )  # fmt: skip


def _with_unit(metric: Metric) -> str:
    return f"{metric.name} [{metric.unit}]" if metric.unit else metric.name


def _signed_alone(metric: Metric, value: float) -> str:
    return _signed(metric, value) if metric.sort is MetricSort.RATE else signed(value)


def throughput_sentence(found: CampaignFindings) -> str:
    """How many games a core plays in an hour."""
    wall = sum(one.wall for one in found.throughput)
    if not wall:
        return "The rows do not say how long games took."
    games, plant = sum(one.games for one in found.throughput), sum(one.plant for one in found.throughput)
    ran = f", and plant time ran {amount(plant / wall)} times as fast as the clock" if plant else ""
    an_hour, took = amount(3600.0 * games / wall), amount(wall / games)
    return f"{an_hour} games an hour and core: a game took {took} s of a worker{ran}."


def all_sentences(found: CampaignFindings) -> list[str]:
    """What a person at a terminal is told."""
    said = [lead(found), *(rate_sentence(rate) for rate in found.rates if rate.outcome in {"wrong", "failed"})]
    said += explanation("Failures", found.explains_failures)
    if found.comparison is not None:
        said += [*comparison_lead(found.comparison), *comparison_sentences(found.comparison)]
    said.append(throughput_sentence(found))
    for verdict in found.verdicts or ():
        said.append(f"{'Held' if verdict.held else 'MISSED'}: {verdict.sentence}.")
    return said
