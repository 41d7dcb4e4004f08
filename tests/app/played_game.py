"""Records of games that nobody played: written by the code that writes real ones."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import chess
import chess.engine

from app.pieces.inventory import Inventory, Stage
from app.pieces.layout import start_layout
from app.pieces.manipulation import transfers
from app.records import GameRecord, GameSetup, PlyOutcome
from hardware.parameters import RobotParameters, load_parameters
from hardware.table import TableSettings

NOON = datetime(2026, 11, 21, 10, 15, 30, tzinfo=UTC)
EVERY_KIND = "r3k2r/2P5/8/3pP3/8/8/6p1/R3K2R w KQkq d6 0 1"
LINE_OF_EVERY_KIND = "exd6 O-O O-O-O gxh1=N Rxh1"
"""En passant, castling twice, promotion, capture."""


class PlayedGame:
    """A game that is written move by move."""

    def __init__(
        self, folder: Path, fen: str = chess.STARTING_FEN, white: str = "Stockfish 1500", black: str = "Stockfish 2000",
        parameters: RobotParameters | None = None, time_control: str | None = None,
    ) -> None:  # fmt: skip
        ticks = iter(range(10**6))
        table = TableSettings()
        self.board = chess.Board(fen)
        self.inventory = Inventory.of(start_layout(self.board, table), table)
        setup = GameSetup(white, black, seed=7, pace="fast", site="simulated", time_control=time_control)
        self.record = GameRecord.begin(
            folder, setup, self.board, self.inventory, 1.0, now=lambda: NOON + timedelta(seconds=next(ticks))
        )
        self.record.robot(parameters or load_parameters())
        self.time = 1.0

    def play(self, line: str, outcome: Callable[[int], dict[str, Any]] = lambda number: {}) -> PlayedGame:
        for san in line.split():
            move = self.board.parse_san(san)
            ply = transfers(self.board, move, self.inventory)
            self.inventory = self.inventory.after(ply)
            self.board.push(move)
            number = len(self.board.move_stack)
            self.record.step(ply.uci, 0, Stage.APPROACH, self.time)
            self.time += 1.0 + len(ply.transfers)
            usual: dict[str, Any] = {
                "planned": 1.9,
                "real": 1.0 + len(ply.transfers) + 0.01 * number,
                "peak_torque": 2.5 + 0.1 * number,
                "placement_mm": {name: 0.1 * (k + number) for k, name in enumerate(ply.changes())},
                "peak_force": 6.0,
                "physical_ok": True,
                "score": chess.engine.PovScore(chess.engine.Cp(31 * number), chess.WHITE),
            }
            self.record.ply(ply, PlyOutcome(**(usual | outcome(number))), self.time)
        return self
