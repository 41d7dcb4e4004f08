"""A recorded game read back: where it stands, and what was under way when the record broke off."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import chess

from app.pieces.inventory import Inventory, Stage, Transfer
from app.records.events import (
    AnyEvent,
    EndEvent,
    FoundEvent,
    PieceRecord,
    PlyEvent,
    Purpose,
    SideEvent,
    StartEvent,
    StepEvent,
    TaskDoneEvent,
    TaskDroppedEvent,
    TaskEvent,
    TransferRecord,
    read_events,
    unsaid,
)
from app.records.files import RecordError
from hardware.table import Colour, PieceSpec, Place, TableSettings


@dataclass(frozen=True, slots=True)
class Unfinished:
    """What the arm had begun and not finished.

    Attributes:
        uci: the move; None for a task.
        task: that is no move; None for a move.
        repair: pieces stood elsewhere than they should, and were about to be put right: transfers for that, from where
            the inventory has them. None: nothing was wrong.
        transfer: of the transfers of the move, the task or the repair: which was begun last, from 0; None: none was.
        stage: of that transfer, begun last.
    """

    uci: str | None = None
    task: TaskEvent | None = None
    repair: tuple[Transfer, ...] | None = None
    transfer: int | None = None
    stage: Stage | None = None


@dataclass(frozen=True, slots=True)
class History:
    """A game so far.

    Attributes:
        start: its first event.
        events: all of them.
        board: the position after the last ply that was done, with the moves that led to it.
        inventory: what stood where then, with what was done since.
        unfinished: what the arm had begun after that, if it had.
        plies: those that count, in their order.
        ended: the game was over, or was left in good order.
    """

    start: StartEvent
    events: tuple[AnyEvent, ...]
    board: chess.Board
    inventory: Inventory
    unfinished: Unfinished | None
    plies: tuple[PlyEvent, ...]
    ended: bool = False


@dataclass(slots=True)
class _Reading:
    """What the events up to one say."""

    board: chess.Board
    places: dict[str, str]
    plies: list[PlyEvent] = field(default_factory=list)
    unfinished: Unfinished | None = None
    ended: bool = False

    def take(self, event: AnyEvent) -> None:
        self.ended = isinstance(event, EndEvent)
        match event:
            case PlyEvent():
                self.board.push_uci(event.uci)
                self.plies.append(event)
                self.places.update(event.inventory)
                self.unfinished = None
            case StepEvent():
                begun = self.unfinished or Unfinished(event.uci)
                self.unfinished = replace(begun, transfer=event.transfer, stage=event.stage)
            case FoundEvent():
                self.places.update(event.inventory)
                self.unfinished = replace(self.unfinished or Unfinished(), repair=(), transfer=None, stage=None)
            case TaskEvent():
                self._begin(event)
            case TaskDoneEvent():
                self._finish(event)
            case TaskDroppedEvent():
                self.unfinished = None
            case _:
                pass

    def _begin(self, event: TaskEvent) -> None:
        if event.purpose is Purpose.REPAIR and self.unfinished is not None:
            transfers = tuple(transfer_of(one) for one in event.transfers)
            self.unfinished = replace(self.unfinished, repair=transfers, transfer=None, stage=None)
        else:
            self.unfinished = Unfinished(task=event)

    def _finish(self, event: TaskDoneEvent) -> None:
        self.places.update(event.inventory)
        task = None if self.unfinished is None else self.unfinished.task
        self.unfinished = None
        if task is not None:
            for _ in range(task.taken_back):
                self.board.pop()
                self.plies.pop()
            if task.fen is not None:
                self.board = chess.Board(task.fen, chess960=self.board.chess960)


def persons_side(events: Iterable[AnyEvent]) -> Colour | None:
    """The side that the person at the board has changed to last; None: to none."""
    return next((event.person for event in reversed([*events]) if isinstance(event, SideEvent)), None)


def read_history(path: Path, table: TableSettings, said: Callable[[str], None] = unsaid) -> History:
    """Read ``events.jsonl`` of a game that was played on this table.

    Args:
        path: of the file.
        table: on which the game was played.
        said: told in a sentence what was left out at the end.

    Raises:
        RecordError: the file cannot be read, does not begin with a start, or contradicts itself.
    """
    events = read_events(path, said)
    if not events or not isinstance(events[0], StartEvent):
        raise RecordError(f"{path} does not begin with the start of a game: name the folder of a recorded game")
    start = events[0]
    try:
        board = chess.Board(start.fen, chess960=start.chess960)
        reading = _Reading(board, {piece.name: piece.place for piece in start.inventory})
        for event in events[1:]:
            reading.take(event)
        pieces = [_piece(piece, reading.places[piece.name]) for piece in start.inventory]
        inventory = Inventory.of(pieces, table)
        _agree(reading, inventory)
    except (ValueError, RuntimeError, IndexError) as error:
        raise RecordError(f"{path} contradicts itself: {error}") from error
    return History(
        start, events, reading.board, inventory, reading.unfinished, tuple(reading.plies), reading.ended
    )  # fmt: skip


def counted_plies(events: Iterable[AnyEvent]) -> list[PlyEvent]:
    """Plies of a game that were not taken back, in their order."""
    plies: list[PlyEvent] = []
    task: TaskEvent | None = None
    for event in events:
        if isinstance(event, PlyEvent):
            plies.append(event)
        elif isinstance(event, TaskDoneEvent) and task is not None and task.taken_back:
            del plies[-task.taken_back :]
        task = _after(task, event)
    return plies


def places_of(events: Sequence[AnyEvent]) -> dict[str, str]:
    """Where each piece stands by the record, by name."""
    places: dict[str, str] = {}
    for event in events:
        match event:
            case StartEvent():
                places = {piece.name: piece.place for piece in event.inventory}
            case PlyEvent() | FoundEvent() | TaskDoneEvent():
                places.update(event.inventory)
            case _:
                pass
    return places


def open_task(events: Iterable[AnyEvent]) -> TaskEvent | None:
    """The task, no repair, that was begun last and is not done."""
    task: TaskEvent | None = None
    for event in events:
        task = _after(task, event)
    return task


def _after(task: TaskEvent | None, event: AnyEvent) -> TaskEvent | None:
    """The open task after an event."""
    match event:
        case TaskEvent() if event.purpose is not Purpose.REPAIR:
            return event
        case PlyEvent() | TaskDoneEvent() | TaskDroppedEvent():
            return None
        case _:
            return task


def _agree(reading: _Reading, inventory: Inventory) -> None:
    """Where the pieces stand is what the game says, unless a repair was on its way to that."""
    if reading.unfinished is None or reading.unfinished.repair is None:
        inventory.check_against(reading.board)


def _piece(record: PieceRecord, place: str) -> PieceSpec:
    return PieceSpec(record.name, record.kind, record.colour, Place.parse(place))


def transfer_of(record: TransferRecord) -> Transfer:
    """As it was recorded."""
    return Transfer(
        record.piece,
        record.kind,
        record.colour,
        Place.parse(record.source),
        Place.parse(record.target),
        record.seen,
        record.raised,
    )
