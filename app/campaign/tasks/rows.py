"""What came of a task, from the record that it left: rows of the campaign's tables."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import chess

from app.campaign.environment import host_and_cpu
from app.campaign.schema import GameRow, PlyRow, TaskOutcome, TaskResult
from app.campaign.task import CampaignTask
from app.records import EVENTS_FILE, PlyEvent, read_events
from app.records.events import AnyEvent, StartEvent, TaskDoneEvent, TroubleEvent
from app.records.game import REPORT_FILE
from app.records.history import counted_plies
from app.records.report import summarise
from app.records.rounds import rounds_of
from controller.records.loop_statistics import STATISTICS_FILE
from hardware.sim.process.settings import END_FILE

_NOWHERE: Final = (None, None)


@dataclass(slots=True)
class TaskStory:
    """How a task went, as whoever played it saw it.

    Attributes:
        completed: it came to its end, and everything held.
        reason: why it ended; of a failure, what failed.
        asked_for: plies, or acts, that it was to have; None: so many as it had, since the rules end a game.
        line: moves that were to be played, UCI; None: engines chose.
        wrong: something that nobody noticed, as the scripted person saw it; None: nothing.
        said: the last sentence that a person was told.
        asked: so often somebody was asked for something.
        mishaps: planted faults of hands and program that happened.
        resumed: so often the program was killed and resumed.
        datagrams_lost: by a planted loss.
        wall_s: of the whole task.
    """

    completed: bool = False
    reason: str = ""
    asked_for: int | None = None
    line: tuple[str, ...] | None = None
    wrong: str | None = None
    said: str | None = None
    asked: int = 0
    mishaps: int = 0
    resumed: int = 0
    datagrams_lost: int = 0
    wall_s: float = 0.0

    def as_asked(self, plies: Sequence[PlyEvent]) -> bool:
        """Whether what was played is the beginning of what was to be played."""
        return self.line is None or [ply.uci for ply in plies] == list(self.line[: len(plies)])


def result_of(task: CampaignTask, folder: Path, story: TaskStory, environment: str) -> TaskResult:
    """The rows of a task whose record lies in a folder; without a record, what the story says.

    Raises:
        RecordError: the record cannot be read.
    """
    events = [read_events(path / EVENTS_FILE) for path in rounds_of(folder)]
    plies = [ply for one in events for ply in counted_plies(one)]
    judged: list[PlyEvent | TaskDoneEvent] = [
        *plies, *(event for one in events for event in one if isinstance(event, TaskDoneEvent))
    ]  # fmt: skip
    troubles = [event for one in events for event in one if isinstance(event, TroubleEvent)]
    repairs = Counter(trouble.ply for trouble in troubles if trouble.mended_by is not None)
    wrong_plies = sum(one.physical_ok is False for one in judged)
    host, cpu = host_and_cpu()
    row = GameRow(
        index=task.index, seed=task.seed, kind=task.kind,
        outcome=_outcome(story, plies, wrong_plies, repairs.total()),
        reason=_reason(story, plies), said=story.said, plies=len(plies),
        plies_asked_for=len(plies) if story.asked_for is None else story.asked_for,
        sim_s=_lasted(events), wall_s=round(story.wall_s, 3), mishaps=story.mishaps,
        datagrams_lost=story.datagrams_lost, repairs=repairs.total(), asked=story.asked, wrong_plies=wrong_plies,
        **_figures(events), **_of_the_run(folder), repeatable=task.repeatable,
        environment=environment, host=host, cpu=cpu, drawn=task.drawn,
    )  # fmt: skip
    return TaskResult(game=row, plies=tuple(one for each in events for one in _ply_rows(task, each, repairs)))


def crashed(
    task: CampaignTask, reason: str, log: str, environment: str, machine: tuple[str | None, str | None] = _NOWHERE
) -> TaskResult:
    """Of a task that has left nothing else; ``machine`` as of ``host_and_cpu``, by default one that nobody knows."""
    host, cpu = machine
    return TaskResult(game=GameRow(
        index=task.index, seed=task.seed, kind=task.kind, outcome=TaskOutcome.CRASHED, reason=reason, log=log,
        repeatable=task.repeatable, environment=environment, host=host, cpu=cpu, drawn=task.drawn,
    ))  # fmt: skip


def _outcome(story: TaskStory, plies: Sequence[PlyEvent], wrong_plies: int, repairs: int) -> TaskOutcome:
    if wrong_plies or story.wrong is not None or not story.as_asked(plies):
        return TaskOutcome.WRONG
    if not story.completed:
        return TaskOutcome.UNMENDED
    return TaskOutcome.MENDED if repairs or story.asked or story.resumed else TaskOutcome.RIGHT


def _reason(story: TaskStory, plies: Sequence[PlyEvent]) -> str:
    if not story.as_asked(plies):
        return "the record is not the beginning of the line that was to be played"
    failed = next((reason for ply in plies if ply.physical_ok is False for reason in ply.failures), None)
    return story.wrong or failed or story.reason


def _lasted(events: Sequence[Sequence[AnyEvent]]) -> float | None:
    """Plant time from the first start to the last end [s]."""
    return events[-1][-1].plant_time - events[0][0].plant_time if events else None


def _figures(events: Sequence[Sequence[AnyEvent]]) -> dict[str, Any]:
    reports = [summarise(one) for one in events]
    arms = [ply for one in events for ply in counted_plies(one) if ply.by == "arm"]  # a hand's say nothing of the robot
    errors = [value for ply in arms for value in (ply.placement_mm or {}).values()]
    return {
        "placement_mean_mm": sum(errors) / len(errors) if errors else None,
        "placement_max_mm": max(errors, default=None),
        **{
            name: max((peak for one in reports if (peak := getattr(one, name)) is not None), default=None)
            for name in ("peak_torque_Nm", "peak_force_N")
        },
    }


def _of_the_run(folder: Path) -> dict[str, Any]:
    """What world and controller have counted, and how the world was in the end."""
    end, pulse = (_json(folder / "run" / name) for name in (END_FILE, STATISTICS_FILE))
    last = _json(rounds[-1] / REPORT_FILE) if (rounds := rounds_of(folder)) else {}
    return {
        "grips_lost": end.get("grips_lost"), "missed_ticks": pulse.get("skipped"), "speed": last.get("speed"),
        "world_state": last.get("world_state"),
    }  # fmt: skip


def _json(path: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    return found


def _ply_rows(task: CampaignTask, events: Sequence[AnyEvent], repairs: Counter[int]) -> list[PlyRow]:
    start = events[0]
    assert isinstance(start, StartEvent)
    fen, rows = start.fen, []
    for ply in counted_plies(events):
        moved = chess.Board(fen, chess960=start.chess960).piece_at(chess.Move.from_uci(ply.uci).from_square)
        rows.append(PlyRow(
            index=task.index, seed=task.seed, ply=ply.ply, san=ply.san, uci=ply.uci, kind=ply.kind.value, by=ply.by,
            piece="?" if moved is None else moved.symbol(),
            planned_s=None if ply.resumed else ply.planned_s, real_s=None if ply.resumed else ply.real_s,
            error_mm=max(ply.placement_mm.values(), default=None) if ply.placement_mm else None,
            peak_torque_Nm=ply.peak_torque_Nm, peak_force_N=ply.peak_force_N, physical_ok=ply.physical_ok,
            transfers=len(ply.transfers), repairs=repairs[ply.ply],
        ))  # fmt: skip
        fen = ply.fen
    return rows
