"""The record of one game: a folder that is complete after every ply."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import chess
import chess.engine
from pydantic import JsonValue

from app.pieces.inventory import Inventory, Ply, Stage, Transfer
from app.players.game_end import Result
from app.records.events import (
    AnyEvent,
    EndEvent,
    FoundEvent,
    GameSetup,
    PlyEvent,
    PlyOutcome,
    Purpose,
    RepairedBy,
    ResumeEvent,
    SideEvent,
    StartEvent,
    StepEvent,
    TaskDoneEvent,
    TaskDroppedEvent,
    TaskEvent,
    TroubleEvent,
    own_clock,
    ply_event,
    score_of,
    start_event,
    transfer_records,
)
from app.records.files import EVENTS_FILE, LineLog, make, recording, write_atomically
from app.records.history import History, RecordState, Unfinished
from app.records.pgn_writing import PgnFile, PgnMove
from app.records.report import Report, summarise
from app.records.robot import RobotRecord, Row, keep_robot
from hardware.parameters import RobotParameters
from hardware.piece_set import Colour
from hardware.table import Place, TableSettings

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

FRAMES = "frames"
"""A folder: ``ply-000.jpg`` shows the position that the record begins with, each other the one after that ply."""
PGN_FILE = "game.pgn"
REPORT_FILE = "report.json"


def utc_now() -> datetime:
    """Wall time, aware, in UTC."""
    return datetime.now(UTC)


class GameRecord:
    """Writes ``events.jsonl``, ``game.pgn`` and ``report.json`` of one game into a folder.

    Every method that writes raises RecordError when the disk is full or the folder cannot be written; what was
    written before stays whole. Plant times are in seconds.
    """

    def __init__(
        self,
        folder: Path,
        log: LineLog,
        pgn: PgnFile,
        events: Sequence[AnyEvent],
        now: Callable[[], datetime],
        table: TableSettings,
    ) -> None:
        """Of files that are open; use ``begin`` or ``go_on``."""
        self.folder = folder
        self._table = table
        self._now = now
        self._log = log
        self._pgn = pgn
        self._events = list(events)
        self._state = RecordState.after(events)

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
            make(folder)
        log = LineLog(folder / EVENTS_FILE)
        start = start_event(now(), plant_time, setup, board, inventory)
        try:
            log.append(start.model_dump_json())
            return cls(folder, log, _pgn(folder, start), [start], now, inventory.table)
        except BaseException:
            log.close()
            raise

    @classmethod
    def go_on(cls, folder: Path, history: History, *, now: Callable[[], datetime] = utc_now) -> GameRecord:
        """Go on with a record that was broken off, by its history; ``now`` is the wall time, for tests."""
        log = LineLog(folder / EVENTS_FILE, go_on=True)
        try:
            moves = [_pgn_move(event) for event in history.plies]
            pgn = _pgn(folder, history.start, moves)
            if sum(isinstance(event, SideEvent) for event in history.events) % 2:
                pgn.change_sides()
            return cls(folder, log, pgn, history.events, now, history.inventory.table)
        except BaseException:
            log.close()
            raise

    def __enter__(self) -> GameRecord:
        return self

    def __exit__(self, *_: object) -> None:
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

    def robot(self, parameters: RobotParameters, board_from_camera: tuple[Row, Row, Row] | None = None) -> None:
        """Keep with the record which robot plays, how its table stands, and where its camera hangs, if known."""
        keep_robot(
            self.folder,
            RobotRecord(parameters=parameters, table=self._table, board_from_camera=board_from_camera),
        )

    def resumed(self, plant_time: float) -> None:
        """Record that another program goes on with the game."""
        self._add(ResumeEvent, plant_time)

    def sides_changed(self, person: Colour, plant_time: float) -> None:
        """Record that the person at the board plays another side from now on."""
        self._add(SideEvent, plant_time, person=person)
        self._pgn.change_sides()

    def step(self, uci: str | None, transfer: int, stage: Stage, plant_time: float, *, durable: bool = False) -> None:
        """Record a part of a ply or task before the arm begins it.

        Args:
            uci: the move; None: of the task begun last.
            transfer: of its transfers, which, from 0.
            stage: of that transfer.
            plant_time: [s].
            durable: wait until it is on the disk; else return at once, as between two motions that belong together.
        """
        number = self._plies() + 1
        self._add(StepEvent, plant_time, durable=durable, ply=number, uci=uci, transfer=transfer, stage=stage)

    def task(
        self,
        purpose: Purpose,
        label: str,
        transfers: Sequence[Transfer],
        plant_time: float,
        *,
        fen: str | None = None,
        taken_back: int = 0,
    ) -> None:
        """Record what else than a ply the arm is about to do.

        Args:
            purpose: of it.
            label: what it is, for people.
            transfers: in order of execution.
            plant_time: [s].
            fen: the position that is set up, if it is another one than the game's.
            taken_back: so many plies do not count any more once it is done.
        """
        carried = transfer_records(transfers)
        self._add(
            TaskEvent, plant_time, purpose=purpose, label=label, transfers=carried, fen=fen, taken_back=taken_back
        )

    def task_done(self, stands: Inventory, outcome: PlyOutcome, plant_time: float) -> None:
        """Record that the task begun last was done, or that what was found was put right; and what stands where now."""
        taken_back = self._state.taken_back
        self._add(
            TaskDoneEvent, plant_time, ply=self._plies() - taken_back, real_s=outcome.real,
            inventory=self._moved(stands), physical_ok=outcome.physical_ok, failures=outcome.failures,
            resumed=outcome.resumed, mended=outcome.mended,
        )  # fmt: skip
        if taken_back:
            self._pgn.take_back(taken_back)

    def task_dropped(self, reason: str, plant_time: float) -> None:
        """Record that the task begun last cannot be done, and nothing was moved for it."""
        self._add(TaskDroppedEvent, plant_time, reason=reason)

    def found(self, stands: Inventory, reason: str, plant_time: float) -> None:
        """Record that pieces were seen elsewhere than the game wants them: what stands where, as far as it does."""
        self._add(FoundEvent, plant_time, reason=reason, inventory=self._moved(stands))

    def trouble(
        self, kind: str, squares: Sequence[str], sentence: str, mended_by: RepairedBy | None, plant_time: float
    ) -> None:
        """Record something that went wrong at the board, and who has put it right."""
        squares = tuple(squares)
        self._add(TroubleEvent, plant_time, kind=kind, squares=squares, sentence=sentence, mended_by=mended_by)

    @property
    def unfinished(self) -> Unfinished | None:
        """What the arm has begun and not finished."""
        return self._state.unfinished

    def stands(self, pieces: Inventory) -> Inventory:
        """What stands where by what is recorded; ``pieces`` are the game's, wherever they stand."""
        places = self._state.places
        return Inventory.of((replace(p, place=Place.parse(places[p.name])) for p in pieces), pieces.table)

    def picture(self, number: int, colour: NDArray[np.uint8]) -> str:
        """Keep what the board looks like after so many plies, RGB (h, w, 3), as JPEG; its name, for the ply's event."""
        import cv2  # only where there is a camera

        name = f"{FRAMES}/ply-{number:03d}.jpg"
        path = self.folder / name
        quality = [cv2.IMWRITE_JPEG_QUALITY, 88]
        done, encoded = cv2.imencode(".jpg", cv2.cvtColor(colour, cv2.COLOR_RGB2BGR), quality)
        if not done:
            raise RuntimeError(f"OpenCV could not encode {path.name}")
        with recording(path):
            path.parent.mkdir(exist_ok=True)
            path.write_bytes(encoded.tobytes())
        return name

    def ply(self, ply: Ply, outcome: PlyOutcome, plant_time: float, stands: Inventory | None = None) -> PlyEvent:
        """Record a ply after it was done.

        Args:
            ply: as it was meant.
            outcome: what is known of it.
            plant_time: [s].
            stands: what stands where now; None: as it was meant.

        Raises:
            ValueError: it is not legal after the plies recorded so far (of python-chess); nothing is written.
        """
        after = self._pgn.board.copy(stack=False)
        after.push_uci(ply.uci)
        event = ply_event(
            self._now(), plant_time, number=self._plies() + 1, ply=ply, outcome=outcome, fen=after.fen(),
            places={n: str(p) for n, p in ply.changes().items()} if stands is None else self._moved(stands),
        )  # fmt: skip
        self._append(event)
        self._pgn.add(PgnMove(ply.uci, own_clock(event), outcome.score, outcome.comment))
        return event

    def decide(self, result: Result, reason: str, plant_time: float) -> None:
        """Record the end, before anything else is asked or done; arguments as of ``end``, which has to follow."""
        self._add(EndEvent, plant_time, result=result, reason=reason)
        self._pgn.finish(result, reason)

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
        """Record the end, unless it was decided already, write the report and close the record.

        Args:
            result: as in PGN.
            reason: why the game ended, one phrase.
            plant_time: plant time of the end [s].
            failures: sentences on what went wrong outside any ply.
            speed: plant time over wall time while ticks ran.
            world_state: digest of the world's final state.
            details: more for the report.
        """
        if not isinstance(self._events[-1], EndEvent):
            self.decide(result, reason, plant_time)
        report = summarise(self._events, failures=failures, speed=speed, world_state=world_state, details=details)
        write_atomically(self.folder / REPORT_FILE, report.model_dump_json(indent=2) + "\n")
        self.close()
        return report

    def close(self) -> None:
        """Close the files; a second call does nothing."""
        self._log.close()

    def _moved(self, stands: Inventory) -> dict[str, str]:
        """Where the pieces stand that the record has elsewhere."""
        return {p.name: str(p.place) for p in stands if self._state.places[p.name] != str(p.place)}

    def _plies(self) -> int:
        return len(self._state.plies)

    def _add(self, event: Callable[..., AnyEvent], plant_time: float, /, *, durable: bool = True, **what: Any) -> None:
        """An event, now; its ply is the last one done unless ``what`` says another."""
        stamps = {"wall_time": self._now(), "plant_time": plant_time, "ply": self._plies()}
        self._append(event(**(stamps | what)), durable=durable)

    def _append(self, event: AnyEvent, *, durable: bool = True) -> None:
        self._log.append(event.model_dump_json(), durable=durable)
        self._events.append(event)
        self._state.take(event)


def _pgn(folder: Path, start: StartEvent, moves: Sequence[PgnMove] = ()) -> PgnFile:
    return PgnFile(
        folder / PGN_FILE, chess.Board(start.fen, chess960=start.chess960), white=start.white, black=start.black,
        site=start.site, date=start.wall_time, moves=moves, time_control=start.time_control,
    )  # fmt: skip


def _pgn_move(event: PlyEvent) -> PgnMove:
    return PgnMove(event.uci, own_clock(event), None if event.score is None else score_of(event.score), event.comment)
