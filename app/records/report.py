"""The report of a game, computed from its events alone, so that it can be made again from the file."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydantic import Field, FiniteFloat, JsonValue

from app.pieces.inventory import MoveKind
from app.players.game_end import Result
from app.records.events import (
    AnyEvent,
    EndEvent,
    Pace,
    PlyEvent,
    Record,
    RepairedBy,
    StartEvent,
    TaskDoneEvent,
    TroubleEvent,
)
from app.records.files import RecordError
from app.records.history import counted_plies

UNFINISHED = "the record breaks off"


class KindStats(Record):
    """Plant time of the plies of one kind, home to home [s]; null where there was none."""

    n: int
    mean_s: FiniteFloat | None
    p95_s: FiniteFloat | None
    max_s: FiniteFloat | None


class StatsByKind(Record):
    """Durations by kind of move; all kinds are always there."""

    quiet: KindStats
    capture: KindStats
    castling: KindStats
    en_passant: KindStats
    promotion: KindStats


class PlacementStats(Record):
    """Distance of moved pieces from the centre of their place [mm]; null where none was measured."""

    n: int
    mean: FiniteFloat | None
    p50: FiniteFloat | None
    p95: FiniteFloat | None
    max: FiniteFloat | None


class Failure(Record):
    """Something that went wrong; ply and move are null where it was not in a ply."""

    ply: int | None
    san: str | None
    reason: str


class Trouble(Record):
    """Something that went wrong at the board; see ``TroubleEvent``."""

    ply: int
    kind: str
    squares: tuple[str, ...]
    sentence: str
    mended_by: RepairedBy | None


class Report(Record):
    """What ``report.json`` holds."""

    result: Result
    exit_reason: str
    plies: int
    sim_s: FiniteFloat
    """Plant time from start to end [s]."""
    wall_s: FiniteFloat
    """Wall time from start to end [s]."""
    pace: Pace
    seed: int
    kinds: StatsByKind
    placement_mm: PlacementStats
    peak_torque_Nm: FiniteFloat | None  # noqa: N815  # the name in the file, with its unit
    peak_force_N: FiniteFloat | None  # noqa: N815  # the name in the file, with its unit
    physical_ok: bool | None
    """True: the referee found every ply right; False: one was wrong; null: no ply, or plies nobody could judge."""
    failures: tuple[Failure, ...]
    troubles: tuple[Trouble, ...] = ()
    """What went wrong at the board and was noticed, also where it was mended."""
    speed: FiniteFloat | None = None
    """Plant time over wall time while ticks ran, where the world measured it."""
    world_state: str | None = None
    """Digest of the world's final state, where there is one."""
    details: dict[str, JsonValue] = Field(default_factory=dict)
    """Whatever else the caller wants to keep."""


def summarise(
    events: Sequence[AnyEvent],
    *,
    failures: Sequence[str] = (),
    speed: float | None = None,
    world_state: str | None = None,
    details: dict[str, JsonValue] | None = None,
) -> Report:
    """Compute the report.

    Args:
        events: of one game, in order; the end may be missing after a crash.
        failures: sentences on what went wrong outside any ply.
        speed: plant time over wall time while ticks ran.
        world_state: digest of the world's final state.
        details: more to keep.

    Raises:
        RecordError: the events do not begin with a start, or contradict themselves.
    """
    if not events or not isinstance(events[0], StartEvent):
        raise RecordError("the events do not begin with the start of a game: there is nothing to report")
    start, last = events[0], events[-1]
    try:
        plies = counted_plies(events)
    except ValueError as error:
        raise RecordError(f"the events contradict themselves: {error}") from error
    tasks = [event for event in events if isinstance(event, TaskDoneEvent)]
    others = [*failures, *([] if isinstance(last, EndEvent) else [UNFINISHED])]
    return Report(
        result=last.result if isinstance(last, EndEvent) else "*",
        exit_reason=last.reason if isinstance(last, EndEvent) else UNFINISHED,
        plies=len(plies),
        sim_s=last.plant_time - start.plant_time,
        wall_s=(last.wall_time - start.wall_time).total_seconds(),
        pace=start.pace,
        seed=start.seed,
        kinds=StatsByKind.model_validate({kind.value: _kind_stats(plies, kind) for kind in MoveKind}),
        placement_mm=_placement_stats(plies),
        peak_torque_Nm=max((ply.peak_torque_Nm for ply in plies if ply.peak_torque_Nm is not None), default=None),
        peak_force_N=max((ply.peak_force_N for ply in plies if ply.peak_force_N is not None), default=None),
        physical_ok=_all_ok([*plies, *tasks]),
        failures=(*_failures(plies), *_failures(tasks), *(Failure(ply=None, san=None, reason=r) for r in others)),
        troubles=tuple(
            Trouble(ply=one.ply, kind=one.kind, squares=one.squares, sentence=one.sentence, mended_by=one.mended_by)
            for one in events
            if isinstance(one, TroubleEvent)
        ),
        speed=speed,
        world_state=world_state,
        details=details or {},
    )


def _kind_stats(plies: Sequence[PlyEvent], kind: MoveKind) -> KindStats:
    times = np.array([ply.real_s for ply in plies if ply.kind is kind and ply.real_s is not None and not ply.resumed])
    if not times.size:
        return KindStats(n=0, mean_s=None, p95_s=None, max_s=None)
    return KindStats(
        n=times.size, mean_s=float(times.mean()), p95_s=float(np.percentile(times, 95)), max_s=float(times.max())
    )


def _placement_stats(plies: Sequence[PlyEvent]) -> PlacementStats:
    errors = np.array([error for ply in plies for error in (ply.placement_mm or {}).values()])
    if not errors.size:
        return PlacementStats(n=0, mean=None, p50=None, p95=None, max=None)
    p50, p95 = (float(value) for value in np.percentile(errors, (50, 95)))
    return PlacementStats(n=errors.size, mean=float(errors.mean()), p50=p50, p95=p95, max=float(errors.max()))


def _all_ok(done: Sequence[PlyEvent | TaskDoneEvent]) -> bool | None:
    verdicts = {one.physical_ok for one in done}
    if False in verdicts:
        return False
    return True if verdicts == {True} else None


def _failures(done: Sequence[PlyEvent | TaskDoneEvent]) -> list[Failure]:
    return [
        Failure(ply=one.ply, san=one.san if isinstance(one, PlyEvent) else None, reason=reason)
        for one in done
        for reason in one.failures
    ]
