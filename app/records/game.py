"""The record of one game: a folder that is complete after every ply."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType

import chess
from pydantic import JsonValue

from app.manipulation import Inventory, Ply, Stage
from app.records.events import (
    AnyEvent,
    EndEvent,
    Pace,
    PlyEvent,
    Result,
    ResumeEvent,
    StartEvent,
    StepEvent,
    piece_records,
    transfer_records,
)
from app.records.files import LineLog, recording, write_atomically
from app.records.history import History
from app.records.pgn import PgnFile
from app.records.report import Report, summarise

EVENTS_FILE = "events.jsonl"
PGN_FILE = "game.pgn"
REPORT_FILE = "report.json"


def utc_now() -> datetime:
    """Wall time, aware, in UTC."""
    return datetime.now(UTC)


@dataclass(frozen=True, slots=True)
class GameSetup:
    """Who plays, and how."""

    white: str
    black: str
    seed: int
    pace: Pace
    site: str = "?"


@dataclass(frozen=True, slots=True)
class PlyOutcome:
    """What was measured while the arm did a ply; fields only a referee knows are None in a lab."""

    planned: float
    """Plant time from home to home, as planned [s]."""
    real: float
    """Plant time from home to home, as it was [s]."""
    peak_torque: float
    """Largest servomotor torque [N m]."""
    placement_mm: Mapping[str, float] | None = None
    """Distance of each moved piece from the centre of its place, by name [mm]."""
    peak_force: float | None = None
    """Largest contact force [N]."""
    physical_ok: bool | None = None
    frame: str | None = None
    """Name of the camera's picture in the folder."""
    failures: tuple[str, ...] = ()
    resumed: bool = False
    """Another program had begun it."""


