"""The page of a record: who played and how it ended, what went wrong, charts with their numbers, moves, pictures."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from app.records.events import RepairedBy, unsaid
from app.records.files import write_atomically
from app.records.frames import frame_file
from app.records.rounds import match_folder, rounds_of
from app.report.analysis import analysis_of_game
from app.report.figures_of_plies import CHARTS, EVALUATION, DataTable, folded
from app.report.markup import Html, joined, tag
from app.report.moves_table import moves_table
from app.report.parts import document, figure, scrolling, section
from app.report.pictures import photographs
from app.report.source import ReportSource, read_source
from app.report.squares import board_of_placements
from app.report.story import Incident, incidents, seen

REPORT_PAGE: Final = "report.html"
_REMEDY: Final = "copy the record to a folder that can be written, and name that one"
_WRONG: Final = ("seen", "asked", "found", "failed", "dropped", "broke off")
_VERDICT: Final = {True: "right every time", False: "wrong after a ply or task", None: "judged by nobody"}


def write_report_pages(folder: Path, told: Callable[[str], None] = unsaid) -> tuple[Path, ...]:
    """Write the page of a record into its folder; of the folder of a match, those of all its rounds.

    Args:
        folder: of a game's record, or of a match.
        told: what was left out of a file that was cut off.

    Returns:
        The pages, that of ``folder`` first.

    Raises:
        RecordError: a record cannot be read, or a page cannot be written.
    """
    rounds = rounds_of(folder) or (folder,)
    pages = []
    for one in rounds:
        page = one / REPORT_PAGE
        write_atomically(page, report_page(read_source(one, told)), _REMEDY)
        pages.append(folder / os.path.relpath(page, folder))
    return tuple(pages)


def report_page(source: ReportSource) -> str:
    """The whole page of one record."""
    start = source.start
    title = f"{start.white} – {start.black}"
    happened, analysed = incidents(source), analysis_of_game(source)
    sections = [
        section("trouble", "What went wrong, and how it ended", _story(source, happened)),
        *([] if analysed is None else [section("analysis", "What the engine thinks of it", analysed)]),
        section("charts", "The game in figures", _charts(source)),
        section("vision", "What the camera reported", _vision(source)),
        section("moves", "Moves", moves_table(source.plies)),
        section("pictures", "Pictures", _pictures(source)),
    ]
    whole = (_header(source, title), tag("main", *sections), _footer(source))
    return document(f"{title}: report of a game", *whole)


def _header(source: ReportSource, title: str) -> Html:
    report = source.report
    who = f"White: {source.start.white} · Black: {source.start.black}"
    result = "no result" if report.result == "*" else report.result
    outcome = f"{result}: {report.exit_reason}"
    return tag(
        "header",
        tag("h1", title),
        tag("p", who, class_="soft"),
        tag("p", outcome, class_="outcome"),
        _facts(source),
        _rounds(source),
    )


def _facts(source: ReportSource) -> Html:
    start, report = source.start, source.report
    when = start.wall_time.isoformat(" ", "seconds").replace("+00:00", " UTC")
    placed = report.placement_mm
    facts: list[tuple[str, str, str | None]] = [
        ("When", when, None),
        ("Lasted", f"{_span(report.wall_s)}; {report.sim_s:.1f} s of plant time", None),
        ("Plies", str(report.plies), None),
        ("Pace", f"{report.pace}", None),
        ("Seed", str(report.seed), None),
        ("Clock, as in PGN", start.time_control or "none", None),
        ("The board was", _VERDICT[report.physical_ok], {True: "good", False: "bad", None: None}[report.physical_ok]),
    ]
    if placed.max is not None:
        facts.append(("Off centre", f"{placed.mean:.2f} mm on average, {placed.max:.2f} mm at most", None))
    if report.peak_torque_Nm is not None:
        facts.append(("Peak torque", f"{report.peak_torque_Nm:.2f} N m", None))
    if report.peak_force_N is not None:
        facts.append(("Peak force", f"{report.peak_force_N:.2f} N", None))
    return tag("dl", *(tag("div", tag("dt", name), tag("dd", value, class_=look)) for name, value, look in facts))


def _span(duration: float) -> str:
    minutes, rest = divmod(round(duration), 60)
    return f"{minutes} min {rest} s" if minutes else f"{duration:.1f} s"


def _rounds(source: ReportSource) -> Html:
    """Links to the other rounds of the match."""
    if len(source.rounds) < 2:
        return Html("")
    here = source.folder.resolve()
    items = []
    for one in source.rounds:
        name = "game 1" if one == match_folder(source.folder) else one.name.replace("-", " ")
        if one.resolve() == here:
            items.append(tag("li", tag("strong", name, aria_current="page")))
        else:
            items.append(tag("li", tag("a", name, href=f"{os.path.relpath(one.resolve(), here)}/{REPORT_PAGE}")))
    return tag("nav", tag("ul", *items), aria_label="Rounds of this match")


def _story(source: ReportSource, happened: Sequence[Incident]) -> Html:
    parts = [tag("p", sentence, class_="soft") for sentence in source.said]
    troubles = source.report.troubles
    if troubles:
        mended = Counter(one.mended_by for one in troubles)
        became: tuple[tuple[RepairedBy | None, str], ...] = (
            ("arm", "put right by the arm"), ("person", "put right by a person"), (None, "noted"),
        )  # fmt: skip
        counted = ", ".join(f"{mended[who]} {what}" for who, what in became if mended[who])
        parts.append(tag("p", f"{_count(len(troubles), 'thing')} went wrong at the board: {counted}."))
    elif not any(one.sort.startswith(_WRONG) for one in happened):
        parts.append(tag("p", "Nothing went wrong, and nothing had to be put right."))
    if happened:
        parts.append(tag("ol", *map(_incident, happened), class_="incidents"))
    return joined(parts)


def _incident(one: Incident) -> Html:
    when = f"after ply {one.ply}, at {one.plant_time:.2f} s · {one.sort}"
    said = " ".join(filter(None, (one.sentence, one.mended)))
    look = "wrong" if one.sort.startswith(_WRONG) else None
    return tag("li", tag("span", when, class_="when"), said, class_=look)


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _charts(source: ReportSource) -> Html:
    made = [draw(source) for draw in (*CHARTS[:2], board_of_placements, *CHARTS[2:])]
    charts = [chart for chart in made if chart is not None]
    notes = [] if source.loop.plies else [source.loop.missing]
    if not any(chart.heading == EVALUATION for chart in charts):
        notes.append("No player gave an evaluation.")
    if not charts:
        notes = ["The record holds no ply of the arm, so there is nothing to draw."]
    shown = tag("div", *map(figure, charts), class_="charts") if charts else Html("")
    return joined([shown, *(tag("p", note, class_="soft") for note in notes if note)])


def _vision(source: ReportSource) -> Html:
    said = seen(source)
    if not said:
        looked = frame_file(source.folder, 0, None) is not None or any(ply.frame for ply in source.plies)
        return tag("p", "The camera found nothing wrong." if looked else "No camera looked at this game.")
    sorts = Counter(one.sort for one in said)
    asked = sum(count for sort, count in sorts.items() if sort.startswith("asked"))
    lead = f"It reported {_count(len(said), 'time')}, and " + (
        f"was not sure {_count(asked, 'time')}." if asked else "was sure each time."
    )
    by_sort = DataTable(("what", ">times"), [(sort, str(count)) for sort, count in sorts.most_common()])
    rows = [
        (str(one.ply), f"{one.plant_time:.2f}", one.sort, " ".join(one.squares), one.sentence, one.mended)
        for one in said
    ]
    table = DataTable((">after ply", ">plant time [s]", "what", "squares", "sentence", "how it ended"), rows)
    return joined([
        tag("p", lead), scrolling(by_sort.html("How often it reported what"), "How often the camera reported what"),
        folded("Everything the camera reported", table.html("What the camera reported")),
    ])  # fmt: skip


def _pictures(source: ReportSource) -> Html:
    shown = photographs(source)
    if not shown:
        return tag("p", "The record holds no pictures.")
    return tag("div", *(one.html() for one in shown), class_="strip")


def _footer(source: ReportSource) -> Html:
    return tag(
        "footer",
        tag("p", f"Made by 'touchmove report --html' from events.jsonl, {_count(len(source.events), 'event')}, and "
            "what lies beside it. Times are plant time from home to home unless it says otherwise."),
    )  # fmt: skip
