"""The arm on the app's side: carry out plans and say what was really done."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np

from app import UserError
from app.pieces.inventory import Stage
from controller.protocol.cause_sentences import explain
from controller.protocol.causes import Cause
from controller.protocol.states import State
from controller.wire.client import ControllerClient, MotionOutcome
from controller.wire.errors import MotionRefused, MotionStopped

if TYPE_CHECKING:
    from app.motion.plan import Motion, Plan
    from app.motion.timing.reference import Vector

FELT: Final = 0.5
"""Both pads feel more than this where something is between them; what they are commanded to press with is 4 N [N]."""
TOUCH_ERROR: Final = 0.0017
"""What the fingers come down on is so near to where it should be, in height [m]: places are known to a millimetre or
two, and pivot edges are pressed in by one (seen: 0.7 to 1.0 mm, and 1.9 and -3.6 where it was something else)."""
ASIDE: Final = 0.0015
"""Fingers that close by so much less than around a piece in the middle hold it by their edges [m]: friction does that
from 3 mm on, and in the middle they close to within 0.2 mm."""
SLIDES: Final = 0.5
"""What the edges hold is waited for so long [s, wall]; where plant time waits for us, until nothing moves."""
_LATE: Final = (Cause.UNDERRUN, Cause.LATE)
_HELD: Final = (Cause.HOLD_COMMAND, Cause.NOT_ADMITTED)
GAVE_WAY: Final = frozenset({
    Cause.TRACKING, Cause.TOOL_SPEED, Cause.TOOL_OUTSIDE, Cause.PRESSING, Cause.GRIP_FORCE, Cause.TACTILE_OVERLOAD,
})  # fmt: skip
"""After these the controller gives way, or lets go, and admits no motion until it is told that it is well."""
REST_PATIENCE: Final = 30.0
"""So long an arm that gives way is waited for [s, wall]: somebody may lean on it."""


class GraspFailed(UserError):
    """The fingers closed and felt no piece."""

    def __init__(self, motion: Motion, finger_position: float) -> None:
        super().__init__(
            f"could not {motion.label}: the fingers closed to {finger_position * 1e3:.1f} mm and felt nothing; is "
            "the piece where the game expects it?"
        )


class GraspedAside(UserError):
    """The fingers closed on a piece that stands so far aside that their edges hold it: lifted, it would slip.

    Attributes:
        finger_position: where they closed [m].
        seated: what they hold has slid into their grooves since, so that it can be lifted.
    """

    def __init__(self, motion: Motion, finger_position: float, *, seated: bool) -> None:
        super().__init__(
            f"could not {motion.label}: the pads held it by their edges, {finger_position * 1e3:.1f} mm from the "
            "middle; does the piece stand where the game expects it, and is it of the set that the game knows?"
        )
        self.finger_position, self.seated = finger_position, seated


class PieceSlipped(UserError):
    """A piece was carried, and was lost on its way, or was no longer in the fingers when they came to its place."""

    def __init__(self, motion: Motion, *, on_its_way: bool = False) -> None:
        how = "the piece slipped out of the fingers" if on_its_way else "the fingers arrived empty"
        super().__init__(f"{motion.label}: {how}; where has it gone?")


class TouchedElsewhere(UserError):
    """Something else was in the way of the fingers than what they had to come down on, or that lies otherwise."""

    def __init__(self, motion: Motion, off: float) -> None:
        super().__init__(
            f"{motion.label}: touched {abs(off) * 1e3:.1f} mm {'below' if off > 0.0 else 'above'} the expected "
            "height; something else is there, or the piece is propped up"
        )


class NothingTouched(UserError):
    """A piece was lowered and nothing held it up."""

    def __init__(self, motion: Motion) -> None:
        assert motion.continuation is not None
        depth = motion.continuation.settings.touch_depth
        super().__init__(
            f"{motion.label}: lowered {depth * 1e3:.0f} mm below the board's height and felt nothing; is the board "
            "where the settings say?"
        )


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a plan came to: duration [s] of plant time, peak torque [N m], peak tactile force [N], last tick.

    ``spared``: at its end it was played slower than planned, to spare servomotors. ``touched``: how low the tool was
    when something held it up last, base frame z₃ [m]; None: nothing was to, or nobody measures.
    """

    duration: float
    peak_torque: float
    peak_force: float
    end_tick: int
    spared: bool = False
    touched: float | None = None


