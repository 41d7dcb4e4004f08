"""The report of a game on one screen."""

from __future__ import annotations

from rich.console import Group
from rich.table import Table

from app.records import Report


def report_table(report: Report) -> Group:
    """How it ended, how long plies took, what went wrong and what became of it."""
    head = Table(show_header=False, box=None)
    judged = {True: "right after every ply", False: "wrong after a ply", None: "nobody could judge it"}
    head.add_row("result", f"{report.result}, {report.exit_reason}")
    head.add_row("plies", f"{report.plies} in {report.sim_s:.1f} s of plant time, {report.wall_s:.1f} s of wall time")
    head.add_row("board", judged[report.physical_ok])
    if report.placement_mm.max is not None:
        head.add_row(
            "placed", f"{report.placement_mm.mean:.2f} mm off on average, {report.placement_mm.max:.2f} at worst"
        )
    if report.peak_torque_Nm is not None:
        head.add_row("peaks", f"{report.peak_torque_Nm:.1f} N m, {report.peak_force_N or 0.0:.1f} N")
    kinds = Table(box=None)
    for heading in ("moves of the arm", "n", "mean", "p95", "longest"):
        kinds.add_column(heading, justify="left" if heading.startswith("moves") else "right")
    for kind, stats in report.kinds:
        if stats.n:
            kinds.add_row(
                kind.replace("_", " "),
                str(stats.n),
                *(f"{one:.2f} s" for one in (stats.mean_s, stats.p95_s, stats.max_s)),
            )
    troubles = Table(show_header=False, box=None)
    for one in report.troubles:
        by = {"arm": "mended by the arm", "person": "mended by hand", None: "noted"}[one.mended_by]
        troubles.add_row(f"ply {one.ply}", one.sentence, by)
    for failure in report.failures:
        troubles.add_row("failed" if failure.ply is None else f"ply {failure.ply} failed", failure.reason, "")
    return Group(head, kinds, troubles)
