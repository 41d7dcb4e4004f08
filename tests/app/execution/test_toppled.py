"""A piece that a hand has knocked over is noticed, and what lies on another square is no move."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, cast

import chess
import pytest

from app.execution.observation import GameObserver
from app.execution.state import Devices
from app.measure.bench.vision.actions import ClumsyHands
from app.measure.bench.vision.games import Scene, open_studio, random_game
from app.pieces.inventory import Inventory
from app.pieces.layout import start_layout
from app.pieces.manipulation import transfers
from app.rig.simulation.nominal_view import nominal_view
from hardware.interfaces import Frame
from hardware.sim.process.table_studio import TableStudio
from hardware.table import TableSettings
from vision.pieces.verify import FaultKind
from vision.reading.outcome import ReadingOutcome

TABLE = TableSettings()


class Still:
    """Camera, arm and clock of a table that is photographed; all stand still."""

    def __init__(self, frame: Frame) -> None:
        self.shown = frame

    def read(self, max_age: float) -> Frame:
        return self.shown

    def state(self) -> None:
        return None

    def now(self) -> float:
        return self.shown.stamp

    def sleep(self, duration: float) -> None:
        raise AssertionError("every picture is new")


@pytest.fixture(scope="module")
def studio() -> Iterator[TableStudio]:
    with open_studio(TABLE) as opened:
        yield opened


def table_after(
    studio: TableStudio, seed: int, plies: int
) -> tuple[chess.Board, Inventory, GameObserver, Still, Scene]:
    """A position of a random game, followed by a camera; it is White's turn."""
    scene, board = Scene(studio, TABLE, seed), chess.Board()
    for move in random_game(seed, plies):
        board.push(move)
    still = Still(scene.picture(board))
    devices = Devices(*(cast(Any, still) for _ in range(3)), None)
    observer = GameObserver(devices, TABLE, lambda intrinsics: nominal_view(intrinsics, TABLE))
    observer.begin(board)
    return board, Inventory.of(start_layout(board, TABLE), TABLE), observer, still, scene


@pytest.mark.parametrize("seed", [4100, 4101, 4102])
def test_a_knocked_piece_is_a_fault_and_a_legal_move_none(studio: TableStudio, seed: int) -> None:
    board, stands, observer, still, scene = table_after(studio, seed, 2 * (seed % 9))
    observer.read()
    assert observer.faults(stands, centres=False) == ()
    move = scene.rng.choice(list(board.legal_moves))
    after = board.copy()
    after.push(move)
    still.shown = scene.picture(after)
    reading = observer.read()
    assert (reading.decision.verdict, reading.decision.moves) == (ReadingOutcome.MOVE, (move,))
    ply = transfers(board, move, stands)
    assert observer.faults(stands.after(ply), centres=False) == (), "what was moved stands"
    hands = ClumsyHands(scene.table, TABLE, after, scene.rng)
    hands.knock(move.to_square)
    still.shown = scene.photograph(hands.poses)
    observer.read()
    kinds = {fault.kind for fault in observer.faults(stands.after(ply), centres=False)}
    assert kinds & {FaultKind.FALLEN, FaultKind.MISSING, FaultKind.FOREIGN}