@dataclass(frozen=True, slots=True)
class ArmAtRest:
    """Where the arm rests: reference, base frame (3,) [m]; finger position [m]; tick; what both pads feel [N].

    ``measured`` is where the tool is by the encoders, (3,) [m]; None: nobody measures, it is where it should be.
    ``gave_way``: somebody pushed it, or something was in its way, so that it admits no motion until ``Arm.resume``.
    """

    reference: Vector
    finger: float
    tick: int
    felt: float = 0.0
    measured: Vector | None = None
    gave_way: bool = False

    @property
    def position(self) -> Vector:
        """Of the tool, base frame (3,) [m]."""
        return self.reference if self.measured is None else self.measured


class ArmPaused(UserError):
    """The arm stopped by itself because this program or the network was late; nothing else is wrong."""


class ArmHeld(ArmPaused):
    """The arm was told to hold, as a hand is over the board; it may go on once that is gone."""


class ArmGaveWay(ArmPaused):
    """Somebody pushed the arm, or something was in its way, and it gave way; ``Arm.resume`` lets it move again."""


class ArmStopped(ArmPaused):
    """Somebody pressed STOP; ``Arm.release`` lets it move again, once a person has said so."""

    def __init__(self) -> None:
        super().__init__(explain(Cause.STOP_PRESSED))


class Arm(Protocol):
    """Executes plans."""

    lead_ticks: int

    @property
    def stopped(self) -> bool:
        """Whether somebody pressed STOP, so that it does not move until ``release``; as far as is known at once."""

    @property
    def last_motion(self) -> int:
        """Number of the motion that began last, as telemetry counts them; 0: none has."""

    def state(self) -> ArmAtRest:
        """The arm at rest; on a simulated rig in pace fast, once plant time stands."""

    def settle(self) -> ArmAtRest:
        """Wait until an arm whose motion was stopped is at rest; where it rests."""

    def resume(self) -> None:
        """Let an arm that gave way move again, once it rests.

        Raises:
            ArmGaveWay: it does not come to rest.
        """

    def release(self) -> None:
        """Let an arm that was stopped by STOP move again. One that was pressed again meanwhile stays stopped."""

    def execute(self, plan: Plan, begin: Callable[[Motion], None] | None = None) -> Outcome:
        """Do a whole plan; ``begin`` is told each motion before it is announced.

        Raises:
            ArmPaused: samples came too late and the arm stopped by itself; it may go on from where it is.
            ArmHeld: it was told to hold; it may go on once that is taken back.
            ArmGaveWay: something was in its way, or had pushed it before; it may go on after ``resume``.
            ArmStopped: somebody pressed STOP; it may go on after ``release``.
        """


