"""Between a measurement and a command: states, reference, protection, law. Does no input or output itself.

``admission`` says which motions are admitted, ``brakes`` how the arm comes off its brakes and onto them,
``state_machine`` what follows from a cause; here is the tick. All of it is a function of ticks and messages, so that a
run on a lockstep bus repeats exactly.
"""

from __future__ import annotations

import math

from controller.law.force_observer import ForceObserver
from controller.law.tare import Tare
from controller.law.task_space import TaskSpaceController
from controller.loop.admission import NOTHING, Admission
from controller.loop.brakes import BrakeSequence
from controller.loop.memory import ExchangedTorques, TickMemory
from controller.loop.reference import Reference
from controller.loop.state_machine import NO_TORQUE, StateMachine
from controller.loop.tick import PlainTick
from controller.model.kinematics import Status
from controller.protection.limits import (
    Limits,
    Violation,
    check_drives,
    check_measurement,
    check_tracking,
)
from controller.protection.monitor import Protection
from controller.protection.warm_servomotors import WARM
from controller.protocol.causes import Cause
from controller.protocol.datagram_fields import CommandCode, Result
from controller.protocol.messages import Announce, Samples
from controller.protocol.states import Event, State
from controller.settings import ControllerSettings
from hardware.interfaces import Command, DriveStatus, Measurement, Triple


