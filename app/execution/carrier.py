"""Carries pieces: whole jobs of the arm, whatever interrupts them, each part recorded before it begins."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence, Set
from dataclasses import replace
from typing import TYPE_CHECKING

from app import UserError
from app.execution.board_height import BoardHeight
from app.execution.interruption import Begun, CarryFailed, Loss, PieceLost, Progress, is_over_box, progress_of
from app.execution.pauses import Permission
from app.execution.state import Attendant, Carried, Clearance, Devices, Job, PlannedPush
from app.motion.off_centre import UntriedSides
from app.pieces.inventory import Inventory, Stage, Transfer
from app.pieces.order import Point
from app.records import GameRecord
from app.rig.arm import (
    ASIDE,
    FELT,
    ArmAtRest,
    ArmGaveWay,
    ArmHeld,
    ArmPaused,
    ArmStopped,
    GraspedAside,
    GraspFailed,
    NothingTouched,
    Outcome,
    PieceSlipped,
    TouchedElsewhere,
)
from app.terminal.game_display import UserInterface
from hardware.parameters import RobotParameters
from hardware.piece_set import Kind
from hardware.table import Place

if TYPE_CHECKING:
    from app.execution.fallen import Leaning
    from app.execution.recovery_plans import Blocked
    from app.motion import Motion, MotionSettings, Planner
    from vision.pieces.lying_or_standing import MisplacedPiece

MOST_PAUSES = 20
"""Within one job; a computer that is late so often will not get better by itself."""
GIVES = 0.0005
"""Fingers around a piece may be closed by so much more than its stem says [m]."""
_MEETS = (Stage.GRASP, Stage.APPROACH)
"""Here the arm holds nothing yet. What it meets as it grasps is looked at at once; on its way there, the second time:
the first may have been a hand."""
HELD_UP = 0.001
"""A tool that rests by so much above its reference lies on something: its reference comes there first [m]."""
AT_HOME = 0.002
"""A reference that is no further from home is there [m]."""
SPARED = "the servomotors are close to what they are rated for: the arm moves more slowly until they have cooled"


class Carrier:
    """Uses the arm.

    Args:
        devices: of the rig.
        record: of the game.
        ui: shown what the arm does.
        motion: how it moves.
        parameters: of the robot.
        attendant: says 'go' after a STOP.

    Where pieces lie or stand elsewhere, its methods are told which, as ``misplaced``; what should stand where, as
    ``stands``; and up to which hand the board was looked at, as ``seen``.
    """

    def __init__(
        self,
        devices: Devices,
        record: GameRecord,
        ui: UserInterface,
        motion: MotionSettings,
        parameters: RobotParameters,
        attendant: Attendant,
    ) -> None:
        self._devices, self._record, self._ui = devices, record, ui
        self._motion, self._parameters = motion, parameters
        self.permission = Permission(devices, record, ui, attendant)
        self._height = BoardHeight()
        self._spared = False
        """It was said that the arm is slow, and why."""
        self.midway = False
        """Something was begun and left before the arm was home: there may be a piece in its fingers."""
        self._step: Begun | None = None
        self._listeners: list[Callable[[str], None]] = []

    def subscribe(self, listener: Callable[[str], None]) -> None:
        """Have a listener told the move, in UCI, of each ply whose last piece the arm is about to let go of."""
        self._listeners.append(listener)

    @property
    def untouched(self) -> bool:
        """Nothing was begun of the last job."""
        return self._step is None

    def carry(
        self, job: Job, inventory: Inventory, begun: Begun | None = None, seen: Clearance | None = None
    ) -> Carried:
        """Do a job, or what is left of one that was broken off, from wherever the arm is; home at its end.

        Every part is recorded before it begins. Where the arm had to stop because samples came too late, it goes on
        from where it is; a busy computer may cost time, but no game. Nor does a hand over the board: the arm holds
        until it is gone; nor STOP: it rests until somebody says 'go'.

        Args:
            job: what to carry.
            inventory: what stood where before the whole job.
            begun: how far another program was; None: nothing was begun.
            seen: up to which hand the board was looked at, as far as the job relies on that; None: on nothing.

        Raises:
            BoardTouched: one was.
            CarryFailed: a piece was not gripped, nor on either side, or was lost on its way; the arm is home.
            UserError: the computer was late too often; or as the planner.
        """
        state = self._devices.arm.state()
        self._step, self.midway = begun, begun is not None
        pauses, yields, resumed = 0, 0, begun is not None
        sides = UntriedSides(self._parameters.pads, inventory.table)
        while True:
            progress: Progress | None = None
            try:
                progress = self._progress(job, state, inventory)
                self.permission.await_clear(seen if self._step is None else None)
                planned, done = self._rest(job, state, inventory, progress)
                self.midway = False
                self._tell_spared(done)
                return Carried(planned, done, resumed)
            except (GraspedAside, GraspFailed) as failure:
                job = self._beside(job, inventory, failure, sides)
            except (NothingTouched, PieceLost, PieceSlipped) as failure:
                raise self._failed(job, inventory, failure) from failure
            except ArmStopped as stopped:
                self.permission.await_go(stopped)
            except ArmGaveWay as pushed:
                yields += 1
                self.permission.admit_again(pushed, yields)
                # a piece that is higher than was thought, or one in the way that nobody knows of: the camera tells
                if self._step is not None and self._step.stage in _MEETS[:yields]:
                    raise self._failed(job, inventory, pushed) from pushed
            except ArmHeld as held:
                self.permission.require_own_hold(held)
                self._ui.phase(f"waiting for the board to be clear: {held}")
            except ArmPaused as pause:
                pauses += 1
                if pauses > MOST_PAUSES or self._step is None:
                    raise
                self._ui.phase(f"continuing after a pause: {pause}")
            except UserError as refused:
                from app.motion import PlanRefused

                beside = progress is not None and not progress.holding and sides.knows(progress.done)
                if not (beside and isinstance(refused, PlanRefused)):  # the fingers do not get at one of the sides
                    raise
                job = self._beside(job, inventory, refused, sides)
            state = self._devices.arm.settle()
            resumed = resumed or self._step is not None

    def stand_up(
        self, one: MisplacedPiece, misplaced: Sequence[MisplacedPiece], stands: Inventory, seen: Clearance | None
    ) -> float | None:
        """Stand a piece up where it lies; home at its end.

        Returns:
            How long it took [s]; None: the arm had to stop on the way, and is home.

        Raises:
            BoardTouched: one was.
            PlanRefused: something is in the way; ``InTheWay`` says which piece.
        """
        from app.execution.recovery_plans import plan_stand_up

        plan = plan_stand_up(self._planner(stands), one, misplaced, stands, self._height.lower)
        self._step = None
        try:
            self.permission.await_clear(seen)
            return self._devices.arm.execute(plan).duration
        except (ArmPaused, GraspFailed, NothingTouched, TouchedElsewhere) as stop:
            self._ui.phase(str(stop))
            self._go_home(stands, None, touching=isinstance(stop, TouchedElsewhere))
            if self._height.is_doubted_by(stop):
                self.permission.await_clear(seen)
                self._height.feel(self._devices.arm, self._planner(stands), one, misplaced, stands, self._ui)
                self._go_home(stands, None, touching=True)
            return None

    def push_for(
        self, blocked: Sequence[Blocked], misplaced: Sequence[MisplacedPiece], stands: Inventory, seen: Clearance | None
    ) -> PlannedPush:
        """How one of two pieces that are in each other's way can be pushed aside, with nothing in the arm's way now.

        ``blocked`` are those that the arm cannot take or stand up, and because of which.

        Raises:
            BoardTouched: a hand was over the board since.
            PlanRefused: no push helps.
        """
        from app.execution.recovery_plans import plan_pushing

        nudge, plan = plan_pushing(self._planner(stands), blocked, misplaced, stands)
        self._step = None
        self.permission.await_clear(seen)
        return PlannedPush(nudge.name, plan)

    def stir_for(self, spot: Point, heap: Leaning, stands: Inventory, seen: Clearance | None) -> PlannedPush:
        """How what leans at a spot of the board can be pushed, so that it falls flat; as ``push_for``."""
        from app.execution.recovery_plans import plan_stirring

        fallen = {piece.name for piece in stands if piece.place in heap.fallen}
        plan = plan_stirring(self._planner(stands), spot, fallen, heap.misplaced, stands, heap.towards, heap.itself)
        self._step = None
        self.permission.await_clear(seen)
        return PlannedPush("heap", plan)

    def push_aside(self, push: PlannedPush, stands: Inventory) -> None:
        """Push something as planned just before; home at its end. Where it comes to rest, only the camera can tell."""
        try:
            self._devices.arm.execute(push.plan)
        except ArmPaused as stop:
            self._ui.phase(str(stop))
            self._go_home(stands, None)

    def bring_home(self, inventory: Inventory) -> None:
        """Where the arm is not at home, as another program has left it: straight up and home, the fingers as they are.

        Raises:
            UserError: it cannot go there.
        """
        self._devices.arm.settle()
        self.be_ready(inventory)

    def be_ready(self, inventory: Inventory) -> None:
        """Before anything is looked at or planned: an arm that rests where somebody has pushed it goes home.

        Raises:
            UserError: it cannot go there.
        """
        state = self._devices.arm.state()
        if state.gave_way:
            self._ui.phase("the arm was pushed and gave way: it goes home")
            self._devices.arm.resume()
        if math.dist(state.reference, self._motion.home) > AT_HOME:
            self._go_home(inventory, None)

    def way_for(
        self, blocks: str, misplaced: Sequence[MisplacedPiece], stands: Inventory, but: Set[Place] = frozenset()
    ) -> Transfer:
        """Where a piece of a name may go that is in the way of the fingers; not to some places.

        Raises:
            PlanRefused: nowhere.
        """
        from app.execution.recovery_plans import plan_making_way

        transfer, _ = plan_making_way(self._planner(stands), blocks, misplaced, stands, but)
        return transfer

    def _planner(self, inventory: Inventory, state: ArmAtRest | None = None) -> Planner:
        """From where the arm rests, on the table that an inventory stands on."""
        from app.motion import Planner  # takes seconds to load: not before something moves

        arm = self._devices.arm
        state = state or arm.state()
        return Planner.of(
            self._motion, self._parameters, inventory.table, state.reference, state.finger, arm.lead_ticks
        )

    def _progress(self, job: Job, state: ArmAtRest, inventory: Inventory) -> Progress | None:
        """How far a job is; None: nothing of it was begun. What the pads hold by their edges is not lifted so, but
        grasped again.
        """
        from app.motion.obstacles import closed_position

        if (step := self._step) is None:
            return None
        progress = progress_of(job.transfers, step.transfer, step.stage, state, inventory.table)
        if step.stage is Stage.GRASP:
            middle = closed_position(job.transfers[step.transfer].kind, self._parameters.pads)
            progress = replace(progress, holding=progress.holding and state.finger <= middle + ASIDE)
        self._ui.phase(progress.explain(job.label, job.transfers))
        return progress

    def _rest(
        self, job: Job, state: ArmAtRest, inventory: Inventory, progress: Progress | None
    ) -> tuple[float, Outcome]:
        from app.execution.recovery_plans import loose_pieces

        done = 0 if progress is None else progress.done
        now = _after(inventory, job, done)
        if rest := job.transfers[done:]:
            # what was carried already is no longer where it was seen
            misplaced = [one for one in job.misplaced if one.piece.name not in {each.name for each in job.transfers}]
            elsewhere = {one.piece.name for one in misplaced}
            now = now.without(elsewhere)
            plan = self._planner(now, state).ply(
                job.label, rest, now, holding=progress is not None and progress.holding, low=progress is not None,
                loose=loose_pieces(misplaced),
            )  # fmt: skip
        else:
            plan = self._planner(now, state).home(job.transfers[-1].kind)

        first = plan.motions[0]

        def begin(motion: Motion) -> None:
            self._note(job, motion, done, durable=motion is first)  # the arm rests before the first one

        return plan.expected, self._devices.arm.execute(plan, begin)

    def _tell_spared(self, done: Outcome) -> None:
        """Once a game: who sees the arm become slow wants to know why."""
        if done.spared and not self._spared:
            self._spared = True
            self._ui.say(SPARED)

    def _note(self, job: Job, motion: Motion, done: int, *, durable: bool) -> None:
        """Record what the arm begins, so that another program can finish it."""
        if motion.transfer is None or motion.stage is None:
            return
        self._step, self.midway = Begun(done + motion.transfer, motion.stage), True
        self._record.step(job.uci, self._step.transfer, self._step.stage, self._devices.clock.now(), durable=durable)
        if job.uci is not None and self._step == Begun(len(job.transfers) - 1, Stage.RELEASE):
            for listener in self._listeners:
                listener(job.uci)

    def _beside(self, job: Job, inventory: Inventory, failure: UserError, sides: UntriedSides) -> Job:
        """The job as it is tried next, after the fingers did not close around a piece as they should.

        What has slid into their grooves is carried, once. What the pads' edges hold is taken further to one side, then
        to the other, also where a camera looks: as a rule that has been asked already, and the arm is not where it
        thinks. Where neither is left the job has failed.
        """
        assert self._step is not None
        index = self._step.transfer
        transfer = job.transfers[index]
        if isinstance(failure, GraspedAside):
            self._ui.phase(str(failure))
            slid = failure.seated and not sides.knows(index)
            sides.note(index, transfer, failure.finger_position, failure)
            if slid:
                return job
        if (beside := sides.next(index)) is None:
            raise self._failed(job, inventory, sides.cause(index, failure)) from failure
        self._go_home(inventory, transfer.kind)
        return replace(job, transfers=(*job.transfers[:index], beside, *job.transfers[index + 1 :]))

    def _failed(self, job: Job, inventory: Inventory, failure: UserError) -> CarryFailed:
        """Home after a loss, and what it was."""
        from app.motion.obstacles import closed_position

        assert self._step is not None
        index = self._step.transfer
        transfer = job.transfers[index]
        missed = not isinstance(failure, NothingTouched | PieceLost | PieceSlipped)
        state, touching = self._devices.arm.settle(), isinstance(failure, PieceSlipped)
        # perhaps it is, or something else, between the fingers yet: then it stands, and is let go of there
        empty = closed_position(transfer.kind, self._parameters.pads) - GIVES  # fingers that hold nothing close further
        felt = state.felt >= FELT or (touching and state.finger > empty)
        self._go_home(inventory, transfer.kind if missed or felt else None, touching=touching)
        self.midway = False
        return CarryFailed(
            Loss.NOT_GRIPPED if missed else Loss.LOST, transfer, index, _after(inventory, job, index), str(failure),
            not missed and is_over_box(transfer, state, inventory.table),
        )  # fmt: skip

    def _go_home(self, inventory: Inventory, release: Kind | None, *, touching: bool = False) -> None:
        """Straight up and home, whatever holds it up on the way; the fingers open first from what they are around."""
        pauses = yields = 0
        while pauses < MOST_PAUSES:
            state = self._devices.arm.settle()
            held_up = touching or state.reference[2] - state.position[2] > HELD_UP
            plan = self._planner(inventory, state).home(release, held_up_at=state.position if held_up else None)
            try:
                self.permission.await_clear()
                self._devices.arm.execute(plan)
                return
            except ArmStopped as stopped:
                self.permission.await_go(stopped)
            except ArmGaveWay as pushed:
                yields += 1
                self.permission.admit_again(pushed, yields)
            except ArmPaused as pause:
                pauses += 1
                self.permission.require_own_hold(pause)
                self._ui.phase(f"continuing after a pause: {pause}")
        raise UserError("the arm could not go home: this computer is late again and again; run 'touchmove link-test'")


def _after(inventory: Inventory, job: Job, done: int) -> Inventory:
    """What stands where after the first transfers of a job."""
    return inventory.after_all(job.transfers[:done])
