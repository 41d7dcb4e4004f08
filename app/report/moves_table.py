"""The table of all moves of a game, on the page of its record."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence

from app.pieces.inventory import MoveKind
from app.players.game_end import plies_in_words
from app.records import PlyEvent
from app.records.events import own_clock
from app.report.figures_of_plies import KINDS, DataTable, ply_name, seconds
from app.report.markup import Html, joined, tag
from app.report.parts import scrolling


def moves_table(plies: Sequence[PlyEvent]) -> Html:
    """All plies of a game, one a row, with how many there were of each kind; columns that say nothing are left out."""
    if not plies:
        return tag("p", "No ply was done.")
    optional: list[tuple[str, Callable[[int], str]]] = [
        (">clock [s]", lambda n: seconds(own_clock(plies[n])) if plies[n].clock_s else ""),
        (">score", lambda n: plies[n].score or ""),
        (">off centre [mm]", lambda n: _most((plies[n].placement_mm or {}).values(), 2)),
        (">torque [N m]", lambda n: _most((plies[n].peak_torque_Nm,), 2)),
        (">force [N]", lambda n: _most((plies[n].peak_force_N,), 1)),
        ("board", lambda n: {True: "right", False: "wrong", None: ""}[plies[n].physical_ok]),
        ("comment", lambda n: plies[n].comment),
    ]
    kept = [(name, value) for name, value in optional if any(value(n) for n in range(len(plies)))]
    rows = [
        (
            str(ply.ply), ply_name(ply), KINDS[ply.kind], ply.by, seconds(ply.real_s), seconds(ply.planned_s),
            *(value(n) for _, value in kept),
        )
        for n, ply in enumerate(plies)
    ]  # fmt: skip
    columns = ("ply", "move", "kind", "moved by", ">took [s]", ">planned [s]", *(name for name, _ in kept))
    counted = Counter(ply.kind for ply in plies)
    lead = ", ".join(f"{counted[kind]} {KINDS[kind]}" for kind in MoveKind if counted[kind])
    table = scrolling(
        DataTable(columns, rows).html("All plies, with their times in plant time"), "All moves", "tall moves"
    )
    return joined([tag("p", f"{plies_in_words(len(plies))}: {lead}."), table])


def _most(values: Iterable[float | None], digits: int) -> str:
    known = [value for value in values if value is not None]
    return f"{max(known):.{digits}f}" if known else ""
