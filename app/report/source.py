"""All that a record holds of one game, read once: events, limits, what the telemetry says of each ply, pictures."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from app.analysis.kept import kept_analysis
from app.analysis.model import GameAnalysis
from app.records import (
    EVENTS_FILE,
    ROBOT_FILE,
    PlyEvent,
    RecordError,
    Report,
    RobotRecord,
    StartEvent,
    kept_robot,
    read_events,
    summarise,
)
from app.records.events import AnyEvent, EndEvent, StepEvent, unsaid
from app.records.history import counted_plies
from app.records.rounds import match_folder, rounds_of
from app.records.telemetry import TELEMETRY_FILE, read_telemetry
from controller.protection.limits import Limits, default_limits
from controller.protocol.datagram_fields import Flag
from controller.protocol.messages import Telemetry


@dataclass(frozen=True, slots=True)
class LoopOfPly:
    """What the telemetry says of the time in which a ply was done."""

    ply: int
    """Its number."""
    lateness: float
    """Largest delay of a tick [s]."""
    work: float
    """Longest computation of a tick [s]."""
    tracking: float
    """Largest distance of the tool from its reference while a motion ran [m]."""
    force: float
    """Largest force on the tool as torques and motion tell [N]."""


@dataclass(frozen=True, slots=True)
class LoopOfGame:
    """Of all plies; whether the bus was in lockstep, where no tick can be late; why there is nothing, if so."""

    plies: tuple[LoopOfPly, ...] = ()
    lockstep: bool = False
    missing: str = ""


@dataclass(frozen=True, slots=True)
class ReportSource:
    """One record."""

    folder: Path
    """Of it."""
    events: tuple[AnyEvent, ...]
    """All of them."""
    start: StartEvent
    """The first."""
    plies: tuple[PlyEvent, ...]
    """Those that count."""
    report: Report
    """What its numbers come to."""
    robot: RobotRecord | None
    """What it was played on; None: the record does not say."""
    limits: Limits | None
    """Of that robot; None: likewise."""
    loop: LoopOfGame
    """What the telemetry says."""
    rounds: tuple[Path, ...]
    """Folders of all rounds of its match that have a record, in their order."""
    analysis: GameAnalysis | None = None
    """What an engine thinks of it; None: nobody has analysed it, or not this game."""
    said: tuple[str, ...] = field(default=())
    """What was left out of a file that was cut off."""

    @property
    def end(self) -> EndEvent | None:
        """How it ended; None: the record breaks off."""
        last = self.events[-1]
        return last if isinstance(last, EndEvent) else None


def read_source(folder: Path, told: Callable[[str], None] = unsaid) -> ReportSource:
    """Read a record; what is missing beside its events is left out.

    Raises:
        RecordError: the events cannot be read, do not begin with a start, or contradict themselves.
    """
    said: list[str] = []

    def note(sentence: str) -> None:
        said.append(sentence)
        told(sentence)

    events = read_events(folder / EVENTS_FILE, note)
    report = summarise(events)
    start = events[0]
    assert isinstance(start, StartEvent)
    plies = tuple(counted_plies(events))
    robot = kept_robot(folder)
    match = match_folder(folder)
    return ReportSource(
        folder, events, start, plies, report, robot,
        None if robot is None else _limits_of(robot, folder),
        _loop(match, events, plies), rounds_of(match),
        kept_analysis(folder, [ply.uci for ply in plies]), tuple(said),
    )  # fmt: skip


def _limits_of(robot: RobotRecord, folder: Path) -> Limits:
    try:
        return default_limits(robot.parameters, robot.table)
    except ValueError as error:
        raise RecordError(f"{folder / ROBOT_FILE} contradicts itself: {error}") from error


def _loop(match: Path, events: Sequence[AnyEvent], plies: Sequence[PlyEvent]) -> LoopOfGame:
    files = sorted(match.glob(f"{Path(TELEMETRY_FILE).stem}*.mcap"))
    if not files:
        return LoopOfGame(missing=f"There is no {TELEMETRY_FILE} in this record.")
    spans = _spans(events, plies)
    since, until = events[0].plant_time, events[-1].plant_time
    try:
        telemetry = itertools.chain.from_iterable(read_telemetry(file, since, until) for file in files)
        return _by_ply(spans, telemetry)
    except RecordError as error:
        return LoopOfGame(missing=f"The telemetry cannot be read: {error}.")


def _spans(events: Iterable[AnyEvent], plies: Sequence[PlyEvent]) -> list[tuple[float, float, int]]:
    """Of each ply that the arm made: plant time of its first step and of its end [s], and its number."""
    done, spans, begun = set(map(id, plies)), [], None
    for event in events:
        if isinstance(event, StepEvent) and event.uci is not None:
            begun = event.plant_time if begun is None else begun
        elif isinstance(event, PlyEvent):
            if begun is not None and id(event) in done:
                spans.append((begun, event.plant_time, event.ply))
            begun = None
    return spans


def _by_ply(spans: Sequence[tuple[float, float, int]], told: Iterable[tuple[float, Telemetry]]) -> LoopOfGame:
    found: dict[int, LoopOfPly] = {}
    lockstep = False
    ordered = sorted(spans)
    at = 0
    for stamp, one in told:
        lockstep = lockstep or bool(one.flags & Flag.LOCKSTEP)
        if at and stamp < ordered[at - 1][1]:
            at = 0  # another file begins anew
        while at < len(ordered) and ordered[at][1] < stamp:
            at += 1
        if at < len(ordered) and ordered[at][0] <= stamp:
            number = ordered[at][2]
            found[number] = _worst(found.get(number, LoopOfPly(number, 0.0, 0.0, 0.0, 0.0)), one)
    missing = "" if found else "The telemetry contains nothing from the plies of the arm."
    return LoopOfGame(tuple(found[number] for number in sorted(found)), lockstep, missing)


def _worst(so_far: LoopOfPly, one: Telemetry) -> LoopOfPly:
    away = math.dist(one.position, one.reference) if one.motion else 0.0
    return LoopOfPly(
        so_far.ply, _larger(so_far.lateness, one.lateness), _larger(so_far.work, one.work),
        _larger(so_far.tracking, away), _larger(so_far.force, math.hypot(*one.force)),
    )  # fmt: skip


def _larger(one: float, other: float) -> float:
    return max(one, other) if math.isfinite(other) else one
