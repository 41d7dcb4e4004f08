"""How every report is shown on one screen: a table of rows, what is wrong in red; and the table of a game's report."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final

from rich.console import Group
from rich.table import Column, Table
from rich.text import Text

from app.records import Report

JUDGED: Final = {True: "right after every ply", False: "wrong after a ply", None: "not judged"}
MENDED_BY: Final = {"arm": "repaired by the arm", "person": "repaired by hand", None: "noted"}


def rows_table(columns: Sequence[str], rows: Iterable[Sequence[str | Text]], title: str | None = None) -> Table:
    """A table for people.

    Args:
        columns: headings; ``>`` before one aligns its column to the right. Where all are empty none are shown.
        rows: one text for each column; none is taken for markup.
        title: above it.
    """
    headings = [
        Column(name.removeprefix(">"), justify="right" if name.startswith(">") else "left", overflow="fold")
        for name in columns
    ]
    shown = any(name.strip(">") for name in columns)
    table = Table(
        *headings,
        title=None if title is None else Text(title),
        title_justify="left",
        box=None,
        padding=(0, 1),
        show_header=shown,
    )
    for row in rows:
        table.add_row(*(Text(one) if isinstance(one, str) else one for one in row))
    return table


def judged(text: str, holds: bool | None) -> Text:
    """A text in the colour of what it says: as it should be, wrong, or not judged."""
    return Text(text, style={True: "green", False: "red", None: "dim"}[holds])


def report_table(report: Report) -> Group:
    """How it ended, how long plies took, what went wrong and what became of it."""
    head = [
        ("result", f"{report.result}, {report.exit_reason}"),
        ("plies", f"{report.plies} in {report.sim_s:.1f} s of plant time, {report.wall_s:.1f} s of wall time"),
        ("board", JUDGED[report.physical_ok]),
    ]
    placed = report.placement_mm
    if placed.max is not None:
        head.append(("placed", f"{placed.mean:.2f} mm off on average, {placed.max:.2f} mm at worst"))
    if report.peak_torque_Nm is not None:
        head.append(("peaks", f"{report.peak_torque_Nm:.1f} N m, {report.peak_force_N or 0.0:.1f} N"))
    kinds = [
        (kind.replace("_", " "), str(one.n), f"{one.mean_s:.2f} s", f"{one.p95_s:.2f} s", f"{one.max_s:.2f} s")
        for kind, one in report.kinds
        if one.n
    ]
    troubles = [(f"ply {one.ply}", one.sentence, MENDED_BY[one.mended_by]) for one in report.troubles]
    troubles += [("failed" if f.ply is None else f"ply {f.ply} failed", f.reason, "") for f in report.failures]
    return Group(
        rows_table(("", ""), head),
        rows_table(("moves of the arm", ">n", ">mean", ">p95", ">longest"), kinds),
        rows_table(("", "", ""), troubles),
    )
