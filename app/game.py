"""The game loop: choose, plan, execute, look, judge, record, until the game is over."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import chess
import cv2

from app import UserError
from app.arm import Arm, Outcome
from app.faces import Face
from app.judging import Verdict, judge
from app.manipulation import Inventory, Ply, transfers
from app.motion import MotionSettings, plan_ply
from app.players import Player
from app.records import GameRecord, PlyOutcome, recording
from app.records.events import Result
from controller.errors import ControllerError
from hardware.interfaces import Camera, Clock, Frame, HardwareError
from hardware.parameters import RobotParameters
from hardware.sim.referee import Referee

FRAME_AGE = 10.0
"""The picture of a ply is no older than this: exposed with the arm at home, but drawn slowly by a busy machine [s]."""


@dataclass(frozen=True, slots=True)
class Devices:
    """What a game runs on; camera and referee may be missing."""

    arm: Arm
    clock: Clock
    camera: Camera | None
    referee: Referee | None


@dataclass(frozen=True, slots=True)
class GameEnd:
    """Why the loop ended: PGN result, phrase, and whether all that was asked was done."""

    result: Result
    reason: str
    complete: bool


class Game:
    """One game on one rig."""

    def __init__(
        self,
        board: chess.Board,
        inventory: Inventory,
        players: Mapping[chess.Color, Player],
        devices: Devices,
        record: GameRecord,
        face: Face,
        motion: MotionSettings,
        parameters: RobotParameters,
    ) -> None:
        self._board = board
        self._inventory = inventory
        self._players = players
        self._devices = devices
        self._record = record
        self._face = face
        self._motion = motion
        self._parameters = parameters
        self.thinking = 0.0
        """Wall time spent by the players [s]."""

    def play(self, plies: int) -> GameEnd:
        """Play until the game is over, a player has no more moves, or so many plies are done.

        A ply that fails physically ends the game; what went wrong is in the record.
        """
        self._face.position(self._board)
        for done in range(plies + 1):
            outcome = self._board.outcome(claim_draw=True)
            if outcome is not None:
                return GameEnd(_result(outcome), outcome.termination.name.lower().replace("_", " "), True)
            if done == plies:
                break
            move = self._choose()
            if move is None:
                return GameEnd("*", "end of the given line", True)
            if not self._execute(move):
                return GameEnd("*", "the board is not as the game says", False)
        return GameEnd("*", f"{plies} plies played", True)

    def _choose(self) -> chess.Move | None:
        player = self._players[self._board.turn]
        self._face.phase(f"{'White' if self._board.turn else 'Black'} thinks ({player.name})")
        since = time.perf_counter()
        decision = player.choose(self._board)
        self.thinking += time.perf_counter() - since
        return decision.move

    def _execute(self, move: chess.Move) -> bool:
        """One ply: all of it, home to home, then a look at the board. False when the board came out wrong."""
        ply = transfers(self._board, move, self._inventory)
        if self._devices.referee is not None:
            self._devices.referee.look(reset_peak=True)
        planned, done = self._move_pieces(ply)
        self._board.push(move)
        self._inventory = self._inventory.after(ply)
        self._inventory.check_against(self._board)
        frame = self._look()
        verdict, force = self._judge()
        outcome = PlyOutcome(
            planned=planned,
            real=done.duration,
            peak_torque=done.peak_torque,
            placement_mm=_moved(verdict, ply),
            peak_force=done.peak_force if force is None else max(force, done.peak_force),
            physical_ok=None if verdict is None else verdict.ok,
            frame=self._keep(frame),
            failures=() if verdict is None else verdict.failures,
        )
        event = self._record.ply(ply, outcome, self._devices.clock.now())
        self._face.ply(event, self._board)
        return verdict is None or verdict.ok

    def _move_pieces(self, ply: Ply) -> tuple[float, Outcome]:
        arm = self._devices.arm
        state = arm.state()
        plan = plan_ply(
            ply.san, ply.transfers, self._inventory, state.reference, state.finger, self._motion, self._parameters,
            arm.lead_ticks,
        )  # fmt: skip
        return plan.expected, arm.execute(plan)

    def _look(self) -> Frame | None:
        if self._devices.camera is None:
            return None
        self._devices.arm.state()  # in pace fast: once plant time stands, so that the exposure's tick is decided
        return self._devices.camera.read(FRAME_AGE)

    def _judge(self) -> tuple[Verdict | None, float | None]:
        if self._devices.referee is None:
            return None, None
        self._devices.arm.state()
        truth, _ = self._devices.referee.look()
        return judge(truth, self._inventory), truth.peak_contact_force

    def _keep(self, frame: Frame | None) -> str | None:
        if frame is None:
            return None
        name = f"frames/ply-{len(self._board.move_stack):03d}.jpg"
        save_picture(self._record.folder / name, frame)
        return name


def save_picture(path: Path, frame: Frame) -> None:
    """Write a frame's colours as JPEG.

    Raises:
        RecordError: it cannot be written.
    """
    done, encoded = cv2.imencode(".jpg", cv2.cvtColor(frame.colour, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 88])
    if not done:
        raise RuntimeError(f"OpenCV could not encode {path.name}")
    with recording(path):
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(encoded.tobytes())


def _moved(verdict: Verdict | None, ply: Ply) -> dict[str, float] | None:
    if verdict is None:
        return None
    return {name: 1e3 * verdict.errors[name] for name in ply.changes() if name in verdict.errors}


def _result(outcome: chess.Outcome) -> Result:
    if outcome.winner is None:
        return "1/2-1/2"
    return "1-0" if outcome.winner else "0-1"


EXPECTED_FAILURES = (UserError, ControllerError, HardwareError)
"""What may go wrong in a running game without a bug: each says in one sentence what and what to do."""
