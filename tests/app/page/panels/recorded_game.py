"""A short recorded game as the page's server would tell it, at plant times that a test knows."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import chess
import numpy as np

from app.page.recorded.catalogue import RecordPlace
from app.page.recorded.record import record_shown
from app.pieces.inventory import Inventory, Stage
from app.pieces.layout import start_layout
from app.pieces.manipulation import transfers
from app.records.events import GameSetup, PlyOutcome
from app.records.files import EVENTS_FILE
from app.records.game import GameRecord
from app.records.history import read_events
from hardware.table import TableSettings
from tests.app.analysis.analysed import analysed

TABLE = TableSettings()
STAGE = 0.5
"""Every stage of a transfer takes so long [s]."""
ID = "a-game"
ROW = 0.05
"""From row to row of the telemetry [s]."""
HIGH, HOME = 0.05, (0.0, 0.1, 0.36)
"""Height of the tool above the board on its way [m]; where it rests, base frame [m]."""


@dataclass(frozen=True)
class RecordedGame:
    """What the server tells of it.

    Attributes:
        record: ``record.json``.
        telemetry: ``telemetry.json``.
        done: plant time at which each ply was done [s].
        boards: the position at the start and after each ply.
    """

    record: dict[str, Any]
    telemetry: dict[str, Any]
    done: tuple[float, ...]
    boards: tuple[chess.Board, ...]


def recorded_game(folder: Path, *line: str) -> RecordedGame:
    """A game of these moves (SAN), in which the arm goes straight; it was analysed: the second ply loses."""
    board = chess.Board()
    inventory = Inventory.of(start_layout(board, TABLE), TABLE)
    record = GameRecord.begin(folder, GameSetup("Anna", "Bert", 1, "fast"), board, inventory, 0.0)
    now, done, boards, ways = 0.0, list[float](), [board.copy()], [(0.0, HOME)]
    for san in line:
        ply = transfers(board, board.parse_san(san), inventory)
        for which, carried in enumerate(ply.transfers):
            for stage in (Stage.APPROACH, Stage.GRASP, Stage.CARRY, Stage.RELEASE):
                record.step(ply.uci, which, stage, now)
                place = carried.source if stage in (Stage.APPROACH, Stage.GRASP) else carried.target
                now += STAGE
                x, y, z = TABLE.base_from_board(np.array([*TABLE.xy(place), HIGH])).tolist()
                ways.append((now, (x, y, z)))
        record.ply(ply, PlyOutcome(planned=2.0, real=2.0, physical_ok=True), now)
        inventory = inventory.after(ply)
        board.push_san(san)
        boards.append(board.copy())
        done.append(now)
        now += STAGE
        ways.append((now, HOME))
    record.end("*", "it was long enough", now)
    analysed(" ".join(line), [300 * (number % 3 == 2) for number in range(len(line) + 1)], folder)
    events = read_events(folder / EVENTS_FILE)
    shown = record_shown(RecordPlace(ID, folder, 1, False), events)
    return RecordedGame(shown, {"columns": _columns(ways)}, tuple(done), tuple(boards))


def _columns(ways: list[tuple[float, tuple[float, float, float]]]) -> dict[str, Any]:
    """Telemetry of an arm that goes straight from point to point, a motion from each to the next."""
    times = np.arange(0.0, ways[-1][0] + 1e-9, ROW)
    knots = np.array([when for when, _ in ways])
    tool = [np.interp(times, knots, [point[k] for _, point in ways]).round(6).tolist() for k in range(3)]
    motion = np.minimum(np.searchsorted(knots, times, side="right"), len(ways) - 1)
    started = knots[motion - 1]
    zeros, three = [0.0] * len(times), [[0.0] * len(times)] * 3
    return {
        "t": times.round(4).tolist(), "tool": tool, "reference": tool, "velocity": three,
        "angles": [[0.2] * len(times)] * 3, "finger": [0.01] * len(times), "tactile": [zeros, zeros], "force": three,
        "torque": three, "state": ["track"] * len(times), "word": ["moves"] * len(times), "motion": motion.tolist(),
        "executed": ((times - started) / 0.00088).round().astype(int).tolist(), "late": zeros, "work": zeros,
        "stopped": [False] * len(times),
    }  # fmt: skip