class GameRecord:
    """Writes ``events.jsonl``, ``game.pgn`` and ``report.json`` of one game into a folder.

    Every method that writes raises RecordError when the disk is full or the folder cannot be written; what was
    written before stays whole. Plant times are in seconds.
    """

    def __init__(
        self, folder: Path, log: LineLog, pgn: PgnFile, events: Sequence[AnyEvent], now: Callable[[], datetime]
    ) -> None:
        """Of files that are open; use ``begin`` or ``go_on``."""
        self.folder = folder
        self._now = now
        self._log = log
        self._pgn = pgn
        self._events = list(events)

    @classmethod
    def begin(
        cls,
        folder: Path,
        setup: GameSetup,
        board: chess.Board,
        inventory: Inventory,
        plant_time: float,
        *,
        now: Callable[[], datetime] = utc_now,
    ) -> GameRecord:
        """Begin the record: the start event and a PGN without moves are on the disk.

        Args:
            folder: made if it is missing; must not hold a game (``files.new_folder`` makes a fresh one).
            setup: who plays, and how.
            board: the position at the start; it is not changed.
            inventory: what stands where at the start.
            plant_time: plant time of the start [s].
            now: wall time, for tests.
        """
        with recording(folder):
            folder.mkdir(parents=True, exist_ok=True)
        log = LineLog(folder / EVENTS_FILE)
        start = _start_event(now(), plant_time, setup, board, inventory)
        try:
            log.append(start.model_dump_json())
            return cls(folder, log, _pgn(folder, start, setup.site), [start], now)
        except BaseException:
            log.close()
            raise

    @classmethod
    def go_on(cls, folder: Path, history: History, *, now: Callable[[], datetime] = utc_now) -> GameRecord:
        """Go on with a record that was broken off.

        Args:
            folder: of the record.
            history: as read from it.
            now: wall time, for tests.
        """
        log = LineLog(folder / EVENTS_FILE, go_on=True)
        try:
            moves = [event.uci for event in history.events if isinstance(event, PlyEvent)]
            return cls(folder, log, _pgn(folder, history.start, "?", moves), history.events, now)
        except BaseException:
            log.close()
            raise

    def __enter__(self) -> GameRecord:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def events(self) -> tuple[AnyEvent, ...]:
        """All events that are on the disk."""
        return tuple(self._events)

    @property
    def start(self) -> StartEvent:
        """The first event."""
        first = self._events[0]
        assert isinstance(first, StartEvent)
        return first

    def resumed(self, plant_time: float) -> None:
        """Record that another program goes on with the game."""
        self._append(ResumeEvent(wall_time=self._now(), plant_time=plant_time, ply=self._plies()))

    def step(self, uci: str, transfer: int, stage: Stage, plant_time: float) -> None:
        """Record a part of a ply before the arm begins it; returns at once, without waiting for the disk.

        Args:
            uci: the move.
            transfer: of its transfers, which, from 0.
            stage: of that transfer.
            plant_time: [s].
        """
        step = StepEvent(
            wall_time=self._now(), plant_time=plant_time, ply=self._plies() + 1, uci=uci, transfer=transfer, stage=stage
        )
        self._append(step, durable=False)

    def ply(self, ply: Ply, outcome: PlyOutcome, plant_time: float) -> PlyEvent:
        """Record a ply after the arm has done it.

        Raises:
            ValueError: it is not legal after the plies recorded so far (of python-chess); nothing is written.
        """
        after = self._pgn.board.copy(stack=False)
        after.push_uci(ply.uci)
        event = _ply_event(self._now(), plant_time, number=self._plies() + 1, ply=ply, outcome=outcome, fen=after.fen())
        self._append(event)
        self._pgn.add(ply.uci)
        return event

    def end(
        self,
        result: Result,
        reason: str,
        plant_time: float,
        *,
        failures: Sequence[str] = (),
        speed: float | None = None,
        world_state: str | None = None,
        details: dict[str, JsonValue] | None = None,
    ) -> Report:
        """Record the end, write the report and close the record.

        Args:
            result: as in PGN.
            reason: why the game ended, one phrase.
            plant_time: plant time of the end [s].
            failures: sentences on what went wrong outside any ply.
            speed: plant time over wall time while ticks ran.
            world_state: digest of the world's final state.
            details: more for the report.
        """
        wall, plies = self._now(), self._plies()
        self._append(EndEvent(wall_time=wall, plant_time=plant_time, ply=plies, result=result, reason=reason))
        self._pgn.finish(result, reason)
        report = summarise(self._events, failures=failures, speed=speed, world_state=world_state, details=details)
        write_atomically(self.folder / REPORT_FILE, report.model_dump_json(indent=2) + "\n")
        self.close()
        return report

    def close(self) -> None:
        """Close the files; a second call does nothing."""
        self._log.close()

    def _plies(self) -> int:
        return sum(isinstance(event, PlyEvent) for event in self._events)

    def _append(self, event: AnyEvent, *, durable: bool = True) -> None:
        self._log.append(event.model_dump_json(), durable=durable)
        self._events.append(event)


def _pgn(folder: Path, start: StartEvent, site: str, moves: Sequence[str] = ()) -> PgnFile:
    board = chess.Board(start.fen, chess960=start.chess960)
    return PgnFile(
        folder / PGN_FILE, board, white=start.white, black=start.black, site=site, date=start.wall_time, moves=moves
    )


def _start_event(
    wall_time: datetime, plant_time: float, setup: GameSetup, board: chess.Board, inventory: Inventory
) -> StartEvent:
    return StartEvent(
        wall_time=wall_time,
        plant_time=plant_time,
        ply=0,
        fen=board.fen(),
        chess960=board.chess960,
        white=setup.white,
        black=setup.black,
        seed=setup.seed,
        pace=setup.pace,
        inventory=piece_records(inventory),
    )


def _ply_event(
    wall_time: datetime, plant_time: float, *, number: int, ply: Ply, outcome: PlyOutcome, fen: str
) -> PlyEvent:
    return PlyEvent(
        wall_time=wall_time,
        plant_time=plant_time,
        ply=number,
        side=ply.colour,
        san=ply.san,
        uci=ply.uci,
        kind=ply.kind,
        fen=fen,
        planned_s=outcome.planned,
        real_s=outcome.real,
        placement_mm=None if outcome.placement_mm is None else dict(outcome.placement_mm),
        peak_torque_Nm=outcome.peak_torque,
        peak_force_N=outcome.peak_force,
        physical_ok=outcome.physical_ok,
        frame=outcome.frame,
        transfers=transfer_records(ply),
        inventory={name: str(place) for name, place in ply.changes().items()},
        failures=outcome.failures,
        resumed=outcome.resumed,
    )
