"""What pages of figures are built of: the document around them, sections, charts with their numbers."""

from __future__ import annotations

from app.report.figures_of_plies import Chart, folded
from app.report.markup import Html, tag
from app.report.style import POLICY, STYLE


def document(title: str, *body: str) -> str:
    """A whole page: one file with its style, without scripts, that asks for nothing from anywhere."""
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", http_equiv="Content-Security-Policy", content=POLICY),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("meta", name="color-scheme", content="light dark"),
        tag("meta", name="referrer", content="no-referrer"),
        tag("title", title),
        Html(f"<style>{STYLE}</style>"),
    )
    return f"<!doctype html>\n{tag('html', head, tag('body', *body), lang='en')}\n"


def section(name: str, heading: str, content: Html) -> Html:
    """A part of a page with its heading; ``name`` is unique on the page."""
    return tag("section", tag("h2", heading, id=name), content, aria_labelledby=name)


def figure(chart: Chart) -> Html:
    """A chart with its caption, and its numbers to unfold."""
    told = tag("figcaption", tag("h3", chart.heading), tag("p", chart.caption))
    return tag("figure", told, chart.picture, folded(f"Numbers: {chart.heading}", chart.table), class_="chart")


def scrolling(table: Html, name: str, look: str = "") -> Html:
    """A table that scrolls within itself where it is wider than the page, also by the keyboard."""
    return tag("div", table, class_=f"scroll {look}".rstrip(), tabindex="0", role="region", aria_label=name)
