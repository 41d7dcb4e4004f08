"""Charts of a campaign: rates in their bounds, times by kind of ply, how often what is exceeded, groups of a range."""

from __future__ import annotations

import math
from collections.abc import Sequence
from string import ascii_lowercase
from typing import Final

import numpy as np

from app.campaign.report.analysis.distributions import (
    DURATIONS,
    PEAKS,
    QUANTILES,
    CampaignFigure,
    Distribution,
    ProductBar,
    distribution,
    share_beyond,
    worst_game,
)
from app.campaign.report.analysis.explaining import Association
from app.campaign.report.analysis.metrics import Metric, MetricSort
from app.campaign.report.analysis.rows import CampaignRows
from app.campaign.report.analysis.statistics import Numbers, rate_bounds
from app.campaign.report.findings import CampaignFindings, OutcomeRate
from app.campaign.report.wording import amount, capital, counted, interval, percent, signed
from app.report.figures_of_plies import KINDS, Chart, DataTable
from app.report.markup import Html, joined, tag
from app.report.plot import PlotArea, drawing, mark, nice_ticks

_ROW: Final = 34.0
"""Height of a row of a chart whose rows have names."""
_LETTER: Final = 10.0
"""Between two letters beside each other, at least."""
_MOST_POINTS: Final = 240
"""Of a line."""


def _rows_of(names: Sequence[str], low: float, high: float, left: float) -> PlotArea:
    """An area with a row for each name, the first at the top."""
    ticks = nice_ticks(low, high, 5)
    return PlotArea(ticks, tuple(float(n) for n in range(len(names) + 2)), left=left, height=56.0 + _ROW * len(names))


def _between(area: PlotArea, low: float, high: float, y: float) -> Html:
    """An interval: a line with an end at each side."""
    left, right = area.x(low), area.x(high)
    return joined([
        tag("line", x1=left, y1=y, x2=right, y2=y, class_="planned"),
        tag("line", x1=left, y1=y - 4.0, x2=left, y2=y + 4.0, class_="planned"),
        tag("line", x1=right, y1=y - 4.0, x2=right, y2=y + 4.0, class_="planned"),
    ])  # fmt: skip


def rates_chart(rates: Sequence[OutcomeRate]) -> Chart:
    """How games ended, but for those that were just right: each rate within its bounds; there is one at least."""
    shown = [rate for rate in rates if rate.outcome != "right"]
    names = [rate.outcome for rate in shown]
    area = _rows_of(names, 0.0, 100.0 * max(rate.bounds.high for rate in shown), 92.0)
    parts = [area.axes("share of games [%], with 95 % bounds", "", names[::-1])]
    for row, rate in enumerate(reversed(shown), start=1):
        y = area.y(float(row))
        parts.append(_between(area, 100.0 * rate.bounds.low, 100.0 * rate.bounds.high, y))
        share = rate.hits / rate.games
        says = f"{rate.outcome}: {rate.hits} of {rate.games}, {interval(rate.bounds.low, rate.bounds.high)}"
        parts.append(mark(None, area.x(100.0 * share), y, says, look="" if rate.outcome == "mended" else "m-two"))
    described = "; ".join(f"{rate.outcome} {rate.hits} of {rate.games}" for rate in shown)
    return Chart(
        "Rates with their bounds",
        "Each mark is the share of games that ended so; the line is where the rate lies with 95 % confidence.",
        drawing("rates", "Rates with their bounds", f"{described}.", *parts, height=area.height),
        rates_table(rates),
    )


def rates_table(rates: Sequence[OutcomeRate]) -> Html:
    """The rates in numbers."""
    rows = [
        (rate.outcome, rate.says, str(rate.hits), percent(rate.hits / rate.games),
         interval(rate.bounds.low, rate.bounds.high), percent(rate.at_most))
        for rate in rates
    ]  # fmt: skip
    columns = ("outcome", "what it means", ">games", ">share", ">95 % bounds, two-sided", ">at most, 95 % one-sided")
    return DataTable(columns, rows).html("How games ended")


def durations_chart(found: CampaignFindings) -> Chart | None:
    """How long plies took, by kind, with what was planned and the gate's bars."""
    present = [one for one in found.distributions if one.figure in DURATIONS]
    if not present:
        return None
    bars = [found.gate_bars[one.figure.key].at_most for one in present if one.figure.key in found.gate_bars]
    names = [_kind_of(one.figure) for one in present]
    low = min(float(one.values.min()) for one in present)
    area = _rows_of(names, 0.9 * low, max(*(one.most for one in present), *bars, low), 92.0)
    parts = [area.axes("time of a ply [s]", "", names[::-1])]
    parts += [_duration(area, float(row), one, found) for row, one in enumerate(reversed(present), start=1)]
    described = "; ".join(f"{_kind_of(one.figure)}: median {one.quantile(0.5):.2f} s" for one in present)
    barred = " The dashed red lines are the gate’s bars." if bars else ""
    return Chart(
        "Times of plies by kind",
        "From home to home in plant time. The box holds the middle half, the line in it is the median, the thin line "
        f"98 of a hundred, and the mark is the slowest.{barred}",
        drawing("durations", "Times of plies by kind", f"{described}.", *parts, height=area.height),
        figures_table(present, found, "Times of plies by kind"),
    )