class ControllerArm:
    """``Arm`` over the controller's client."""

    def __init__(self, client: ControllerClient, progress: Callable[[str], None] | None = None) -> None:
        """``progress`` is told what each motion does."""
        self._client = client
        self._progress = progress
        self.lead_ticks = 8 if client.lockstep else 30

    @property
    def stopped(self) -> bool:
        """See ``Arm.stopped``."""
        return self._client.latched

    @property
    def last_motion(self) -> int:
        """See ``Arm.last_motion``."""
        telemetry = self._client.telemetry
        return max(telemetry.motion, telemetry.ended_motion)

    def state(self) -> ArmAtRest:
        """See ``Arm.state``."""
        telemetry = self._client.wait_standing()
        felt = min(telemetry.tactile)
        measured = np.array(telemetry.position)
        return ArmAtRest(
            np.array(telemetry.reference), telemetry.finger_position, telemetry.tick, felt, measured, self._gave_way()
        )

    def _gave_way(self) -> bool:
        telemetry = self._client.telemetry
        return not telemetry.admitting and telemetry.cause in GAVE_WAY

    def settle(self) -> ArmAtRest:
        """See ``Arm.settle``."""
        if not self._gave_way():  # that comes to rest by itself, and why it did is not to be forgotten
            self._client.stop()
        return self.state()

    def resume(self) -> None:
        """See ``Arm.resume``."""
        until = time.monotonic() + REST_PATIENCE
        while (telemetry := self._client.wait_standing()).state is State.STOPPING:
            if time.monotonic() > until:
                raise ArmGaveWay(f"{telemetry.explain_cause()}; it does not come to rest")
            time.sleep(self._client.period)
        self._client.resume()

    def release(self) -> None:
        """See ``Arm.release``."""
        self._client.release()

    def execute(self, plan: Plan, begin: Callable[[Motion], None] | None = None) -> Outcome:
        """Stream the motions one after the other.

        Raises:
            GraspFailed: a motion that had to grip ended without.
            GraspedAside: it gripped beside the middle of the pads.
            NothingTouched: a motion that had to touch ended without.
            TouchedElsewhere: a motion touched at another height than it should.
            PieceSlipped: a piece was lost on its way.
            ArmPaused: samples came too late.
            ArmHeld: a hand is over the board.
            ArmGaveWay: something was in its way, or had pushed it before.
            ArmStopped: somebody pressed STOP.
            ControllerError: refused, stopped or lost; the arm rests.
        """
        first_tick, end_tick, torque, force, touched = None, 0, 0.0, 0.0, None
        done: MotionOutcome | None = None
        for index, planned in enumerate(plan.motions):
            motion = planned if done is None else planned.continued(np.array(done.reference))
            if self._progress is not None:
                self._progress(motion.label)
            if begin is not None:
                begin(motion)
            done = self._carry_out(motion, followed=index < len(plan.motions) - 1)
            first_tick = done.first_tick if first_tick is None else first_tick
            end_tick = done.end_tick
            torque, force = max(torque, done.peak_torque), max(force, done.peak_tactile)
            if motion.grips and not done.gripped:
                self._client.stop()
                raise GraspFailed(motion, done.finger_position)
            if motion.seats_at is not None and done.finger_position > motion.seats_at + ASIDE:
                self._client.stop()
                seated = self._slides_in(motion.seats_at + ASIDE)
                raise GraspedAside(motion, done.finger_position, seated=seated)
            if motion.touches and not done.touched:
                self._client.stop()
                raise NothingTouched(motion)
            touched = done.position[2] if motion.touches else touched
            if motion.touches_at is not None and abs(off := done.position[2] - motion.touches_at) > TOUCH_ERROR:
                self._client.stop()
                raise TouchedElsewhere(motion, off)
            if motion.stage is Stage.CARRY and min(done.tactile) < FELT:  # what held it up is something else
                self._client.stop()
                raise PieceSlipped(motion)
        assert first_tick is not None
        duration = (end_tick - first_tick) * self._client.period
        return Outcome(duration, torque, force, end_tick, self._client.telemetry.warm, touched)

    def _slides_in(self, seated: float) -> bool:
        """Whether what the pads hold by their edges slides into their grooves after all, if slowly: then the fingers
        come to a position [m], and feel it.
        """
        until = time.monotonic() + SLIDES
        while (state := self.state()).finger > seated and not self._client.lockstep and time.monotonic() < until:
            time.sleep(self._client.period)
        return state.finger <= seated and state.felt >= FELT

    def _carry_out(self, motion: Motion, *, followed: bool) -> MotionOutcome:
        try:
            return self._client.execute(motion.samples, followed=followed)
        except (MotionRefused, MotionStopped) as error:
            if error.cause is Cause.STOP_PRESSED:
                raise ArmStopped from error
            if error.cause in _LATE:
                raise ArmPaused(str(error)) from error
            if error.cause is Cause.GRIP_LOST:
                raise PieceSlipped(motion, on_its_way=True) from error
            if error.cause in GAVE_WAY or (error.cause is Cause.NOT_ADMITTED and self._gave_way()):
                raise ArmGaveWay(str(error)) from error
            if error.cause in _HELD:
                raise ArmHeld(str(error)) from error
            raise
