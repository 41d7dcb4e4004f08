"""STOP at any moment of real motions: the arm rests soon, and after 'go' all goes on as if nothing had been."""

from __future__ import annotations

import random
import threading
from pathlib import Path

import chess
import numpy as np
import pytest

from app.execution.carrier import Carrier
from app.execution.pauses import WENT_ON
from app.execution.state import Devices, Position
from app.execution.table import Table
from app.game import Game
from app.motion import MotionSettings
from app.pieces.inventory import Inventory
from app.pieces.layout import start_layout
from app.players.players import LinePlayer, Players
from app.records import GameRecord, GameSetup, PlyEvent, read_events
from app.records.events import TroubleEvent
from app.rig.rig_file import WorldSection
from app.rig.simulation.settings import own_rig
from app.rig.simulation.sim import SimRig
from app.terminal.game_display import UserInterface
from controller.protocol.messages import Telemetry
from controller.protocol.states import State
from controller.wire.address import find_controller
from controller.wire.listener import TelemetryWatch
from hardware.interfaces import Pace
from hardware.parameters import load_parameters
from hardware.table import TableSettings

TABLE, PARAMETERS, MOTION = TableSettings(), load_parameters(), MotionSettings()
TICK = PARAMETERS.drive.tick
STOPS, SEED = 25, 20
REST = 0.3
"""After STOP the arm rests within this [s, plant]."""
RESTING, FULL = 0.005, 0.05
"""A tool slower than the first is at rest, faster than the second in full motion [m/s]."""
HELD = 0.5
"""Fingers that both feel more than this hold a piece [N]."""
LINE = "e4 d5 exd5 Nf6 Bb5+ c6 dxc6 bxc6 Nf3 e5 O-O"
"""Quiet moves, captures and a castling."""


class Presser:
    """Presses STOP at random moments while the arm moves, as a listener does; and says 'go' each time.

    Of every three, one is at any moment, one in full motion and one with a piece in the fingers: the first moment of
    that kind after a random pause. It is called with the telemetry in the link's own thread. Until a STOP was carried
    out the client hears no more: so plant time, which waits for its samples, goes on by no more than those that were
    sent ahead, however slow this machine is.
    """

    def __init__(self) -> None:
        self.watch: TelemetryWatch | None = None
        self.rests = list[float]()
        self.moments = list[tuple[float, float]]()
        self._random = random.Random(SEED)
        self._next = 0
        self._pressed: int | None = None
        self._quiet = threading.Event()

    def take(self, telemetry: Telemetry) -> None:
        """The telemetry, in order."""
        if self._pressed is not None and telemetry.latched and _rests(telemetry):
            self.rests.append((telemetry.tick - self._pressed) * TICK)
            self._pressed = None
            self._next = telemetry.tick + self._random.randrange(1, round(0.9 / TICK))
            self._quiet.set()
        due = self.watch is not None and len(self.rests) < STOPS and self._pressed is None and not telemetry.latched
        speed, felt = float(np.linalg.norm(telemetry.velocity)), min(telemetry.tactile)
        wanted = (True, speed > FULL, felt > HELD)[len(self.rests) % 3]
        if due and wanted and telemetry.tick >= self._next and telemetry.state is State.TRACK:
            assert self.watch is not None
            self._pressed = telemetry.tick
            self.moments.append((speed, felt))
            self._quiet.clear()
            assert self.watch.stop(60.0).latched

    def wait_for_go(self, sentence: str) -> None:
        """``Attendant``: once the arm rests."""
        assert "somebody pressed STOP" in sentence
        assert self._quiet.wait(60.0), "the arm does not come to rest"


def _rests(telemetry: Telemetry) -> bool:
    return telemetry.state is State.HOLD and float(np.linalg.norm(telemetry.velocity)) < RESTING


@pytest.mark.slow
def test_stops_in_a_game_cost_time_and_nothing_else(tmp_path: Path) -> None:
    board = chess.Board()
    inventory = Inventory.of(start_layout(board, TABLE), TABLE)
    presser, world = Presser(), WorldSection(pace=Pace.FAST, cameras=False, linger=5.0)
    player = LinePlayer(board, moves := _moves(board))
    record = GameRecord.begin(tmp_path / "game", GameSetup("a", "b", SEED, "fast"), board, inventory, 0.0)
    ui = UserInterface()
    with SimRig(own_rig(tmp_path / "run", world), ui.phase, presser.take) as rig, record:
        with TelemetryWatch(*find_controller(tmp_path / "run")) as watch, Players(player, player) as players:
            presser.watch = watch
            devices = Devices(rig.arm, rig.clock, None, rig.referee)
            carrier = Carrier(devices, record, ui, MOTION, PARAMETERS, presser)
            end = Game(Table(Position(board, inventory), devices, carrier, None, record, ui), players, ui).play(99)
        state = rig.arm.state()
    assert (end.result, end.reason) == ("*", "end of the given line")
    events = read_events(tmp_path / "game" / "events.jsonl")
    plies = [event for event in events if isinstance(event, PlyEvent)]
    assert [ply.uci for ply in plies] == [move.uci() for move in moves]
    assert [ply.physical_ok for ply in plies] == [True] * len(moves)
    assert not any(ply.failures for ply in plies)
    np.testing.assert_allclose(state.reference, MOTION.home, atol=1e-6)
    troubles = [event for event in events if isinstance(event, TroubleEvent)]
    assert [(one.kind, one.sentence) for one in troubles] == [("stopped", WENT_ON)] * len(troubles)
    placed = max(error for ply in plies for error in (ply.placement_mm or {}).values())
    moving = sum(speed > FULL for speed, _ in presser.moments)
    holding = sum(felt > HELD for _, felt in presser.moments)
    soon, late = np.median(presser.rests), max(presser.rests)
    print(f"{len(presser.rests)} stops, {moving} of them in full motion, {holding} with a piece in the fingers")
    print(f"at rest after {soon:.3f} s, at most {late:.3f} s; pieces within {placed:.2f} mm")
    assert len(presser.rests) == STOPS
    assert late < REST
    assert moving >= STOPS // 3
    assert holding >= STOPS // 3


def _moves(board: chess.Board) -> list[chess.Move]:
    walk, moves = board.copy(), list[chess.Move]()
    for san in LINE.split():
        moves.append(walk.push_san(san))
    return moves