def _kind_of(figure: CampaignFigure) -> str:
    return "" if figure.kind is None else KINDS[figure.kind]


def _duration(area: PlotArea, row: float, one: Distribution, found: CampaignFindings) -> Html:
    y, half = area.y(row), 9.0
    low, left, middle, right, high = (float(v) for v in np.percentile(one.values, (1, 25, 50, 75, 99)))
    seed, ply = worst_game(one, found.rows)
    x, width = area.x(left), max(area.x(right) - area.x(left), 1.0)
    parts = [
        _between(area, low, high, y),
        tag("rect", x=x, y=y - half, width=width, height=2.0 * half, class_="box"),
        tag("line", x1=area.x(middle), y1=y - half, x2=area.x(middle), y2=y + half, class_="median"),
        mark(one.figure.kind, area.x(one.most), y, f"slowest: {one.most:.2f} s, seed {seed}, ply {ply}", 2.8),
    ]
    bar = found.gate_bars.get(one.figure.key)
    if bar is not None:
        at = area.x(bar.at_most)
        parts.append(tag("line", x1=at, y1=y - half - 4.0, x2=at, y2=y + half + 4.0, class_="limit"))
    return joined(parts)


def peak_charts(found: CampaignFindings, older: CampaignRows | None) -> list[Chart]:
    """How often placement, torque and force exceed what, with the product's bars and the gate's."""
    return [
        _exceeding(one, found, None if older is None else distribution(one.figure, older))
        for one in found.distributions if one.figure in PEAKS
    ]  # fmt: skip


def bars_of(figure: CampaignFigure, found: CampaignFindings) -> list[ProductBar]:
    """What a figure is held against: the product's bars, then the gate's."""
    bars = list(found.product_bars.get(figure.key, ()))
    asked = found.gate_bars.get(figure.key)
    if asked is not None:
        says = f"the gate's bar, {percent(asked.quantile)} within {amount(asked.at_most)} {figure.unit}".rstrip()
        bars.append(ProductBar(asked.at_most, says, asked.confidence))
    return bars


def _exceeding(one: Distribution, found: CampaignFindings, older: Distribution | None) -> Chart:
    figure, bars = one.figure, bars_of(one.figure, found)
    both = [one] if older is None else [one, older]
    most = max(each.most for each in both)
    shown = sorted((bar for bar in bars if bar.value < 4.0 * most), key=lambda bar: bar.value)
    decades = math.ceil(math.log10(max(each.values.size for each in both)))
    names = [percent(10.0**-power) for power in range(decades, 0, -1)] + ["all"]
    y_ticks = (-decades - 0.4, *(float(-power) for power in range(decades, -1, -1)), 0.2)
    area = PlotArea(nice_ticks(0.0, max(most, *(bar.value for bar in shown), 0.0)), y_ticks, left=60.0)
    parts = [area.axes(f"{figure.name} [{figure.unit}]", "plies beyond it", names)]
    parts += [area.steps(_line(each.values), look) for each, look in zip(both, ("one", "two"), strict=False)]
    parts += _uprights(area, shown)
    seed, ply = worst_game(one, found.rows)
    parts.append(mark(None, area.x(one.most), area.y(-math.log10(one.values.size)),
                      f"largest: {amount(one.most)} {figure.unit}, seed {seed}, ply {ply}"))  # fmt: skip
    far = [bar for bar in bars if bar not in shown]
    caption = f"For each value, the share of plies with more than it; the mark is the largest of {one.values.size}."
    caption += f" Far beyond the drawing: {'; '.join(bar.says for bar in far)}." if far else ""
    heading = capital(figure.name)
    drawn = drawing(
        figure.key,
        heading,
        f"Median {amount(one.quantile(0.5))}, largest {amount(one.most)} {figure.unit}.",
        *parts,
    )
    table = figures_table([one], found, heading)
    return Chart(heading, caption, joined([drawn, _key(older is not None, shown)]), table)


def _line(values: Numbers) -> list[tuple[float, float]]:
    """From value to value the logarithm of the share that lies beyond; thinned where nobody would see a difference."""
    ordered = np.sort(values)
    beyond = np.arange(ordered.size, 0, -1) / ordered.size
    ranks = np.unique(np.geomspace(1, ordered.size, min(_MOST_POINTS, ordered.size)).astype(np.int64))
    places = ordered.size - ranks[::-1]
    points = [(0.0, 0.0)] if ordered[0] > 0.0 else []
    return points + [(float(ordered[place]), float(np.log10(beyond[place]))) for place in places]


