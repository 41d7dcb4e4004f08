"""What the arm is doing, and every way from one state to another: motions that end, stops, giving way, brakes."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from controller.law.task_space import TaskSpaceController
from controller.loop.admission import NOTHING, PRESSED, Admission
from controller.loop.brakes import BrakeSequence, BrakeStep
from controller.loop.memory import ExchangedTorques
from controller.loop.reference import Reference
from controller.protection.limits import REACTIONS, Reaction, Violation
from controller.protection.monitor import Protection
from controller.protocol.causes import Cause
from controller.protocol.datagram_fields import Result
from controller.protocol.states import BRAKED, Event, State, next_state
from controller.settings import ControllerSettings
from hardware.interfaces import Measurement, Triple

NO_TORQUE: Triple = (0.0, 0.0, 0.0)
_AT_FENCE: Final = 0.001
"""Nobody pushes a tool that is no further beyond its fence [m]."""
LET_GO_FORCE = 1.0
"""Fingers that let go open until neither feels more [N]."""


class StateMachine:
    """State and cause, and what has to happen when they change.

    Attributes:
        state: what the controller is doing.
        cause: why it stopped or faulted last.
        braked: the brakes are closed in this state.
        fresh: the brakes have not been opened yet.
        letting_go: ticks for which fingers that pressed too hard may open still.
    """

    def __init__(
        self,
        settings: ControllerSettings,
        law: TaskSpaceController,
        reference: Reference,
        admission: Admission,
        brakes: BrakeSequence,
        protection: Protection,
        torques: ExchangedTorques,
        measured: Callable[[], Measurement],
    ) -> None:
        """``measured`` tells the last measurement."""
        self.state, self.cause = State.BOOT, NOTHING
        self.braked = self.fresh = True
        self.letting_go = 0
        self._compliant_ticks = 0
        self._outside = math.inf
        """The least way outside the workspace at which the tool gave way since it was enabled [m]."""
        self._protective: Violation | None = None
        """What wants the brakes once the arm rests."""
        self._settings, self._law = settings, law
        self._reference, self._admission, self._brakes = reference, admission, brakes
        self._protection, self._torques = protection, torques
        self._measured = measured

    @property
    def compliant(self) -> bool:
        """The arm gives way to what was met."""
        return self._compliant_ticks > 0

    def enter(self, event: Event) -> None:
        """What happens, and the state that follows from it."""
        before = self.state
        self.state, foreseen = next_state(before, event)
        self.braked = self.state in BRAKED
        self.fresh = self.fresh and self.state is State.BOOT
        if event is Event.ENABLED:
            self._outside, self._compliant_ticks, self.letting_go = math.inf, 0, 0
        if not foreseen:
            self.cause = Violation(Cause.UNKNOWN_EVENT, float(event), float(before))
        if self.state is State.STOPPING and not self._compliant_ticks:
            self._reference.begin_stop()
        if self.state is State.FAULT:
            self._de_energise()

    def take(self, step: BrakeStep) -> None:
        """What a tick on the way off or onto the brakes asks for."""
        if step.limp:
            self._torques.coming = NO_TORQUE
        if step.event is not None:
            self.enter(step.event)

    # what a cause asks for

    def react(self, trouble: Violation) -> None:
        """Do what a cause asks for; what goes on already is not begun again."""
        reaction = REACTIONS[trouble.cause]
        if reaction is Reaction.BRAKE:
            self.brake(trouble)
        elif self.braked:  # nothing to stop, nor to give way with
            return
        elif reaction is Reaction.PROTECTIVE_STOP:
            if self._protective is None:
                self.stop(trouble, Event.PROTECTIVE_STOP)
        elif reaction is Reaction.COMPLIANT:
            self._comply(trouble)
        elif not self.letting_go:
            self.stop(trouble)
            self._admission.admitting = False
            self.letting_go = self._settings.letting_go_ticks

    def press_stop(self) -> None:
        """STOP, in any state: come to rest and admit no motion until it is released; why a hold is in force stays."""
        self._admission.latch.press()
        if self.state is not State.STOPPING:
            held = self.state is State.HOLD and not self._admission.admitting
            self.stop(self.cause if held else PRESSED)

    def stop(self, cause: Violation, event: Event = Event.STOP) -> None:
        """Drop the motion and come to rest along the direction of travel.

        Args:
            cause: why.
            event: STOP to hold afterwards, PROTECTIVE_STOP to brake afterwards.
        """
        if event is Event.PROTECTIVE_STOP and self._protective is None:
            self._protective = cause
        self._admission.awaiting = False
        if self.state in BRAKED or self._compliant_ticks:  # that ends at rest, too, and its cause matters more
            return
        self._drop(cause)
        self.enter(event)
        self._reference.relax()

    def brake(self, cause: Violation) -> None:
        """Brakes at once."""
        self._drop(cause)
        self._compliant_ticks = self.letting_go = 0
        self._reference.abandon()
        self._protection.reset()
        self._de_energise()
        self.enter(Event.BRAKE)

    def clear_fault(self) -> None:
        """A person has seen why: on the brakes until a client enables the arm."""
        if self.state is State.FAULT:
            self._brakes.armed, self._protective = False, None
            self.enter(Event.CLEAR)

    def _comply(self, cause: Violation) -> None:
        """Something is in the way: drop the motion and give way."""
        self._drop(cause)
        self._compliant_ticks = 1
        self._admission.admitting = False
        self._give_way_at(self._law.state.position.tolist())
        self.enter(Event.COMPLIANT)

    def _drop(self, cause: Violation) -> None:
        """End the motion, if there is one, because of a cause."""
        self._admission.awaiting = False
        self.cause = cause
        if self._admission.motion.announced is not None:
            self._end(Result.STOPPED, cause)

    def _de_energise(self) -> None:
        self._brakes.energised, self._torques.coming = False, NO_TORQUE

    # ticks of a stop

    def slow_down(self, tick: int) -> None:
        """Reference of a tick from the controlled stop, or none in compliant mode."""
        if self._compliant_ticks:
            self._stay_compliant()
        elif self._reference.slow_down(tick):
            self._come_to_rest()

    def _stay_compliant(self) -> None:
        """Until the tool rests, but not for too short a time; then hold softly where it is."""
        self._compliant_ticks += 1
        position, speed = self._law.state.position.tolist(), math.hypot(*self._law.state.velocity.tolist())
        held_back = self._give_way_at(position)
        rests = self._compliant_ticks > self._settings.compliant_ticks and speed < self._settings.compliant_speed
        if held_back:  # while somebody pushes it does not rest; brakes, if they are due, do not wait
            rests = self._protective is not None or self._brakes.retiring
        if rests:
            self._compliant_ticks = 0
            self._reference.rest_softly(position)
            self._come_to_rest()

    def _give_way_at(self, position: list[float]) -> bool:
        """A spring holds who pushes the tool out: whether it does. What was enabled out there it does not pull in."""
        inside = self._protection.nearest_inside(position)
        off = math.dist(position, inside)
        self._outside = min(self._outside, off)
        share = self._outside / off if off > 0.0 else 1.0
        self._reference.comply_at(position, [to + share * (at - to) for at, to in zip(position, inside, strict=True)])
        return off > self._outside + _AT_FENCE

    def _come_to_rest(self) -> None:
        if self._protective is None:
            self.enter(Event.AT_REST)
            self.retire_at_rest()  # before anything else is found that a tool out there gives way to
        else:
            self.cause = self._protective  # whatever else has stopped it: this is to be mended before it moves again
            self.enter(Event.PROTECTIVE_STOP_AT_REST)

    def let_go(self, tactile: tuple[float, float]) -> None:
        """A tick of fingers that pressed too hard: open until neither feels much, or long enough [N]."""
        if self.letting_go:
            self.letting_go -= 1
            tight = max(tactile) > LET_GO_FORCE and self.letting_go > 0
            self._reference.finger_velocity = self._settings.letting_go_speed if tight else 0.0
            self.letting_go = self.letting_go if tight else 0

    # ends of motions, and of all

    def succeed(self, result: Result) -> None:
        """The motion reached its end or its guard: the reference rests there, gains and fingers stay."""
        self._reference.rest()
        self._admission.awaiting = self._end(result, NOTHING)
        self.enter(Event.ENDED)

    def refuse(self, trouble: Violation) -> None:
        """The announced motion cannot begin."""
        self._end(Result.REFUSED, trouble)
        self.enter(Event.ENDED)

    def _end(self, result: Result, reason: Violation) -> bool:
        return self._admission.end(result, reason, self._measured(), self._law.state.position)

    def retire(self) -> None:
        """Stop, then brakes for good."""
        if self._brakes.retiring:
            return
        self._brakes.retiring = True
        self.stop(Violation(Cause.SHUTDOWN, 0.0, 0.0))
        self.retire_at_rest()

    def park(self, alone: float) -> None:
        """Nobody has needed the arm for so long [s]: brakes, until a client enables it; only from rest."""
        if self.state is State.HOLD and not self._brakes.retiring:
            self._brakes.park()
            self.cause = Violation(Cause.PARKED, alone, self._settings.linger)
            self.retire_at_rest()

    def retire_at_rest(self) -> None:
        """Onto the brakes where that is due and nothing moves."""
        if self._brakes.close(self.state, self._measured().tick):
            self.enter(Event.RETIRE)
