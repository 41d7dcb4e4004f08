"""Where pieces stand while a ply or task is under way: what the record believes, and what is in the fingers."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import chess

from app import UserError
from app.pieces.inventory import Inventory, InventoryError, Stage, Transfer
from app.pieces.manipulation import transfers
from app.records.events import AnyEvent, StartEvent, StepEvent
from app.records.history import RecordState, transfer_of
from hardware.piece_set import Colour, Kind
from hardware.table import PieceSpec, Place, TableSettings


@dataclass(frozen=True, slots=True)
class ShownPiece:
    """A piece where it stands, or in the fingers."""

    name: str
    kind: Kind
    colour: Colour
    at: tuple[float, float]
    """Where it stands, board frame [m]; where it was taken, while it is held."""
    held: bool = False
    raised: float = 0.0
    """So much higher than usual the fingers hold it [m]."""


class PieceFollower:
    """Follows the events of one game."""

    def __init__(self, start: StartEvent, table: TableSettings) -> None:
        self._start, self._table = start, table
        self._state = RecordState.after((start,), chess.Board(start.fen, chess960=start.chess960))
        self._job: tuple[Transfer, ...] = ()
        self._step: StepEvent | None = None
        self._known_places: dict[str, tuple[float, float]] = {}

    def take(self, event: AnyEvent) -> None:
        """One event more; ValueError or IndexError if it contradicts the game."""
        before = self._state.unfinished
        self._state.take(event)
        if not isinstance(event, StepEvent):
            self._step = None
            return
        begun = self._state.unfinished
        if self._step is None or before is None or before.uci != event.uci:
            self._job = self._transfers() if begun is not None else ()
        self._step = event

    def pieces(self) -> tuple[ShownPiece, ...]:
        """All pieces, as they are now."""
        standing = {
            piece.name: ShownPiece(piece.name, piece.kind, piece.colour, self._xy(self._state.places[piece.name]))
            for piece in self._start.inventory
        }
        for piece in self._carried(standing):
            standing[piece.name] = piece
        return tuple(standing[name] for name in sorted(standing))

    def _carried(self, standing: dict[str, ShownPiece]) -> Iterable[ShownPiece]:
        """What the job that is under way has changed already."""
        step = self._step
        if step is None:
            return
        for number, transfer in enumerate(self._job[: step.transfer + 1]):
            piece = standing.get(transfer.name)
            if piece is None:
                continue
            piece = replace(piece, at=transfer.grasped_at(self._table), raised=transfer.raised)
            if number < step.transfer or step.stage in (Stage.RELEASE, Stage.RETURN):
                piece = replace(piece, at=self._xy(str(transfer.target)), raised=0.0)
            elif step.stage is Stage.CARRY:
                piece = replace(piece, held=True)
            standing[transfer.name] = piece
            yield piece

    def _transfers(self) -> tuple[Transfer, ...]:
        """Of the repair, the task or the move that is under way; none where the game would plan it otherwise."""
        begun, board = self._state.unfinished, self._state.board
        assert begun is not None
        if begun.repair:
            return begun.repair
        if begun.task is not None:
            return tuple(transfer_of(one) for one in begun.task.transfers)
        if begun.uci is None or board is None:
            return ()
        try:
            return transfers(board, chess.Move.from_uci(begun.uci), self._inventory()).transfers
        except (ValueError, InventoryError, UserError):
            return ()  # the board is not as the game has it; where pieces are is known again when the ply is done

    def _inventory(self) -> Inventory:
        return Inventory.of(
            (
                PieceSpec(p.name, p.kind, p.colour, Place.parse(self._state.places[p.name]))
                for p in self._start.inventory
            ),
            self._table,
        )

    def _xy(self, place: str) -> tuple[float, float]:
        at = self._known_places.get(place)
        if at is None:
            at = self._known_places[place] = self._table.xy(Place.parse(place))
        return at