def _uprights(area: PlotArea, bars: Sequence[ProductBar]) -> list[Html]:
    """Bars as lines upwards, each with its letter above the drawing, where no line is: its name stands below."""
    top, bottom, last = area.y(area.y_ticks[-1]), area.y(area.y_ticks[0]), -_LETTER
    parts = []
    for letter, bar in zip(ascii_lowercase, bars, strict=False):
        x = area.x(bar.value)
        last = max(x, last + _LETTER)
        parts.append(tag("line", x1=x, y1=top, x2=x, y2=bottom, class_="limit"))
        parts.append(tag("text", letter, x=last, y=top - 2.0, class_="limit-name", text_anchor="middle"))
    return parts


def _key(compared: bool, bars: Sequence[ProductBar]) -> Html:
    """What lines and letters mean."""
    lines = (("one", "this campaign"), ("two", "the older one")) if compared else ()
    parts = [
        tag("span", tag("svg", tag("line", x1=1.0, y1=7.0, x2=13.0, y2=7.0, class_=f"line {look}"),
                        viewBox="0 0 14 14", aria_hidden="true"), name)
        for look, name in lines
    ]  # fmt: skip
    parts += [tag("span", f"{letter}: {bar.says}") for letter, bar in zip(ascii_lowercase, bars, strict=False)]
    return tag("p", *parts, class_="key") if parts else Html("")


def figures_table(shown: Sequence[Distribution], found: CampaignFindings, caption: str) -> Html:
    """Quantiles of figures, and how many values lie beyond each bar, with the bounds of their share."""
    heads = (
        "figure",
        ">values",
        *(f">{percent(share)} within" for share in QUANTILES),
        ">largest",
        "where",
        "beyond bars",
    )
    return DataTable(heads, [_figure_row(one, found) for one in shown]).html(caption)


def _figure_row(one: Distribution, found: CampaignFindings) -> tuple[str, ...]:
    seed, ply = worst_game(one, found.rows)
    where = f"seed\u00a0{seed}" + ("" if ply is None else f", ply\u00a0{ply}")
    unit = f" [{one.figure.unit}]" if one.figure.unit else ""
    beyond = [_beyond(one, found, bar) for bar in bars_of(one.figure, found) if bar.counted]
    return (
        f"{one.figure.name}{unit}", str(one.values.size), *(amount(one.quantile(share)) for share in QUANTILES),
        amount(one.most), where if one.most else "all\u00a0are\u00a00", "; ".join(beyond) or "no bar",
    )  # fmt: skip


def _beyond(one: Distribution, found: CampaignFindings, bar: ProductBar) -> str:
    beyond = share_beyond(one, found.rows, bar)
    sure = f"with {percent(bar.confidence)} confidence"
    return f"{beyond.hits} beyond {amount(bar.value)} ({bar.says}): at most {percent(beyond.at_most)} {sure}"


def groups_chart(name: str, one: Association, what: str, metric: Metric | None) -> Chart:
    """A figure in each group of a range.

    Args:
        name: unique on the page.
        one: how it goes with the range.
        what: the figure, for people, as a heading begins.
        metric: whose change it is; None: these are rates of one campaign.
    """
    rate = metric is None
    scale = 100.0 if metric is None or metric.sort is MetricSort.RATE else 1.0
    unit = "%" if scale > 1.0 else metric.unit if metric is not None else ""
    bounds = [rate_bounds(round(g.value * g.games), g.games) if rate else (g.value, g.value) for g in one.groups]
    labels = [group.label for group in one.groups]
    area = _rows_of(labels, min(0.0, scale * min(low for low, _ in bounds)),
                    max(0.0, scale * max(high for _, high in bounds)), 118.0)  # fmt: skip
    parts = [area.axes(_axis("share of games" if rate else "change", unit), "", labels[::-1])]
    for row, (group, (low, high)) in enumerate(reversed(list(zip(one.groups, bounds, strict=True))), start=1):
        y, says = (
            area.y(float(row)),
            f"{group.label}: {_shown(group.value, rate, unit, scale)} of {counted(group.games, 'game')}",
        )
        parts += [_between(area, scale * low, scale * high, y)] if rate else []
        parts.append(mark(None, area.x(scale * group.value), y, says))
    rows = [(group.label, str(group.games), _shown(group.value, rate, unit, scale)) for group in one.groups]
    heading = f"{what} by {one.name}"
    lines = "; the line is where the rate lies with 95 % confidence" if rate else ""
    return Chart(
        heading, f"Each mark is a group of games, in the order of the range{lines}.",
        drawing(name, heading, "; ".join(f"{label}: {value}" for label, _, value in rows), *parts, height=area.height),
        DataTable((one.name, ">games", f">{what}"), rows).html(heading),
    )  # fmt: skip


def _axis(what: str, unit: str) -> str:
    return f"{what} [{unit}]" if unit else what


def _shown(value: float, rate: bool, unit: str, scale: float) -> str:
    return percent(value) if rate else f"{signed(scale * value)} {unit}".rstrip()
