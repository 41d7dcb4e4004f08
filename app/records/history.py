"""A recorded game read back: where it stands, and what was under way when the record broke off."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import chess

from app.pieces.inventory import Inventory, Stage, Transfer
from app.records.events import (
    MENDED,
    AnyEvent,
    EndEvent,
    FoundEvent,
    PlyEvent,
    Purpose,
    SideEvent,
    StartEvent,
    StepEvent,
    TaskDoneEvent,
    TaskDroppedEvent,
    TaskEvent,
    TransferRecord,
    read_event,
    unsaid,
)
from app.records.files import RecordError, whole_lines
from hardware.piece_set import Colour
from hardware.table import PieceSpec, Place, TableSettings


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
        found: names of the pieces that were found, or believed, elsewhere since.
    """

    uci: str | None = None
    task: TaskEvent | None = None
    repair: tuple[Transfer, ...] | None = None
    transfer: int | None = None
    stage: Stage | None = None
    found: frozenset[str] = frozenset()

    @property
    def touched(self) -> bool:
        """Whether pieces may stand elsewhere than before it was begun."""
        return self.transfer is not None or self.repair is not None


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
class RecordState:
    """What the events of a game up to one say.

    Attributes:
        places: where each piece stands, by name.
        board: the position, with the moves that led to it; None: it is not followed.
        plies: those that count, in their order.
        unfinished: what the arm had begun and not finished.
        ended: the game was over, or was left in good order.
    """

    places: dict[str, str]
    board: chess.Board | None = None
    plies: list[PlyEvent] = field(default_factory=list)
    unfinished: Unfinished | None = None
    ended: bool = False

    @classmethod
    def after(cls, events: Sequence[AnyEvent], board: chess.Board | None = None) -> RecordState:
        """After the events of one game, of which the first one starts it, at a position that is followed."""
        start = events[0]
        assert isinstance(start, StartEvent)
        state = cls({piece.name: piece.place for piece in start.inventory}, board)
        for event in events[1:]:
            state.take(event)
        return state

    @property
    def taken_back(self) -> int:
        """The number of plies that do not count any more once the task that was begun is done."""
        return 0 if self.unfinished is None or self.unfinished.task is None else self.unfinished.task.taken_back

    def take(self, event: AnyEvent) -> None:
        """One event more; ValueError or IndexError if it contradicts the position."""
        self.ended = isinstance(event, EndEvent)
        match event:
            case PlyEvent():
                if event.ply != len(self.plies) + 1:
                    raise ValueError(f"ply {event.ply} follows ply {len(self.plies)}")
                if self.board is not None:
                    self.board.push_uci(event.uci)
                self.plies.append(event)
                self.places.update(event.inventory)
                self.unfinished = None
            case StepEvent():
                begun = self.unfinished
                if begun is None or event.uci not in (None, begun.uci):  # what was begun before was given up
                    begun = Unfinished(event.uci)
                self.unfinished = replace(begun, transfer=event.transfer, stage=event.stage)
            case FoundEvent():
                self.places.update(event.inventory)
                begun = self.unfinished or Unfinished()
                found = begun.found.union(event.inventory)
                self.unfinished = replace(begun, repair=(), transfer=None, stage=None, found=found)
            case TaskEvent() if event.purpose is Purpose.REPAIR and self.unfinished is not None:
                transfers = tuple(transfer_of(one) for one in event.transfers)
                self.unfinished = replace(self.unfinished, repair=transfers, transfer=None, stage=None)
            case TaskEvent():
                self.unfinished = Unfinished(task=event)
            case TaskDoneEvent():
                self._finish(event)
            case TaskDroppedEvent():
                self.unfinished = None
            case _:
                pass

    def _finish(self, event: TaskDoneEvent) -> None:
        self.places.update(event.inventory)
        task = None if self.unfinished is None else self.unfinished.task
        self.unfinished = None
        if task is None:
            return
        del self.plies[len(self.plies) - task.taken_back :]
        if self.board is not None:
            for _ in range(task.taken_back):
                self.board.pop()
            if task.fen is not None:
                self.board = chess.Board(task.fen, chess960=self.board.chess960)


def persons_side(events: Iterable[AnyEvent]) -> Colour | None:
    """The side that the person at the board has changed to last; None: to none."""
    return next((event.person for event in reversed([*events]) if isinstance(event, SideEvent)), None)


def read_events(path: Path, said: Callable[[str], None] = unsaid) -> tuple[AnyEvent, ...]:
    """Read ``events.jsonl``: one game that begins with its start, in which every line can follow those before.

    A last line that a crash cut short or garbled is left out, and ``said`` is told so.

    Raises:
        RecordError: the file cannot be read, another line is no event, does not follow or starts another game.
    """
    return _read(path, said)[0]


def _read(path: Path, said: Callable[[str], None]) -> tuple[tuple[AnyEvent, ...], RecordState]:
    """The events, and what they come to."""
    try:
        lines, left_out = whole_lines(path.read_bytes())
    except OSError as error:
        raise RecordError(f"{path} cannot be read: {error.strerror}: name the folder of a recorded game") from error
    events = tuple(read_event(path, number, line) for number, line in enumerate(lines, start=1))
    if not events or not isinstance(events[0], StartEvent):
        raise RecordError(f"{path} does not begin with the start of a game: name the folder of a recorded game")
    try:
        state = RecordState.after(events[:1], chess.Board(events[0].fen, chess960=events[0].chess960))
    except ValueError as error:
        raise RecordError(f"{path} starts from no position: {error}: correct its first line") from error
    for number, event in enumerate(events[1:], start=2):
        if isinstance(event, StartEvent):
            raise RecordError(
                f"{path}, line {number}, starts another game, but a record holds one: "
                "keep the lines of one game, or name another folder"
            )
        try:
            state.take(event)
        except (ValueError, IndexError) as error:
            raise RecordError(f"{path}, line {number}, contradicts those before it: {error}: {MENDED}") from error
    if left_out:
        said(
            f"{path}, line {len(lines) + 1}, the last one, is cut off or garbled and was skipped: everything before "
            "it is complete"
        )
    return events, state


def read_history(path: Path, table: TableSettings, said: Callable[[str], None] = unsaid) -> History:
    """Read ``events.jsonl`` of a game that was played on this table; ``said`` is told what was left out at the end.

    Raises:
        RecordError: as of ``read_events``, or the pieces stand elsewhere than the game says.
    """
    events, state = _read(path, said)
    start = events[0]
    assert isinstance(start, StartEvent)
    board = state.board
    assert board is not None
    try:
        inventory = Inventory.of(
            (PieceSpec(p.name, p.kind, p.colour, Place.parse(state.places[p.name])) for p in start.inventory), table
        )
        # where the pieces stand is what the game says, unless a repair was on its way to that
        if state.unfinished is None or state.unfinished.repair is None:
            inventory.check_against(board)
    except (ValueError, RuntimeError, IndexError) as error:
        raise RecordError(f"{path} contradicts itself: {error}: bring it back from a copy, or start anew") from error
    return History(start, events, board, inventory, state.unfinished, tuple(state.plies), state.ended)


def counted_plies(events: Sequence[AnyEvent]) -> list[PlyEvent]:
    """Plies of a game that were not taken back, in their order."""
    return RecordState.after(events).plies


def transfer_of(record: TransferRecord) -> Transfer:
    """As it was recorded."""
    source, target = Place.parse(record.source), Place.parse(record.target)
    return Transfer(record.piece, record.kind, record.colour, source, target, record.seen, record.raised)
