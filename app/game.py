"""The game loop: choose, plan, execute, look, judge, record, until the game is over."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import chess
import cv2

from app import UserError
from app.arm import Arm, ArmHeld, ArmPaused, ArmState, Outcome
from app.faces import Face
from app.hand_guard import HandGuard
from app.judging import Verdict, judge
from app.manipulation import Inventory, Ply, Stage, transfers
from app.motion import Motion, MotionSettings, plan_ply, plan_return
from app.players import Players
from app.records import GameRecord, PlyOutcome, StepEvent, recording
from app.records.events import Result
from app.recovery import FELT, Progress, progress_of
from controller.errors import ControllerError
from hardware.interfaces import Camera, Clock, Frame, HardwareError
from hardware.parameters import RobotParameters
from hardware.sim.referee import Referee

MOST_PAUSES = 20
"""Within one ply; a computer that is late so often will not get better by itself."""
FRAME_AGE = 10.0
"""The picture of a ply is no older than this: exposed with the arm at home, but drawn slowly by a busy machine [s]."""


@dataclass(frozen=True, slots=True)
class Devices:
    """What a game runs on; camera, referee and who watches for hands may be missing."""

    arm: Arm
    clock: Clock
    camera: Camera | None
    referee: Referee | None
    guard: HandGuard | None = None


@dataclass(frozen=True, slots=True)
class Position:
    """Where a game stands: the board with its moves, what stands where, whether another program has begun it, and
    what that had begun of the next ply.
    """

    board: chess.Board
    inventory: Inventory
    begun: bool = False
    unfinished: StepEvent | None = None


@dataclass(frozen=True, slots=True)
class GameEnd:
    """Why the loop ended: PGN result, phrase, and whether all that was asked was done."""

    result: Result
    reason: str
    complete: bool


class _Moved(NamedTuple):
    """What moving pieces came to: duration planned for its last part [s], that part, whether there was one before."""

    planned: float
    done: Outcome
    resumed: bool


class Game:
    """One game on one rig."""

    def __init__(
        self,
        position: Position,
        players: Players,
        devices: Devices,
        record: GameRecord,
        face: Face,
        motion: MotionSettings,
        parameters: RobotParameters,
    ) -> None:
        self._board = position.board
        self._inventory = position.inventory
        self._position = position
        self._players = players
        self._devices = devices
        self._record = record
        self._face = face
        self._motion = motion
        self._parameters = parameters
        self._step: tuple[int, Stage] | None = None
        self._most = 0
        self.thinking = 0.0
        """Wall time that the arm rested because a player thought [s]."""

    def play(self, plies: int) -> GameEnd:
        """Play until the game is over, a player has no more moves, or so many plies are done.

        A ply that fails physically ends the game; what went wrong is in the record.
        """
        self._face.position(self._board)
        self._most = plies
        if not self._take_up():
            return WRONG
        for done in range(len(self._board.move_stack), plies + 1):
            outcome = self._board.outcome(claim_draw=True)
            if outcome is not None:
                return GameEnd(_result(outcome), outcome.termination.name.lower().replace("_", " "), True)
            if done == plies:
                break
            move = self._choose()
            if move is None:
                return GameEnd("*", "end of the given line", True)
            if not self._execute(move):
                return WRONG
        return GameEnd("*", f"{plies} plies played", True)

    def _take_up(self) -> bool:
        """Finish what another program has begun. False as of ``_execute``."""
        position = self._position
        if position.begun:
            self._record.resumed(self._devices.clock.now())
        elif self._devices.arm.state().felt >= FELT:
            raise UserError(
                "something is between the fingers: take it out by hand, or go on with its game by 'touchmove resume'"
            )
        return position.unfinished is None or self._finish(position.unfinished)

    def _choose(self) -> chess.Move | None:
        turn = self._board.turn
        self._face.phase(f"{'White' if turn else 'Black'} thinks ({self._players.name(turn)})")
        since = time.perf_counter()
        decision = self._players.choose(self._board)
        self.thinking += time.perf_counter() - since
        return decision.move

    def _execute(self, move: chess.Move) -> bool:
        """One ply: all of it, home to home, then a look at the board. False when the board came out wrong."""
        ply = transfers(self._board, move, self._inventory)
        if self._devices.referee is not None:
            self._devices.referee.look(reset_peak=True)
        return self._conclude(move, ply, self._move_pieces(ply, self._devices.arm.state(), None))

    def _finish(self, step: StepEvent) -> bool:
        """A ply that was broken off: what is left of it, from wherever the arm is. False as of ``_execute``."""
        move = chess.Move.from_uci(step.uci)
        ply = transfers(self._board, move, self._inventory)
        state = self._devices.arm.state()
        progress = self._progress(ply, step.transfer, step.stage, state)
        self._face.phase(_explain(ply, progress))
        return self._conclude(move, ply, self._move_pieces(ply, state, progress))

    def _conclude(self, move: chess.Move, ply: Ply, moved: _Moved) -> bool:
        """After the pieces were moved: look, judge, record."""
        planned, done, resumed = moved
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
            resumed=resumed,
        )
        event = self._record.ply(ply, outcome, self._devices.clock.now())
        self._face.ply(event, self._board)
        return verdict is None or verdict.ok

    def _move_pieces(self, ply: Ply, state: ArmState, broken_off: Progress | None) -> _Moved:
        """All transfers of a ply, or what is left of one that was broken off.

        Where the arm had to stop because samples came too late, it goes on from where it is; a busy computer may cost
        time, but no game. Nor does a hand over the board: the arm holds until it is gone.
        """
        pauses, self._step = 0, None
        while True:
            try:
                self._interlock()
                planned, done = self._move_rest(ply, state, broken_off)
                return _Moved(planned, done, broken_off is not None)
            except ArmHeld as held:
                if self._devices.guard is None:
                    raise
                self._face.phase(f"waiting for the board to be clear: {held}")
            except ArmPaused as pause:
                pauses += 1
                if pauses > MOST_PAUSES or self._step is None:
                    raise
                self._face.phase(f"going on after a pause: {pause}")
            state = self._devices.arm.settle()
            if self._step is not None:
                broken_off = self._progress(ply, *self._step, state)

    def _interlock(self) -> None:
        """No motion over the board while a hand is there."""
        if self._devices.guard is not None:
            self._devices.guard.clear()

    def _progress(self, ply: Ply, transfer: int, stage: Stage, state: ArmState) -> Progress:
        return progress_of(ply, transfer, stage, state, self._inventory.table)

    def _move_rest(self, ply: Ply, state: ArmState, broken_off: Progress | None) -> tuple[float, Outcome]:
        arm, parameters, inventory = self._devices.arm, self._parameters, self._inventory
        done = 0 if broken_off is None else broken_off.done
        for transfer in ply.transfers[:done]:
            inventory = inventory.moved(transfer)
        if rest := ply.transfers[done:]:
            plan = plan_ply(
                ply.san, rest, inventory, state.reference, state.finger, self._motion, parameters, arm.lead_ticks,
                holding=broken_off is not None and broken_off.holding, low=broken_off is not None,
            )  # fmt: skip
        else:
            kind, table = ply.transfers[-1].kind, inventory.table
            plan = plan_return(state.reference, state.finger, self._motion, parameters, table, release=kind)
        return plan.expected, arm.execute(plan, lambda motion: self._note(ply, motion, done))

    def _note(self, ply: Ply, motion: Motion, done: int) -> None:
        """Record what the arm begins, so that another program can finish it."""
        if motion.transfer is not None and motion.stage is not None:
            self._step = done + motion.transfer, motion.stage
            self._record.step(ply.uci, *self._step, self._devices.clock.now())
            if self._step == (len(ply.transfers) - 1, Stage.RELEASE):
                self._think_ahead(chess.Move.from_uci(ply.uci))

    def _think_ahead(self, move: chess.Move) -> None:
        """While the arm lets go of the last piece and goes home, the next player thinks already."""
        board = self._board.copy()
        board.push(move)
        if len(board.move_stack) < self._most and board.outcome(claim_draw=True) is None:
            self._players.begin(board)

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


def _explain(ply: Ply, progress: Progress) -> str:
    if progress.done == len(ply.transfers):
        return f"{ply.san} was all but done: the arm goes home"
    piece = ply.transfers[progress.done]
    where = "is in the fingers" if progress.holding else f"stands on {piece.source}"
    return f"going on with {ply.san}: the {piece.kind} for {piece.target} {where}"


def _moved(verdict: Verdict | None, ply: Ply) -> dict[str, float] | None:
    if verdict is None:
        return None
    return {name: 1e3 * verdict.errors[name] for name in ply.changes() if name in verdict.errors}


def _result(outcome: chess.Outcome) -> Result:
    if outcome.winner is None:
        return "1/2-1/2"
    return "1-0" if outcome.winner else "0-1"


WRONG = GameEnd("*", "the board is not as the game says", False)
EXPECTED_FAILURES = (UserError, ControllerError, HardwareError)
"""What may go wrong in a running game without a bug: each says in one sentence what and what to do."""
