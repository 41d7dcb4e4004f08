"""The page of a campaign: gate, outcomes, comparison, what explains failures, figures, failures, speed."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from app.campaign.report.analysis.distributions import COUNTS
from app.campaign.report.analysis.explaining import Association
from app.campaign.report.analysis.statistics import rate_bounds
from app.campaign.report.charts import (
    durations_chart,
    figures_table,
    groups_chart,
    peak_charts,
    rates_chart,
    rates_table,
)
from app.campaign.report.findings import CampaignFindings, FailedGame
from app.campaign.report.sentences import (
    change_row,
    comparison_lead,
    comparison_sentences,
    explanation,
    lead,
    rate_sentence,
    throughput_sentence,
)
from app.campaign.report.wording import amount, chance, counted, interval, percent
from app.report.figures_of_plies import Chart, DataTable, folded
from app.report.markup import Html, joined, tag
from app.report.parts import document, figure, scrolling, section

KIND: Final = "the report of a campaign"
_TITLE: Final = "report of a campaign"
MARK: Final = f": {_TITLE}</title>".encode()
"""What every such page has, and no other file."""
MOST_FAILURES: Final = 500
"""So many are listed; the others are in the results."""


def campaign_page(found: CampaignFindings) -> str:
    """The whole page."""
    name = Path(found.rows.name).name or found.rows.name
    sections = [
        *([] if found.verdicts is None else [section("gate", "The gate", _gate(found))]),
        section("rates", "How games ended", _rates(found)),
        *(
            []
            if found.comparison is None
            else [section("compared", "Compared with the older campaign", _compared(found))]
        ),
        section("explained", "What explains failures", _explained(found)),
        section("figures", "Figures against their bars", _figures(found)),
        section("failures", "Failures", _failures(found)),
        section("speed", "How fast it was played", _speed(found)),
    ]
    return document(f"{name}: {_TITLE}", _header(found, name), tag("main", *sections), _footer())


def _header(found: CampaignFindings, name: str) -> Html:
    rows, wrong = found.rows, next(rate for rate in found.rates if rate.outcome == "wrong")
    facts: list[tuple[str, str, str | None]] = [
        ("Games", str(len(rows.games)) if rows.wanted is None else f"{len(rows.games)} of {rows.wanted}", None),
        ("Plies", str(len(rows.plies)), None),
        ("Failed", str(len(found.failures)), "bad" if found.failures else "good"),
        ("Silently wrong", f"{wrong.hits}, at most {percent(wrong.at_most)}", "bad" if wrong.hits else "good"),
    ]
    if found.verdicts is not None:
        missed = sum(not verdict.held for verdict in found.verdicts)
        so_far = " so far" if rows.unfinished else ""
        said = f"missed {missed} of {counted(len(found.verdicts), 'bar')}{so_far}" if missed else f"held{so_far}"
        facts.append(("Gate", said, "bad" if missed else "good"))
    shown = (tag("div", tag("dt", what), tag("dd", value, class_=look)) for what, value, look in facts)
    title = "" if rows.kept is None else rows.kept.spec.title
    return tag(
        "header", tag("h1", f"Campaign {name}"), *([tag("p", title, class_="soft")] if title else []),
        tag("p", lead(found), class_="outcome"), tag("dl", *shown),
    )  # fmt: skip


def _gate(found: CampaignFindings) -> Html:
    verdicts = found.verdicts or ()
    missed = sum(not verdict.held for verdict in verdicts)
    every = "The one bar is" if len(verdicts) == 1 else f"All {len(verdicts)} bars are"
    said = f"{counted(missed, 'bar')} of {len(verdicts)} missed" if missed else f"{every} held"
    said += " so far." if found.rows.unfinished else "."
    items = (
        tag("li", tag("span", f"{verdict.bar}: {'held' if verdict.held else 'missed'}", class_="when"),
            f"{verdict.sentence[0].upper()}{verdict.sentence[1:]}.", class_="held" if verdict.held else "wrong")
        for verdict in verdicts
    )  # fmt: skip
    return joined([tag("p", said, class_="bad" if missed else "good"), tag("ol", *items, class_="incidents")])


def _rates(found: CampaignFindings) -> Html:
    said = [tag("p", rate_sentence(rate)) for rate in found.rates if rate.outcome != "right"]
    if not len(found.rows.games):
        return joined(said[:1])
    table = scrolling(rates_table(found.rates), "How games ended")
    return joined([*said, table, _charts([rates_chart(found.rates)])])


def _charts(charts: Sequence[Chart]) -> Html:
    return tag("div", *map(figure, charts), class_="charts") if charts else Html("")


def _compared(found: CampaignFindings) -> Html:
    comparison = found.comparison
    assert comparison is not None
    said = [tag("p", " ".join(comparison_lead(comparison)), class_="soft")]
    said += [tag("p", sentence) for sentence in comparison_sentences(comparison)]
    charts = [
        groups_chart(f"change-{place}-{number}", one, f"Change of {change.metric.name}", change.metric)
        for place, change in enumerate(comparison.told)
        for number, one in enumerate(change.where) if one.holds
    ]  # fmt: skip
    heads = ("metric", ">games", ">before", ">now", ">difference", ">95 % interval", ">p", ">p corrected",
             ">visible at 80 % power", "said")  # fmt: skip
    table = DataTable(heads, [change_row(change) for change in comparison.changes]).html(
        "All metrics that were tested. The difference is the typical one where ranks tell it best, else that of the "
        "averages; p is corrected by Holm."
    )
    note = tag("p", _FOUND.format(len(comparison.changes)), class_="soft")
    shown = [note, scrolling(table, "All metrics")] if comparison.changes else []
    tables = [
        folded(f"Where it sits: {change.metric.name}", _where_table(change.where, f"Change of {change.metric.name}"))
        for change in comparison.told if change.where
    ]  # fmt: skip
    return joined([*said, *shown, *tables, _charts(charts)])


_FOUND: Final = (
    "A change is found where p is below 0.05 once it is corrected for the number of metrics, {} here. So the interval "
    "of a metric, which is not corrected, may leave zero out although no change was found."
)


def _where_table(where: Sequence[Association], caption: str) -> Html:
    rows = [
        (one.name, "; ".join(f"{group.label}: {amount(group.value)} in {group.games}" for group in one.groups),
         chance(one.p), chance(one.corrected))
        for one in where
    ]  # fmt: skip
    return DataTable(("of", "in each group, and how many games", ">p", ">p corrected"), rows).html(caption)


def _explained(found: CampaignFindings) -> Html:
    if not found.failures and not found.explains_mending:
        nothing = "No game failed, and nothing was mended or asked in any." if len(found.rows.games) else "–"
        return tag("p", nothing)
    parts = []
    for what, key, associations in (
        ("Failures", "failures", found.explains_failures),
        ("Mending and questions", "mending", found.explains_mending),
    ):
        parts += [tag("p", sentence) for sentence in explanation(what, associations)]
        parts.append(_charts([
            groups_chart(f"{key}-{place}", one, what, None)
            for place, one in enumerate(associations) if one.holds
        ]))  # fmt: skip
        if associations:
            parts.append(folded(f"{what} by range", _explained_table(what, associations)))
    if not found.explains_failures:
        reason = (
            "No game failed."
            if not found.failures
            else "Games differ in nothing that was drawn, so nothing can explain it."
        )
        parts.insert(0, tag("p", reason))
    return joined(parts)


def _explained_table(what: str, associations: Sequence[Association]) -> Html:
    rows = []
    for one in associations:
        groups = []
        for group in one.groups:
            hits = round(group.value * group.games)
            bounds = rate_bounds(hits, group.games)
            said = f"{group.label}: {hits} of {group.games}, {interval(bounds.low, bounds.high)}"
            groups.append(said)
        rows.append((one.name, "; ".join(groups), chance(one.p), chance(one.corrected)))
    heads = ("range", "in each group, with 95 % bounds", ">p", ">p corrected")
    return DataTable(heads, rows).html(f"{what} by range; p corrected for the number of ranges by Holm")


def _figures(found: CampaignFindings) -> Html:
    older = None if found.comparison is None else found.comparison.older
    charts = [chart for chart in (durations_chart(found), *peak_charts(found, older)) if chart is not None]
    counts = [one for one in found.distributions if one.figure in COUNTS]
    caption = "In each game played to the end"
    table = scrolling(figures_table(counts, found, caption), caption) if counts else Html("")
    if not charts and not counts:
        return tag("p", "The rows hold no figures.")
    return joined([_charts(charts), table, tag("p", _PLIES_IN_GAMES, class_="soft")])


_PLIES_IN_GAMES: Final = (
    "Plies of one game resemble each other. Bounds of a share of plies allow for that: they count as so many fewer as "
    "games differ more from each other than chance would have it. Where fewer than five games have a ply beyond a bar, "
    "the bound is that of the share of games, times the largest share within one of them. No bound is lower than that "
    "of a bar which no game went beyond: a share of games too small to be among these may be beyond it in every ply."
)


def _failures(found: CampaignFindings) -> Html:
    if not found.failures:
        return tag("p", "No game failed." if len(found.rows.games) else "No game is done.")
    said = [tag("p", "The same game again, alone and with its film, to the last bit:", class_="soft")]
    said.append(tag("ol", *(_failure(one, found.rows.name) for one in found.failures[:MOST_FAILURES]),
                    class_="incidents"))  # fmt: skip
    left = len(found.failures) - MOST_FAILURES
    if left > 0:
        said.append(tag("p", f"{left} more {'is' if left == 1 else 'are'} in games.parquet."))
    return joined(said)


def _failure(one: FailedGame, folder: str) -> Html:
    sentences = [_sentence(text) for text in dict.fromkeys(filter(None, (one.reason, one.said)))]
    sentences = sentences or ["It does not say why."]
    if one.folder:
        sentences.append(f"Its folder is kept as {one.folder}.")
    if not one.repeatable:
        sentences.append("What failed came by wall time, so that it may end otherwise next time.")
    log = [tag("details", tag("summary", "Its last words"), tag("pre", one.log))] if one.log else []
    return tag(
        "li", tag("span", f"seed {one.seed} · {one.outcome}", class_="when"), f"{' '.join(sentences)} ",
        tag("code", repeat_command(folder, one.seed)), *log, class_="wrong",
    )  # fmt: skip


def _sentence(text: str) -> str:
    """With a capital and a stop."""
    said = text.strip()
    return f"{said[:1].upper()}{said[1:]}" + ("" if said.endswith((".", "?", "!")) else ".")


def repeat_command(folder: str, seed: int) -> str:
    """The one command that plays a game of a campaign again."""
    return f"touchmove campaign repeat {shlex.quote(folder)} {seed} --film"


def _speed(found: CampaignFindings) -> Html:
    rows = [
        (one.host, one.cpu, str(one.games), amount(one.games_an_hour), amount(one.speed) if one.plant else "–")
        for one in found.throughput
    ]
    heads = ("machine", "processor", ">games", ">games an hour and core", ">plant time to clock")
    said = tag("p", f"{throughput_sentence(found)} Each worker has one core.")
    if not rows:
        return said
    return joined([said, scrolling(DataTable(heads, rows).html("By machine"), "By machine")])


def _footer() -> Html:
    return tag("footer", tag("p", "Made by 'touchmove campaign report' from the rows of the campaign alone."))
