"""A recorded game read back: where it stands, and what was under way when the record broke off."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import chess

from app.manipulation import Inventory
from app.records.events import AnyEvent, PieceRecord, PlyEvent, StartEvent, StepEvent, read_events
from app.records.files import RecordError
from hardware.table import PieceSpec, Place, TableSettings


@dataclass(frozen=True, slots=True)
class History:
    """A game so far.

    Attributes:
        start: its first event.
        events: all of them.
        board: the position after the last ply that was done, with the moves that led to it.
        inventory: what stood where then.
        unfinished: what the arm had begun of the ply after that, if it had.
    """

    start: StartEvent
    events: tuple[AnyEvent, ...]
    board: chess.Board
    inventory: Inventory
    unfinished: StepEvent | None

    @property
    def plies(self) -> int:
        """How many plies were done."""
        return len(self.board.move_stack)


def read_history(path: Path, table: TableSettings) -> History:
    """Read ``events.jsonl`` of a game that was played on this table.

    Raises:
        RecordError: the file cannot be read, does not begin with a start, or contradicts itself.
    """
    events = read_events(path)
    if not events or not isinstance(events[0], StartEvent):
        raise RecordError(f"{path} does not begin with the start of a game: name the folder of a recorded game")
    start = events[0]
    board = chess.Board(start.fen, chess960=start.chess960)
    places = {piece.name: piece.place for piece in start.inventory}
    unfinished: StepEvent | None = None
    try:
        for event in events[1:]:
            if isinstance(event, PlyEvent):
                board.push_uci(event.uci)
                places.update(event.inventory)
                unfinished = None
            elif isinstance(event, StepEvent):
                unfinished = event
        pieces = [_piece(piece, places[piece.name]) for piece in start.inventory]
        inventory = Inventory.of(pieces, table)
        inventory.check_against(board)
    except (ValueError, RuntimeError) as error:
        raise RecordError(f"{path} contradicts itself: {error}") from error
    return History(start, events, board, inventory, unfinished)


def _piece(record: PieceRecord, place: str) -> PieceSpec:
    return PieceSpec(record.name, record.kind, record.colour, Place.parse(place))
