"""The board and its pieces while a game is on: what the arm or a hand does to them, seen, put right, judged, recorded.

The position advances only when the board shows it. After whatever the arm has done the camera looks; what is not as it
should be is put right first, by the arm where it can, else by a person who is asked.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import chess
import chess.engine

from app import UserError
from app.execution.carrier import Carrier
from app.execution.interruption import Begun, BoardTouched, CarryFailed, goal_of
from app.execution.state import FRAME_AGE, NO_REMARK, AwaitedReply, Devices, Job, JobDone, Position, Remark, changed
from app.pieces.inventory import Inventory, Ply, Stage
from app.pieces.judging import Verdict, judge
from app.pieces.layout import colour_of
from app.pieces.manipulation import move_kind, transfers
from app.pieces.position import set_up
from app.records import GameRecord, PlyOutcome
from app.records.events import Purpose
from app.records.history import Unfinished, transfer_of
from app.terminal.game_display import UserInterface
from hardware.interfaces import Frame
from hardware.table import Place

if TYPE_CHECKING:
    from app.execution.observation import GameObserver
    from app.execution.recovery import Recovery
    from app.guard.game_guard import GameGuard
    from vision.pieces.lying_or_standing import MisplacedPiece
    from vision.pieces.placement_faults import Fault
    from vision.reading.diagnosis import Diagnosis


class Table:
    """Board and pieces of one game.

    Args:
        position: where it stands.
        devices: of the rig.
        carrier: carries pieces.
        recovery: looks, and puts right what is not as it should be; None: nobody looks, and what fails ends the game.
        record: of the game.
        ui: shown what happens.

    Attributes:
        board: the position, with its moves.
        inventory: what stands where.
        permission: of the arm to move.
    """

    def __init__(
        self,
        position: Position,
        devices: Devices,
        carrier: Carrier,
        recovery: Recovery | None,
        record: GameRecord,
        ui: UserInterface,
    ) -> None:
        self.board, self.inventory = position.board, position.inventory
        self._unfinished, self._begun = position.unfinished, position.begun
        self._unwatched: frozenset[chess.Color] = frozenset()
        """A person plays these colours, and may have moved while nobody looked."""
        self.replied = False
        """The person at the board has made the next move already, while nobody looked."""
        self._devices, self._carrier, self._recovery = devices, carrier, recovery
        self.permission = carrier.permission
        self._record, self._ui = record, ui

    @property
    def observer(self) -> GameObserver | None:
        """That follow the game; None: nobody looks."""
        return None if self._recovery is None else self._recovery.observer

    def subscribe(self, listener: Callable[[str], None]) -> None:
        """As of ``Carrier.subscribe``."""
        self._carrier.subscribe(listener)

    @property
    def guard(self) -> GameGuard | None:
        """Against hands; None: nobody watches."""
        return self._devices.guard

    def be_ready(self) -> None:
        """As ``Carrier.be_ready``."""
        self._carrier.be_ready(self.inventory)

    def now(self) -> float:
        """Plant time [s]."""
        return self._devices.clock.now()

    def arm_ply(self, move: chess.Move, remark: Remark = NO_REMARK, answers: bool = False) -> bool:
        """The arm makes a move, home to home; then a look at the board; and one before, if the last one was long ago.

        ``answers``: a person moves next, by themselves, and may do so before the arm has gone home.

        Returns:
            False when the board came out wrong, by the referee's word.

        Raises:
            UserError: it cannot be done, or not without a person, and there is none.
        """
        if not self._look_again():
            return False
        ply = transfers(self.board, move, self.inventory)
        return self._do_ply(ply, None, remark, answers=answers)

    def hand_ply(self, move: chess.Move, remark: Remark = NO_REMARK, answers: bool = False) -> bool:
        """A move was made by hand, and seen or told; what stands badly since is put right. As ``arm_ply``."""
        ply = transfers(self.board, move, self.inventory)
        outcome = PlyOutcome(by="hand", score=remark.score, clocks=remark.clocks(), comment=remark.comment)
        done = self._conclude_ply(ply, self.inventory.after(ply), outcome)
        return done and self.repair(AwaitedReply(self.board.copy()) if answers else None)

    def take_back(self, plies: int) -> bool:
        """The arm takes the last plies back; False as of ``arm_ply``.

        Raises:
            UserError: it cannot be done, for instance as a piece lies in a box.
        """
        if not self._look_again():
            return False
        before = self.board.copy()
        moves = [before.pop() for _ in range(plies)]
        label = "take back " + before.variation_san(reversed(moves))
        moved = set_up(self.inventory, before)
        self._record.task(Purpose.TAKE_BACK, label, moved, self.now(), taken_back=plies)
        return self._do_task(Job(label, moved), None, before)

    def set_up(self, board: chess.Board) -> bool:
        """The arm sets up any position with the pieces there; False as of ``arm_ply``.

        Raises:
            UserError: the pieces there cannot show it; or as ``arm_ply``.
        """
        if not self._look_again():
            return False
        moved = set_up(self.inventory, board)
        label = "set the pieces up"
        self._record.task(Purpose.SET_UP, label, moved, self.now(), fen=board.fen())
        return self._do_task(Job(label, moved), None, board)

    def repair(self, reply: AwaitedReply | None = None) -> bool:
        """The board is looked at, and put right where it is not as the game says; False as of ``arm_ply``, reply as of
        ``Recovery.mend``.
        """
        if self._recovery is None:
            return True
        recovered = self._recovery.mend(self.inventory, self.inventory, self.board, reply)
        self.replied = recovered.answered
        if not recovered.jobs and self._record.unfinished is None:
            return True
        outcome = PlyOutcome(real=recovered.duration or None)
        return self._conclude_task(recovered.inventory, outcome, self.board, answered=recovered.answered)

    def disturbed(self, *, centres: bool) -> tuple[Fault, ...]:
        """What the newest frame shows to be wrong although the position is the same; as ``GameObserver.faults``."""
        beyond = 0.0 if centres else math.inf
        return () if self.observer is None else self.observer.faults(self.inventory, beyond=beyond)

    def fallen(self) -> list[MisplacedPiece]:
        """Pieces that lie on the board, in the newest frame, as far as depth shows them."""
        if self.observer is None or not self.observer.deep:
            return []
        return [one for one in self.observer.misplaced(self.inventory) if one.lies]

    def _look_again(self) -> bool:
        """Before the arm moves, if the last look was long ago; False as of ``arm_ply``."""
        return self._recovery is None or not self._recovery.stale or self.repair()

    def note(self, finding: Diagnosis) -> None:
        """Something that is no legal move was seen: that is in the record, whatever comes of it."""
        squares = [chess.square_name(square) for square in finding.squares]
        self._record.trouble(finding.situation.value, squares, finding.sentence, None, self.now())

    def note_faults(self, faults: Sequence[Fault]) -> None:
        """Something was disturbed by hand: in the record as ``note``."""
        for fault in faults:
            self._record.trouble(fault.kind.value, (chess.square_name(fault.square),), fault.sentence, None, self.now())

    def note_sides(self, person: chess.Color) -> None:
        """The person at the board plays this colour from now on."""
        self._record.sides_changed(colour_of(person), self.now())

    def begin(self, by_hand: frozenset[chess.Color] = frozenset()) -> bool:
        """First of all: what another program has begun and not finished is finished, and whether the board is as its
        record says is looked at; False as of ``arm_ply``.

        A person plays the colours ``by_hand``, and may have moved while nobody looked.
        """
        if not self._begun:
            if self.observer is not None:
                self.observer.begin(self.board)
                self.observer.remember(self.inventory)
            self._picture(self._look(learns=False))
            return True
        self._unwatched = by_hand
        well = self._finish() and self.repair(self._left_with(self.board))
        self._unwatched = frozenset()
        if self.observer is not None and not self.replied:
            self.observer.confirm(self.board)
        return well

    def finish(self) -> bool:
        """The arm does a job to its end that it was stopped in and nobody goes on with; False as of ``arm_ply``."""
        if not self._carrier.midway:
            self._carrier.bring_home(self.inventory)  # it may have been stopped where it stood a piece up
            return True
        self._ui.say("the arm first finishes what it has begun")
        self._unfinished, self.inventory = self._record.unfinished, self._record.stands(self.inventory)
        return self._finish()

    def give_up(self, reason: str) -> bool:
        """The game goes on where it stood, whatever was begun; what was moved for that is put back by the next repair.

        Returns:
            False where it cannot: there may be a piece in the fingers.
        """
        if self._carrier.midway:
            return False
        unfinished = self._record.unfinished
        if unfinished is not None and (unfinished.uci, unfinished.task) != (None, None):
            self._record.task_dropped(reason, self.now())
            if unfinished.touched:
                self._record.found(self._record.stands(self.inventory), reason, self.now())
        return True

    def _left_with(self, position: chess.Board) -> AwaitedReply | None:
        """The reply to a position that was reached before anybody looked again."""
        return AwaitedReply(position) if position.turn in self._unwatched else None

    def _finish(self) -> bool:
        unfinished, self._unfinished = self._unfinished, None
        begun = None
        if unfinished is not None and unfinished.transfer is not None and unfinished.stage is not None:
            begun = Begun(unfinished.transfer, unfinished.stage)
        if begun is None:  # it may have been left where it stood a piece up, or pushed one
            self._carrier.bring_home(self.inventory)
        if unfinished is None:
            return True
        if unfinished.repair is not None:
            return self._finish_repair(unfinished, begun)
        if unfinished.uci is not None:
            ply = transfers(self.board, chess.Move.from_uci(unfinished.uci), self.inventory)
            return self._do_ply(ply, begun, NO_REMARK)
        assert unfinished.task is not None
        job = Job(unfinished.task.label, tuple(transfer_of(one) for one in unfinished.task.transfers))
        return self._do_task(job, begun, goal_of(self.board, unfinished))

    # jobs

    def _do_ply(self, ply: Ply, begun: Begun | None, remark: Remark, *, answers: bool = False) -> bool:
        self._reset_peak()
        wanted, after = self.inventory.after(ply), self.board.copy()
        after.push_uci(ply.uci)
        reply = self._left_with(after)
        if reply is None and answers:
            reply = AwaitedReply(after, None if self.guard is None else self.guard.hands)
        job = Job(ply.san, ply.transfers, uci=ply.uci)
        carried = self._carry(job, wanted, begun, reply)
        outcome = replace(carried.outcome, score=remark.score, clocks=remark.clocks(), comment=remark.comment)
        return self._conclude_ply(ply, carried.inventory, outcome, answered=carried.answered)

    def _do_task(self, job: Job, begun: Begun | None, board: chess.Board) -> bool:
        """Carry out a task that is in the record already, after which a position stands on the board."""
        self._reset_peak()
        try:
            wanted = self.inventory.after_all(job.transfers)
            carried = self._carry(job, wanted, begun, self._left_with(board))
        except UserError as error:
            unfinished = self._record.unfinished
            if self._carrier.untouched and unfinished is not None and not unfinished.touched:
                self._record.task_dropped(str(error), self.now())
            raise
        return self._conclude_task(carried.inventory, carried.outcome, board, answered=carried.answered)

    def _finish_repair(self, unfinished: Unfinished, begun: Begun | None) -> bool:
        """First the repair that was under way, then what it was for."""
        assert unfinished.repair is not None
        if self._recovery is not None:
            self._recovery.doubt(unfinished.found)
        goal = goal_of(self.board, unfinished)
        # one that was not begun is thought over: what it was planned around, or refused for, only a look can tell
        repair = unfinished.repair if begun is not None or self._recovery is None else ()
        wanted = self.inventory.after_all(repair)
        reply = self._left_with(goal) if not set_up(wanted, goal) else None
        carried = self._carry(Job("put the board right", repair), wanted, begun, reply)
        rest = () if carried.answered else set_up(carried.inventory, goal)
        stands = self.inventory
        self.inventory = carried.inventory
        if rest:
            self._record.found(carried.inventory, "a repair was interrupted", self.now())
            self._record.task(Purpose.REPAIR, "put the board right", rest, self.now())
            wanted = self.inventory.after_all(rest)
            carried = self._carry(Job("put the board right", rest), wanted, None, self._left_with(goal))
        outcome = replace(carried.outcome, resumed=True)
        self.inventory = stands
        if unfinished.uci is None:
            return self._conclude_task(carried.inventory, outcome, goal, answered=carried.answered)
        move = chess.Move.from_uci(unfinished.uci)
        kind, mover = move_kind(self.board, move), colour_of(self.board.turn)
        ply = Ply(self.board.san(move), self.board.uci(move), kind, mover, (*repair, *rest))
        return self._conclude_ply(ply, carried.inventory, outcome, answered=carried.answered)

    def _carry(self, job: Job, wanted: Inventory, begun: Begun | None, reply: AwaitedReply | None) -> JobDone:
        """Do a job, and mend what came of it, until the board shows what it should, or a person's answer to it."""
        outcome, stands = PlyOutcome(real=None if job.transfers else 0.0), wanted
        if job.transfers:
            try:
                seen = None if self.observer is None else self.observer.seen
                outcome = self._carrier.carry(job, self.inventory, begun, seen).outcome
            except BoardTouched:
                if job.uci is not None:  # whoever goes on with the record knows what the arm carries then
                    self._record.step(job.uci, 0, Stage.APPROACH, self.now(), durable=True)
                stands = self.inventory  # as far as is known: recovery looks first, then carries
            except CarryFailed as failure:
                if self._recovery is None:
                    raise UserError(str(failure)) from failure
                stands, outcome = failure.inventory, replace(outcome, mended=True)
                self._recovery.note_loss(failure)
        if self._recovery is None:
            return JobDone(wanted, outcome)
        recovered = self._recovery.mend(stands, wanted, reply=reply)
        if recovered.jobs:
            outcome = replace(outcome, planned=None, real=None, mended=True)
        return JobDone(recovered.inventory, outcome, recovered.answered)

    # after a job

    def _conclude_ply(self, ply: Ply, inventory: Inventory, outcome: PlyOutcome, *, answered: bool = False) -> bool:
        """The pieces were moved: judge, record, show. Where the next move is made already, the board shows that."""
        places = changed(self.inventory, inventory)
        self.board.push_uci(ply.uci)
        self.inventory = inventory
        self.inventory.check_against(self.board)
        frame = self._look(learns=not answered)
        outcome, verdict = (outcome, None) if answered else self._judged(outcome, places)
        outcome = replace(outcome, frame=self._picture(frame))
        event = self._record.ply(ply, outcome, self.now(), inventory)
        self._ui.ply(event, self.board)
        return verdict is None or verdict.ok

    def _conclude_task(
        self, inventory: Inventory, outcome: PlyOutcome, board: chess.Board, *, answered: bool = False
    ) -> bool:
        """The same of a task."""
        places = changed(self.inventory, inventory)
        self.board, self.inventory = board, inventory
        self.inventory.check_against(board)
        self._look(learns=not answered)
        outcome, verdict = (outcome, None) if answered else self._judged(outcome, places)
        self._record.task_done(inventory, outcome, self.now())
        self._ui.position(self.board)
        return verdict is None or verdict.ok

    def _look(self, *, learns: bool = True) -> Frame | None:
        """The picture of the position; an observer that follows the game has looked already, and learns from it."""
        if self.observer is not None:
            if learns:
                self.observer.confirm(self.board)
            return self.observer.last
        if self._devices.camera is None:
            return None
        self._devices.arm.state()  # in pace fast: once plant time stands, so that the exposure's tick is decided
        return self._devices.camera.read(FRAME_AGE)

    def _picture(self, frame: Frame | None) -> str | None:
        return None if frame is None else self._record.picture(len(self.board.move_stack), frame.colour)

    def _reset_peak(self) -> None:
        if self._devices.referee is not None:
            self._devices.referee.look(reset_peak=True)

    def _judged(self, outcome: PlyOutcome, places: dict[str, Place]) -> tuple[PlyOutcome, Verdict | None]:
        """With what the referee says of the board, for the record alone."""
        if self._devices.referee is None:
            return outcome, None
        self._devices.arm.state()
        truth, _ = self._devices.referee.look()
        verdict = judge(truth, self.inventory)
        force = max(truth.peak_contact_force, outcome.peak_force or 0.0)
        errors = {name: 1e3 * verdict.errors[name] for name in places if name in verdict.errors}
        judged = replace(
            outcome, placement_mm=errors, peak_force=None if outcome.by == "hand" else force,
            physical_ok=verdict.ok, failures=verdict.failures,
        )  # fmt: skip
        return judged, verdict