class Supervisor:
    """The controller without its bus and socket.

    Attributes:
        machine: its state, and the ways from one to another.
        measurement: the last one.
        reference: what the law follows.
        admission: of motions, and what came of the last one.
        brakes: the way on and off them.
        plain: the compiled tick, which takes nearly all of them.
    """

    def __init__(
        self, law: TaskSpaceController, limits: Limits, settings: ControllerSettings, period: float, lockstep: bool
    ) -> None:
        self.measurement = Measurement(-1, NO_TORQUE, NO_TORQUE, 0.0, (0.0, 0.0), DriveStatus.OK)
        memory = TickMemory()
        self.reference = Reference(settings, period, memory)
        self.admission = Admission(settings, limits, period, memory)
        self.brakes = BrakeSequence(settings)
        self.law = law
        self.plain = PlainTick(law, memory, self.admission.motion.rows)
        self._limits = limits
        self._settings = settings
        self._memory, self._torques = memory, ExchangedTorques(memory, limits)
        self._observer = ForceObserver(period, memory=memory.observer)
        self._tare = Tare(period, memory.tare)
        self._protection = Protection(limits, period, memory.screen, memory.encoders)
        self.machine = StateMachine(
            settings, law, self.reference, self.admission, self.brakes, self._protection, self._torques,
            lambda: self.measurement,
        )  # fmt: skip
        self._lockstep = lockstep

    @property
    def torque(self) -> Triple:
        """Of the next exchange, within its limits [N m]."""
        return self._torques.coming

    @property
    def force(self) -> Triple:
        """On the tool, as torques and motion tell, base frame [N]."""
        return self._observer.force

    @property
    def clamped(self) -> int:
        """Ticks in which a torque was clamped."""
        return self._torques.clamped

    @property
    def state(self) -> State:
        """What the controller is doing."""
        return self.machine.state

    @property
    def cause(self) -> Violation:
        """Why it stopped or faulted last."""
        return self.machine.cause

    # what the loop asks

    @property
    def busy(self) -> bool:
        """Whether plant time must go on: booting, a motion, a stop, the way to the end."""
        state = self.state
        if state is State.BOOT:
            return self.brakes.armed
        return state is State.TRACK or state is State.STOPPING or state is State.OFF or self.admission.awaiting

    @property
    def warm(self) -> bool:
        """Whether servomotors are spared: motions are played slower than announced."""
        return self._protection.heat > WARM

    @property
    def may_exchange(self) -> bool:
        """False on a lockstep bus while a due sample, or the motion after a FOLLOWED one, is not there yet."""
        return not self._lockstep or self.admission.may_exchange(self.measurement.tick)

    def command(self) -> Command:
        """What to ask of the drives next."""
        braked = self.machine.braked
        self._torques.give(braked)
        energised = self.brakes.energised or not braked
        return Command(self.torque, self.reference.finger_velocity, braked, energised, self.busy)

    def told_again(self, measurement: Measurement) -> None:
        """An exchange brought the tick that is known: plant time stands, or waits for somebody else.

        Where it waits the command was not taken, and what acts is still that of the exchange before.
        """
        self.measurement = measurement
        if not measurement.status & DriveStatus.STANDING:
            self._torques.take_back()

    @property
    def plainly(self) -> bool:
        """Whether the next tick may be plain; what it is noted with is said then."""
        state, brakes = self.state, self.brakes
        if not (state is State.HOLD or state is State.TRACK) or brakes.retiring or brakes.parking:
            return False
        if self.machine.letting_go or self._protection.something_lasts:
            return False
        self._say()
        return True

    def note(self) -> None:
        """Have the flight recorder's row of the last tick written, which was not plain."""
        self._say()
        self.plain.note(self.measurement)

    def _say(self) -> None:
        motion = self.admission.motion.announced
        self.plain.say(self.state, self.cause[0], 0 if motion is None else motion.motion)

    def took_plainly(self, measurement: Measurement) -> None:
        """The compiled tick has taken a measurement in."""
        right, left = self._memory.tactile.tolist()
        if (right, left) != measurement.tactile:
            measurement = measurement._replace(tactile=(right, left))
        self.measurement = measurement

    def advance(self, measurement: Measurement) -> None:
        """Take a new tick's measurement in: estimate, protect, refer, law, limit."""
        if self.plainly and self.plain.take(measurement):
            self.took_plainly(measurement)
        else:
            self.look_closer(measurement)

    def look_closer(self, measurement: Measurement) -> None:
        """Take a measurement in that is not plain."""
        self.brakes.begin(measurement.tick)
        trouble = check_measurement(measurement)
        if trouble is None:
            tactile = self._tare.weigh(measurement.tactile, self.reference.finger_velocity)
            if tactile != measurement.tactile:
                measurement = measurement._replace(tactile=tactile)
        self.measurement, self._memory.tactile[:] = measurement, measurement.tactile
        trouble = trouble or self._estimate(measurement)
        state = self.state
        if state is State.HOLD or state is State.TRACK or state is State.STOPPING:
            self._control(measurement, trouble or check_drives(int(measurement.status)))
        else:
            self._protection.motors(NO_TORQUE)  # on the brakes they cool
            if state is State.BOOT:
                self._boot(measurement, trouble)
            elif state is State.OFF:
                self._switch_off(measurement, trouble)
        self.machine.retire_at_rest()

    def _estimate(self, measurement: Measurement) -> Violation | None:
        self._observer.update(self.law.memory, measurement.velocity, self._torques.acting)
        status = self.law.update(measurement.angle, measurement.velocity)
        if status is not Status.OK:
            return Violation(Cause.MODEL, float(status), 0.0)
        x, y, z = self.reference.position.tolist()  # as the last tick wanted it
        return self._protection.joints(measurement, (x, y, z), self.law.state.jacobian_inverse)

    def _control(self, measurement: Measurement, trouble: Violation | None) -> None:
        if trouble is not None:
            self.machine.react(trouble)
            return
        moving = self.state is not State.HOLD
        if self.state is State.TRACK:
            self._follow(measurement)
        if self.state is State.STOPPING:
            self.machine.slow_down(measurement.tick)
        self.reference.mark(measurement.tick)
        if not self.machine.braked:  # what has just come to rest may be on its way onto the brakes
            self._watch(measurement)
        if not self.machine.braked:
            self._output(measurement.tactile)
        if moving:
            self.admission.note_peaks(self.torque, measurement.tactile)

    def _follow(self, measurement: Measurement) -> None:
        """Reference of this tick from the motion's sample; its guard or its end."""
        buffer = self.admission.motion
        motion = buffer.announced
        assert motion is not None
        playback, tick = self.admission.playback, measurement.tick
        needed = playback.last_needed(motion, tick)
        if needed < 0:
            return
        if needed >= buffer.received:
            self.machine.stop(Violation(Cause.UNDERRUN, float(needed), float(buffer.received)))
            return
        row, tail, samples = self.reference.row, self.reference.tail, buffer.rows
        buffer.executed = playback.advance(motion, tick, row, samples, self._protection.heat)
        playback.follow(samples, row, tail)
        guard, level = tail[1:].tolist()
        met = self.admission.met(guard, level, measurement.tactile, self.force[2])
        if isinstance(met, Violation):
            self.reference.mark(tick)  # it is that of this tick already
            self.machine.stop(met)
        elif met is not None:
            self.machine.succeed(met)
        elif buffer.executed == motion.length:
            self.machine.succeed(Result.DONE)

    def _watch(self, measurement: Measurement) -> None:
        """Protection by tool, fingers and motors; while the arm is compliant already, only by the latter two."""
        machine = self.machine
        if not (machine.compliant or machine.letting_go) and self._protection.well(
            self.law.memory, self.reference.row, self.force, measurement.tactile, self.torque
        ):
            return
        trouble = self._protection.fingers(measurement.tactile) or self._protection.motors(self.torque)
        if not machine.compliant:
            state, row = self.law.state, self.reference.row.tolist()
            position = state.position.tolist()
            trouble = (
                self._protection.tool(position, state.velocity.tolist(), self.force)
                or check_tracking(position, row[0:3], row[9:12], self._limits)
                or trouble
            )
        if trouble is not None:
            machine.react(trouble)
        machine.let_go(measurement.tactile)

    def _output(self, tactile: tuple[float, float]) -> None:
        """Law and limits: the torque of the next exchange."""
        torque = self.law.torque(self.reference.row, tactile)
        if not math.isfinite(torque[0] + torque[1] + torque[2]):
            self.machine.brake(Violation(Cause.BAD_TORQUE, math.nan, 0.0))
            return
        self._torques.ask(torque)

    # on the brakes

    def _boot(self, measurement: Measurement, trouble: Violation | None) -> None:
        """Off the brakes, then hold where the arm is."""
        if self.machine.fresh and min(measurement.tactile) >= self._settings.held_force:
            # a controller before this one took a piece up: to let go of it would be the worst of beginnings
            self.reference.finger_velocity = -self._settings.holding_speed
        step = self.brakes.boot(measurement, trouble)
        if step.holds:
            self.reference.hold_at(self.law.state.position)
            self._output(measurement.tactile)
            step = self.brakes.enabled(measurement)
        self.machine.take(step)
        if step.trouble is not None:
            self.machine.brake(step.trouble)

    def _switch_off(self, measurement: Measurement, trouble: Violation | None) -> None:
        """Onto the brakes."""
        step = self.brakes.switch_off(measurement, trouble)
        if step.holds:
            self._output(measurement.tactile)
        self.machine.take(step)
        if step.trouble is not None:
            self.machine.cause = step.trouble

    # messages of the client

    def announce(self, motion: Announce) -> None:
        """Admit or refuse a motion; a repetition changes nothing."""
        admission = self.admission
        if motion.motion <= admission.last_motion:
            return
        admission.last_motion = motion.motion
        refusal = admission.refusal(motion, self.state, self.measurement.tick, retiring=self.brakes.retiring)
        if refusal is not None:
            admission.record(motion, Result.REFUSED, refusal, self.measurement, self.law.state.position)
            return
        admission.admit(motion, self.reference.position)
        self.machine.cause = NOTHING
        self.machine.enter(Event.ANNOUNCED)

    def take_samples(self, samples: Samples) -> None:
        """Store samples of the announced motion; those of any other are stale and change nothing."""
        buffer = self.admission.motion
        if not buffer.takes(samples):
            return
        trouble = buffer.store(samples)
        if trouble is not None and buffer.executed:
            self.machine.stop(trouble)
        elif trouble is not None:
            self.machine.refuse(trouble)

    def obey(self, code: CommandCode) -> None:
        """Carry a command out; repeating it changes nothing."""
        if code is CommandCode.HOLD:
            self.admission.admitting = False
            self.machine.stop(Violation(Cause.HOLD_COMMAND, 0.0, 0.0))
        elif code is CommandCode.STOP:
            self.machine.stop(Violation(Cause.STOP_COMMAND, 0.0, 0.0))
        elif code is CommandCode.RESUME:
            self.admission.admitting = True
        elif code is CommandCode.SHUTDOWN:
            self.machine.retire()
        elif code is CommandCode.ENABLE:
            self.brakes.enable(self.state, self.measurement.tick)
        elif code is CommandCode.CLEAR_FAULT:
            self.machine.clear_fault()
