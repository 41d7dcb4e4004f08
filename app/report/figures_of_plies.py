"""Charts of a game's plies: times, forces, evaluation, clocks, the loop; each with the table of what it shows."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from app.pieces.inventory import MoveKind
from app.records import PlyEvent
from app.records.events import score_of
from app.report.markup import Html, escaped, joined, tag
from app.report.plot import MARK, PlotArea, drawing, mark, nice_ticks, number
from app.report.source import LoopOfPly, ReportSource
from controller.protection.limits import WHY
from hardware.piece_set import Colour

MOST_PAWNS: Final = 10.0
"""An evaluation is drawn up to so much; what is more, and a mate, at the edge."""
EVALUATION: Final = "Evaluation"
KINDS: Final = {kind: kind.value.replace("_", " ") for kind in MoveKind}


@dataclass(frozen=True, slots=True)
class Chart:
    """A picture, what it shows in a sentence or two, and the numbers it was drawn from."""

    heading: str
    caption: str
    picture: Html
    table: Html
    wide: bool = False


@dataclass(frozen=True, slots=True)
class DataTable:
    """Column headings, ``>`` before those of numbers, and rows; the first cell heads its row."""

    columns: Sequence[str]
    rows: Sequence[Sequence[str]]

    def html(self, caption: str) -> Html:
        """The table; its caption says what it holds."""
        numbers = [name.startswith(">") for name in self.columns]
        heads = [
            tag("th", name.removeprefix(">"), scope="col", class_="n" if right else None)
            for name, right in zip(self.columns, numbers, strict=True)
        ]
        body = []
        for first, *rest in self.rows:
            cells = [tag("th", first, scope="row")]
            cells += [
                tag("td", cell, class_="n" if right else None) for cell, right in zip(rest, numbers[1:], strict=True)
            ]
            body.append(tag("tr", *cells))
        return tag("table", tag("caption", caption), tag("thead", tag("tr", *heads)), tag("tbody", *body))


def ply_name(ply: PlyEvent) -> str:
    """Such as ``12… Nf6``: as people count moves."""
    full = ply.fen.rsplit(" ", 1)[-1]  # of the position after it: Black's move has raised it
    if ply.side is Colour.WHITE:
        return f"{full}. {ply.san}"
    return f"{int(full) - 1 if full.isdecimal() else full}… {ply.san}"


def seconds(value: float | None) -> str:
    """To a hundredth; a dash where there is none."""
    return "–" if value is None else f"{value:.2f}"


def time_of_plies(source: ReportSource) -> Chart | None:
    """How long each ply of the arm took, and was planned to take."""
    moved = [ply for ply in source.plies if ply.real_s is not None]
    if not moved:
        return None
    longest = max(max(ply.real_s or 0.0, ply.planned_s or 0.0) for ply in moved)
    area = PlotArea(_ply_ticks(source), nice_ticks(0.0, longest))
    parts = [area.axes("ply", "time [s]")]
    for ply in moved:
        at, real = area.x(float(ply.ply)), ply.real_s or 0.0
        if ply.planned_s is not None:
            y = area.y(ply.planned_s)
            parts.append(tag("line", x1=at - MARK - 1.5, y1=y, x2=at + MARK + 1.5, y2=y, class_="planned"))
        parts.append(mark(ply.kind, at, area.y(real), f"ply {ply.ply}, {ply_name(ply)}: {real:.2f} s"))
    rows = [
        (str(p.ply), ply_name(p), KINDS[p.kind], seconds(p.real_s), seconds(p.planned_s), "yes" if p.resumed else "")
        for p in moved
    ]
    slowest = max(moved, key=lambda p: p.real_s or 0.0)
    return Chart(
        "Time of each ply",
        "From home to home in plant time, one mark for each ply of the arm; the short lines are what was planned.",
        joined([
            drawing(
                "times", "Time of each ply",
                f"{len(moved)} plies of the arm; the longest is ply {slowest.ply}, {slowest.san}, with "
                f"{seconds(slowest.real_s)} seconds.", *parts,
            ),
            _kinds_key({ply.kind for ply in moved}),
        ]),
        DataTable(("ply", "move", "kind", ">took [s]", ">planned [s]", "resumed"), rows).html("Time of each ply"),
    )  # fmt: skip


def times_by_kind(source: ReportSource) -> Chart | None:
    """How the times are distributed, by kind of ply."""
    of_kind = {
        kind: [p for p in source.plies if p.kind is kind and p.real_s is not None and not p.resumed]
        for kind in MoveKind
    }
    present = [kind for kind, plies in of_kind.items() if plies]
    if not present:
        return None
    longest = max(p.real_s or 0.0 for kind in present for p in of_kind[kind])
    least = min(p.real_s or 0.0 for kind in present for p in of_kind[kind])
    height = 56.0 + 40.0 * len(present)
    rows_down = tuple(float(n) for n in range(len(present) + 2))
    area = PlotArea(nice_ticks(0.9 * least, longest), rows_down, left=72.0, height=height)
    names = [KINDS[kind] for kind in reversed(present)]
    parts, rows = [area.axes("time [s]", "", names)], []
    for row, kind in enumerate(reversed(present), start=1):
        parts.append(_distribution(area, float(row), kind, of_kind[kind]))
    for kind in present:
        times = np.array([p.real_s for p in of_kind[kind]], dtype=float)
        quartiles = [seconds(float(v)) for v in np.percentile(times, (25, 50, 75, 95))]
        slow, quick = max(of_kind[kind], key=_took), min(of_kind[kind], key=_took)
        rows.append((
            KINDS[kind], str(times.size), f"{seconds(quick.real_s)} (ply {quick.ply})", *quartiles,
            f"{seconds(slow.real_s)} (ply {slow.ply})",
        ))  # fmt: skip
    counted = ", ".join(f"{len(of_kind[kind])} {KINDS[kind]}" for kind in present)
    return Chart(
        "Times by kind of ply",
        "Each mark is a ply; the box holds the middle half of them and the line in it is the median. Plies that "
        "another program had begun are left out, because their time is only that of their last part.",
        drawing("kinds", "Times by kind of ply", f"Distribution of the times: {counted}.", *parts, height=height),
        DataTable(
            ("kind", ">plies", ">shortest [s]", ">quarter [s]", ">median [s]", ">three quarters [s]", ">95 % [s]",
             ">longest [s]"), rows,
        ).html("Times by kind of ply"),
    )  # fmt: skip


def _took(ply: PlyEvent) -> float:
    return ply.real_s or 0.0


def _distribution(area: PlotArea, row: float, kind: MoveKind, plies: Sequence[PlyEvent]) -> Html:
    times = np.array([_took(p) for p in plies])
    low, middle, high = (float(v) for v in np.percentile(times, (25, 50, 75)))
    y, half = area.y(row), 12.0
    parts = []
    if len(plies) > 1:
        left, right = area.x(low), area.x(high)
        parts.append(tag("rect", x=left, y=y - half, width=max(right - left, 1.0), height=2 * half, class_="box"))
        parts.append(tag("line", x1=area.x(middle), y1=y - half, x2=area.x(middle), y2=y + half, class_="median"))
    for place, ply in enumerate(plies):
        aside = (place * 0.618034 % 1.0 - 0.5) * 1.5 * half  # spread evenly and the same each time
        says = f"ply {ply.ply}, {ply_name(ply)}: {_took(ply):.2f} s"
        parts.append(mark(kind, area.x(_took(ply)), y + aside, says, 2.8))
    return joined(parts)


def peak_torques(source: ReportSource) -> Chart | None:
    """The largest servomotor torque of each ply, against the limits."""
    limits = source.limits
    lines = [] if limits is None else [
        (limits.torque, f"peak of the drives, {number(limits.torque)} N m"),
        (limits.rms_torque, f"rated, on average, {number(limits.rms_torque)} N m"),
    ]  # fmt: skip
    why = "" if limits is None else f" Beyond {number(limits.torque)} N m torques are clamped: {WHY['torque'].why}."
    return _peaks(
        source, "torques", "Peak torques", "torque [N m]", lambda ply: ply.peak_torque_Nm, lines,
        "The largest torque commanded of a servomotor in each ply." + (why or _NO_LIMITS),
    )  # fmt: skip


def peak_forces(source: ReportSource) -> Chart | None:
    """The largest contact force of each ply, against the limits."""
    limits = source.limits
    lines = [] if limits is None else [
        (limits.tactile, f"opens at {number(limits.tactile)} N"),
        (limits.grip_force, f"grip, if it persists, {number(limits.grip_force)} N"),
    ]  # fmt: skip
    why = "" if limits is None else f" At {number(limits.tactile)} N on a pad the fingers open: {WHY['tactile'].why}."
    return _peaks(
        source, "forces", "Peak forces", "force [N]", lambda ply: ply.peak_force_N, lines,
        "The largest contact force of each ply, as measured by the pads and, in a simulation, by the referee."
        + (why or _NO_LIMITS),
    )  # fmt: skip


_NO_LIMITS: Final = " The record does not say which robot played, so limits are not drawn."


def _peaks(
    source: ReportSource,
    name: str,
    heading: str,
    unit: str,
    value: Callable[[PlyEvent], float | None],
    limits: Sequence[tuple[float, str]],
    caption: str,
) -> Chart | None:
    found = [(ply, peak) for ply in source.plies if (peak := value(ply)) is not None]
    if not found:
        return None
    highest = max(peak for _, peak in found)
    near = [limit for limit, _ in limits if limit < 4.0 * highest]
    area = PlotArea(_ply_ticks(source), nice_ticks(0.0, max(highest, *near) if near else highest))
    parts = [area.axes("ply", unit)]
    for ply, peak in found:
        at, top = area.x(float(ply.ply)), area.y(peak)
        parts.append(tag("line", x1=at, y1=area.y(0.0), x2=at, y2=top, class_="stem"))
        parts.append(mark(ply.kind, at, top, f"ply {ply.ply}, {ply_name(ply)}: {peak:.2f}", 2.8))
    parts += [area.limit(limit, says) for limit, says in limits]
    most = max(found, key=lambda one: one[1])
    rows = [(str(ply.ply), ply_name(ply), KINDS[ply.kind], f"{peak:.2f}") for ply, peak in found]
    described = f"{len(found)} plies; the most is {most[1]:.2f} in ply {most[0].ply}, {most[0].san}."
    if limits:
        described += " Limits: " + "; ".join(says for _, says in limits) + "."
    table = DataTable(("ply", "move", "kind", f">{unit}"), rows).html(heading)
    return Chart(heading, caption, drawing(name, heading, described, *parts), table)


def lateness(source: ReportSource) -> Chart | None:
    """How late ticks came, and how long they took."""
    loop = source.loop
    if not loop.plies:
        return None
    caption = (
        "The largest delay of a tick and the longest computation of one, as reported by the telemetry of each ply; "
        "each telemetry covers the second before it."
    )
    if loop.lockstep:
        caption += " The simulation ran in lockstep, where no tick can be late: time waits for it."
    tick = None if source.robot is None else 1e3 * source.robot.parameters.drive.tick
    late = [(float(one.ply), 1e3 * one.lateness) for one in loop.plies]
    work = [(float(one.ply), 1e3 * one.work) for one in loop.plies]
    area = PlotArea(_ply_ticks(source), nice_ticks(0.0, max(value for _, value in late + work)))
    parts = [area.axes("ply", "time [ms]"), area.line(late, "one"), area.line(work, "two")]
    for what, look, series in (("late by", "", late), ("worked for", "m-two", work)):
        parts += [
            mark(None, area.x(ply), area.y(value), f"ply {ply:.0f}: {what} {value:.2f} ms", 2.2, look)
            for ply, value in series
        ]
    if tick is not None:
        parts.append(area.limit(tick, f"a tick, {number(tick)} ms"))
    rows = [(str(p.ply), f"{1e3 * p.lateness:.3f}", f"{1e3 * p.work:.3f}") for p in loop.plies]
    picture = drawing(
        "loop", "Lateness and work of ticks",
        f"At most {max(v for _, v in late):.2f} ms late, and at most {max(v for _, v in work):.2f} ms of work.", *parts,
    )  # fmt: skip
    table = DataTable(("ply", ">late by [ms]", ">work [ms]"), rows).html("Lateness and work of ticks")
    return Chart("Ticks of the loop", caption, joined([picture, _lines_key("late by", "longest work")]), table)


def tracking(source: ReportSource) -> Chart | None:
    """How far the tool was from its reference, and the force that this says."""
    loop = source.loop
    if not loop.plies:
        return None
    points = [(float(one.ply), 1e3 * one.tracking) for one in loop.plies]
    limits = source.limits
    area = PlotArea(_ply_ticks(source), nice_ticks(0.0, max(value for _, value in points)))
    parts = [area.axes("ply", "distance [mm]"), area.line(points, "one")]
    parts += [mark(None, area.x(ply), area.y(value), f"ply {ply:.0f}: {value:.2f} mm", 2.6) for ply, value in points]
    why = "."
    if limits is not None:
        parts.append(area.limit(1e3 * limits.tracking_most, f"most, {number(1e3 * limits.tracking_most)} mm"))
        why = f"; an axis, however soft, may be {number(1e3 * limits.tracking_most)} mm off before the arm gives way."
    rows = [(str(p.ply), f"{1e3 * p.tracking:.3f}", f"{p.force:.2f}") for p in loop.plies]
    worst = max(loop.plies, key=_off)
    picture = drawing(
        "tracking", "Distance of the tool from its reference",
        f"At most {1e3 * worst.tracking:.2f} mm, in ply {worst.ply}.", *parts,
    )  # fmt: skip
    return Chart(
        "Tracking", f"The largest distance of the tool from its reference in each ply{why} When a piece touches the "
        "board, the tool is meant to be pressed off its reference.", picture,
        DataTable(("ply", ">distance [mm]", ">force on the tool [N]"), rows).html("Tracking"),
    )  # fmt: skip


def _off(one: LoopOfPly) -> float:
    return one.tracking


def evaluation(source: ReportSource) -> Chart | None:
    """What players thought of the position."""
    said = [(ply, ply.score or "", pawns) for ply in source.plies if (pawns := _pawns(ply.score)) is not None]
    if not said:
        return None
    points = [(float(ply.ply), pawns) for ply, _, pawns in said]
    most = max(1.0, *(abs(value) for _, value in points))
    ticks = nice_ticks(-most, most)
    area = PlotArea(_ply_ticks(source), (-ticks[-1], *ticks[1:-1], ticks[-1]))
    zero = area.y(0.0)
    parts = [area.axes("ply", "pawns, White’s side"), tag("line", x1=area.x(area.x_ticks[0]), y1=zero,
             x2=area.x(area.x_ticks[-1]), y2=zero, class_="axis"), area.line(points, "one")]  # fmt: skip
    parts += [
        mark(None, area.x(x), area.y(y), f"ply {ply.ply}, {ply_name(ply)}: {score}", 2.6)
        for (x, y), (ply, score, _) in zip(points, said, strict=True)
    ]
    last = said[-1]
    return Chart(
        EVALUATION,
        "The evaluation by the player who moved, after its ply, in pawns from White’s side; beyond "
        f"{MOST_PAWNS:.0f}, and for a mate, the mark lies at the edge.",
        drawing("score", EVALUATION, f"{len(said)} plies; after ply {last[0].ply} it is {last[1]}.", *parts),
        DataTable(
            ("ply", "move", ">score"), [(str(ply.ply), ply_name(ply), score) for ply, score, _ in said]
        ).html(EVALUATION),
    )  # fmt: skip


def _pawns(text: str | None) -> float | None:
    """What is drawn for a score; None: there is none, or none that can be read."""
    try:
        white = score_of(text or "").white()
    except (ValueError, OverflowError):
        return None
    mate, pawns = white.mate(), white.score()
    if mate is not None:
        return MOST_PAWNS if white.score(mate_score=100_000) > 0 else -MOST_PAWNS
    assert pawns is not None
    return max(-MOST_PAWNS, min(MOST_PAWNS, pawns / 100.0))


def clocks(source: ReportSource) -> Chart | None:
    """What both clocks showed after each ply."""
    told = [(ply, ply.clock_s) for ply in source.plies if ply.clock_s is not None]
    if not told:
        return None
    sides = {side: [(float(ply.ply), shown[side] / 60.0) for ply, shown in told if side in shown] for side in Colour}
    values = [value for series in sides.values() for _, value in series]
    if not values:
        return None
    area = PlotArea(_ply_ticks(source), nice_ticks(min(0.0, *values), max(values)))
    parts = [area.axes("ply", "left [min]")]
    parts += [area.steps(sides[side], look) for side, look in ((Colour.WHITE, "one"), (Colour.BLACK, "two"))]
    rows = [
        (str(ply.ply), ply_name(ply), *(seconds(shown.get(side)) for side in (Colour.WHITE, Colour.BLACK)))
        for ply, shown in told
    ]
    ends = ", ".join(f"{side.value} {60.0 * series[-1][1]:.0f} s" for side, series in sides.items() if series)
    control = source.start.time_control
    return Chart(
        "Clocks", "Both clocks after each ply" + (f"; time control {control}." if control else "."),
        joined([
            drawing("clocks", "Clocks", f"At the end of the record: {ends}.", *parts), _lines_key("White", "Black"),
        ]),
        DataTable(("ply", "move", ">White [s]", ">Black [s]"), rows).html("Clocks"),
    )  # fmt: skip


def _ply_ticks(source: ReportSource) -> tuple[float, ...]:
    ticks = nice_ticks(0.0, float(max((ply.ply for ply in source.plies), default=1)))
    return tuple(t for t in ticks if t == round(t)) or ticks


def _kinds_key(kinds: Iterable[MoveKind]) -> Html:
    """What the marks mean, in words beside them."""
    wanted = set(kinds)
    return tag("p", *(
        tag("span", tag("svg", mark(kind, 7.0, 7.0, KINDS[kind]), viewBox="0 0 14 14", aria_hidden="true"), KINDS[kind])
        for kind in MoveKind if kind in wanted
    ), class_="key")  # fmt: skip


def _lines_key(one: str, two: str) -> Html:
    return tag("p", *(
        tag("span", tag("svg", tag("line", x1=1.0, y1=7.0, x2=13.0, y2=7.0, class_=f"line {look}"),
                        viewBox="0 0 14 14", aria_hidden="true"), name)
        for look, name in (("one", one), ("two", two))
    ), class_="key")  # fmt: skip


def folded(summary: str, table: Html) -> Html:
    """A table that opens when it is asked for; wider than the page, it scrolls, also by the keyboard."""
    inner = tag("div", table, class_="scroll", tabindex="0", role="region", aria_label=escaped(summary))
    return tag("details", tag("summary", summary), inner)


CHARTS: Final[tuple[Callable[[ReportSource], Chart | None], ...]] = (
    time_of_plies, times_by_kind, peak_torques, peak_forces, evaluation, clocks, tracking, lateness,
)  # fmt: skip
