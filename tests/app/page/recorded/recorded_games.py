"""Games drawn by lot, recorded as the program does it: plies of arm and hand, take-backs, repairs, changes of side."""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from pathlib import Path

import chess

from app.pieces.inventory import Inventory, Stage
from app.pieces.layout import start_layout
from app.pieces.manipulation import NoSpare, transfers
from app.records.events import GameSetup, PlyOutcome, Purpose
from app.records.game import GameRecord
from hardware.piece_set import Colour
from hardware.table import TableSettings

TABLE = TableSettings()
DONE = PlyOutcome(planned=1.5, real=1.6, peak_torque=2.0, physical_ok=True)
PARTS = (Stage.APPROACH, Stage.GRASP, Stage.CARRY, Stage.RELEASE)


@dataclass
class RecordedGame:
    """A game in a folder; ``board`` and ``inventory`` are as the record should say."""

    folder: Path
    seed: int = 0
    table: TableSettings = TABLE
    start: str = chess.STARTING_FEN
    board: chess.Board = field(init=False)
    time: float = 0.0

    def __post_init__(self) -> None:
        self.board = chess.Board(self.start)
        self._inventories = [Inventory.of(start_layout(self.board, self.table), self.table)]
        self.record = GameRecord.begin(self.folder, GameSetup("a", "b", 1, "fast"), self.board, self.inventory, 0.0)
        self.lot = random.Random(self.seed)

    @property
    def inventory(self) -> Inventory:
        return self._inventories[-1]

    def later(self) -> float:
        self.time += 0.25
        return self.time

    def ply(self, move: chess.Move | str, *, by_hand: bool = False, broken_off: int | None = None) -> None:
        """A ply; broken off: after so many of its parts, as by a crash."""
        if isinstance(move, str):
            move = self.board.parse_san(move)
        ply = transfers(self.board, move, self.inventory)
        parts = [(number, stage) for number, _ in enumerate(ply.transfers) for stage in PARTS]
        for number, stage in () if by_hand else parts[:broken_off]:
            self.record.step(ply.uci, number, stage, self.later())
        if broken_off is not None:
            return
        outcome = PlyOutcome(by="hand") if by_hand else DONE
        self.record.ply(ply, outcome, self.later())
        self._inventories.append(self.inventory.after(ply))
        self.board.push(move)

    def take_back(self, count: int) -> None:
        self.record.task(Purpose.TAKE_BACK, "take back", (), self.later(), taken_back=count)
        for _ in range(count):
            self.board.pop()
            self._inventories.pop()
        self.record.task_done(self.inventory, DONE, self.later())

    def by_lot(self, steps: int) -> None:
        """So many things happen that are drawn by lot."""
        for _ in range(steps):
            what = self.lot.random()
            if what < 0.1 and self.board.move_stack:
                self.take_back(self.lot.randint(1, min(3, len(self.board.move_stack))))
            elif what < 0.15:
                self.record.sides_changed(self.lot.choice([*Colour]), self.later())
            elif what < 0.2:
                self.record.trouble("fallen", ("e4",), "a piece has fallen", "arm", self.later())
            elif what < 0.25:
                self.record.found(self.inventory, "something stands off", self.later())
                self.record.task_done(self.inventory, DONE, self.later())
            elif moves := [*self.board.legal_moves]:
                try:
                    self.ply(self.lot.choice(moves), by_hand=self.lot.random() < 0.3)
                except NoSpare:
                    continue

    def end(self, reason: str = "the person has left") -> None:
        self.record.end("*", reason, self.later())
