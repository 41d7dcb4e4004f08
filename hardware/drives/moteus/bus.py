"""``MoteusServoBus``: four controllers as one servo bus, with a clock of its own.

An exchange waits for the next tick, sends every controller its command and its question in one frame each, and takes
the answers: what the controllers measure then is the measurement, and the command acts from then on.
"""

import math
import sys
import time
from collections.abc import Callable
from typing import Final

from hardware.drives.clock import TickClock
from hardware.drives.faults import DriveFault, Finding
from hardware.drives.joint import FingerScale, JointScale
from hardware.drives.moteus.adapter import Adapter
from hardware.drives.moteus.answers import Answers
from hardware.drives.moteus.cycle import Told
from hardware.drives.moteus.fdcanusb import with_check_sum
from hardware.drives.moteus.health import ControllerWatch, look_at
from hardware.drives.moteus.registers import Mode
from hardware.drives.moteus.serial_port import SerialPort
from hardware.drives.moteus.settings import MoteusSettings
from hardware.drives.moteus.start import GRIPPER, Machine, machine_of, start
from hardware.drives.rating import TorqueRating
from hardware.drives.settings import DriveSettings, VelocitySource
from hardware.drives.velocity import estimate_of
from hardware.interfaces import BusLost, Command, DriveStatus, DriveTrouble, HardwareError, Measurement
from hardware.parameters import RobotParameters

_PARTS: Final = range(4)
_SERVOS: Final = range(3)


class MoteusServoBus:
    """``ServoBus`` of moteus controllers.

    Args:
        drives: scales, period, watchdog.
        settings: port and ids.
        parameters: of the robot.
        tell: told every fault, a sentence.

    Attributes:
        fault: that the drives were braked for last; None once it was cleared.

    Raises:
        HardwareError: a device is not there, or not as it has to be.
    """

    lockstep = False

    def __init__(
        self,
        drives: DriveSettings,
        settings: MoteusSettings,
        parameters: RobotParameters,
        tell: Callable[[str], None] = lambda sentence: print(sentence, file=sys.stderr, flush=True),
    ) -> None:
        if settings.port is None:
            raise HardwareError(
                "nobody said where the adapter is: give drives.moteus its port, as /dev/serial/by-id/… names it"
            )
        self.period, self.fault = drives.period, None
        self._settings, self._tell = settings, tell
        self._port = SerialPort(settings.port)
        self._adapter = Adapter(self._port, check_sums=settings.check_sums)
        try:
            start(self._adapter, drives, settings, parameters)
        except BaseException:
            self._port.close()
            raise
        self._set_up(drives, parameters, machine_of(drives, settings, parameters))

    fault: DriveFault | None

    def _set_up(self, drives: DriveSettings, parameters: RobotParameters, machine: Machine) -> None:
        self._machine, joints = machine, drives.joints
        self._scales = [JointScale.of(joint) for joint in joints]
        self._finger = FingerScale.of(drives.finger)
        self._forces = drives.forces
        self._ratings = [TorqueRating(joint, parameters.drive) for joint in joints]
        self._estimates = [
            estimate_of(joint) if joint.velocity is VelocitySource.POSITION else None for joint in joints
        ]
        self._watches = [ControllerWatch(self._settings, most) for most in machine.most]
        self._hot = [*(joint.temperature_limit for joint in joints), max(one.temperature_limit for one in joints)]
        self._answers = Answers(self._adapter, machine.controllers, self._settings.reply_time)
        self._told: list[Told | None] = [None] * len(_PARTS)
        self._asked: list[float | None] = [None] * len(_PARTS)
        self._held = [math.nan] * len(_SERVOS)
        self._angles, self._velocities = [math.nan] * len(_SERVOS), [0.0] * len(_SERVOS)
        self._bitten = self._pumped = self._closed = False
        self._known: tuple[int, DriveTrouble] | None = None
        self._clock = TickClock(self.period)
        self._tick = self._clock.tick
        self._sent = self._answered = math.nan

    def exchange(self, command: Command) -> Measurement:
        """See ``ServoBus.exchange``."""
        if self._closed:
            raise BusLost("the drives were given up")
        if not command.enable:
            self.fault, self._bitten = None, False
        elif not math.isfinite(sum(command.torque) + command.finger_velocity):
            self._fail(0, Finding(DriveTrouble.NOT_FINITE, f"{command.torque}, {command.finger_velocity}"))
        now = self._clock.next()
        self._tick = self._clock.tick
        before, self._sent = self._sent, now
        elapsed = now - before if math.isfinite(before) else self.period
        saturated = self._send(command, elapsed)
        self._take(command, elapsed)
        if self.fault is None:
            self._known = None
        if self._answered - now > self.period:  # nobody knows in which of these ticks it was measured
            self._tick = int(self._answered / self.period)
            self._clock.tick = self._tick + 1
        return self._measurement(command, saturated)

    def close(self) -> None:
        """See ``ServoBus.close``: brakes close at once, or the controllers hold the arm by themselves."""
        if self._closed:
            return
        self._closed = True
        try:
            if self._machine.pump is not None:
                self._write([controller.mode(Mode.STOPPED) for controller in self._machine.controllers[:GRIPPER]])
                time.sleep(0.002)  # on their way
        except BusLost:
            pass  # their watchdogs brake
        finally:
            self._port.close()

    # commands

    @property
    def _tripped(self) -> bool:
        return self.fault is not None or self._bitten

    def _send(self, command: Command, elapsed: float) -> bool:
        """A frame to each; whether a torque was cut."""
        machine = self._machine
        braked = command.brake or not command.enable or self._tripped
        if machine.pump is not None:
            self._pumped = not self._pumped if not braked else False
        saturated, lines = False, []
        for i in _SERVOS:
            line, cut = self._servo(i, command, braked, elapsed)
            lines.append(line)
            saturated = saturated or cut
        lines.append(self._gripper(command))
        self._answers.drop_late()
        self._write(lines)
        return saturated

    def _outputs(self, part: int) -> int:
        pump = self._machine.pump
        return pump[1] if pump is not None and pump[0] == part and self._pumped else 0

    def _servo(self, i: int, command: Command, braked: bool, elapsed: float) -> tuple[bytes, bool]:
        """The frame of a servomotor, and whether its torque was cut."""
        controller, told, pump = self._machine.controllers[i], self._told[i], self._outputs(i)
        mechanical = self._machine.pump is not None
        self._asked[i], held = None, self._held[i]
        if told is not None and told.mode in (Mode.FAULT, Mode.TIMEOUT) and not command.enable:
            self._held[i] = math.nan
            return controller.mode(Mode.STOPPED, pump), False
        if self._tripped and (mechanical or (self.fault is not None and self.fault.device == i + 1)):
            return controller.mode(Mode.BRAKE, pump), False
        if mechanical and not command.enable:
            self._ratings[i].rest(elapsed)
            return controller.mode(Mode.STOPPED, pump), False
        if braked and not mechanical:
            self._ratings[i].rest(elapsed)
            if math.isnan(held) and told is not None:
                self._held[i] = held = told.angle
            return controller.mode(Mode.STOPPED) if math.isnan(held) else controller.hold(held), self._beyond(
                command, i
            )
        self._held[i] = math.nan
        temperature = math.nan if told is None else told.temperature
        rated = self._ratings[i].rate(command.torque[i], temperature, elapsed)
        self._asked[i] = self._scales[i].motor_torque(rated.torque)
        return controller.torque(self._asked[i] or 0.0, pump), rated.cut

    def _beyond(self, command: Command, i: int) -> bool:
        """A torque that is not given now would be cut."""
        return abs(command.torque[i]) > self._ratings[i].peak

    def _gripper(self, command: Command) -> bytes:
        """The frame of the gripper; what it holds it keeps, whatever becomes of this computer."""
        controller, told, pump = self._machine.controllers[GRIPPER], self._told[GRIPPER], self._outputs(GRIPPER)
        if told is not None and told.mode in (Mode.FAULT, Mode.TIMEOUT) and not command.enable:
            return controller.mode(Mode.STOPPED, pump)
        asked = command.finger_velocity if math.isfinite(command.finger_velocity) else 0.0
        velocity = min(asked, 0.0) if self._tripped else asked
        return controller.velocity(self._finger.motor_velocity(velocity), pump, kept=velocity <= 0.0)

    def _write(self, lines: list[bytes]) -> None:
        if self._settings.check_sums:
            lines = [with_check_sum(line) for line in lines]
        self._port.write(b"\n".join(lines) + b"\n")

    # answers

    def _take(self, command: Command, elapsed: float) -> None:
        before = self._answered if math.isfinite(self._answered) else self._sent
        heard = self._answers.collect()
        self._answered = time.monotonic()
        # each answer was sampled some time between its question and its arrival
        longest = self._answered - (self._sent - elapsed)
        unsure = longest - max(0.0, self._sent - before)
        for part in _PARTS:
            told = heard.told[part]
            if told is None:
                finding = self._watches[part].missed(heard.damage[part])
                if finding is not None:
                    self._fail(part + 1, finding)
            else:
                self._told[part] = told
                self._look(part, told, command, elapsed)
        for i in _SERVOS:
            self._move(i, heard.told[i], elapsed, longest, unsure)

    def _look(self, part: int, told: Told, command: Command, elapsed: float) -> None:
        """What is wrong with a device that has answered."""
        watch = self._watches[part]
        watch.answered()
        if told.mode == Mode.TIMEOUT and command.enable:
            if not self._bitten:
                self._bitten = True
                self._tell(DriveFault(part + 1, DriveTrouble.WATCHDOG_BIT, self._name(part)).sentence)
            return
        wanted = command.enable and not self._tripped
        finding = (
            (look_at(told, self._hot[part], self._settings) if command.enable or told.mode != Mode.FAULT else None)
            or watch.torque(self._asked[part] if told.mode == Mode.POSITION else None, told.torque, told.code, elapsed)
            or watch.operates(told.mode, wanted, elapsed)
        )
        if finding is not None:
            self._fail(part + 1, finding)

    def _move(self, i: int, told: Told | None, elapsed: float, longest: float, unsure: float) -> None:
        """Where a joint is now; one that has not answered, or has jumped, is taken to move on as it did.

        Between two readings at most ``longest`` has passed, and it is not known for ``unsure`` of it when they were.
        """
        scale, estimate = self._scales[i], self._estimates[i]
        before, speed = self._angles[i], self._velocities[i]
        if told is not None:
            angle, velocity = scale.angle(told.angle), scale.velocity(told.velocity)
            expected = before + 0.5 * (speed + velocity) * elapsed
            moved = max(abs(speed), abs(velocity)) * unsure
            jumped = self._watches[i].encoder(angle - expected, moved, longest) if math.isfinite(before) else None
            if jumped is None or self._tripped:
                if estimate is not None:
                    velocity = estimate.take(angle, elapsed)
                self._angles[i], self._velocities[i] = angle, velocity
                return
            self._fail(i + 1, jumped)
        if math.isnan(before):
            raise HardwareError(f"{self._name(i)} does not answer the first exchange: see its cable")
        self._angles[i] = before + speed * elapsed

    def _fail(self, device: int, finding: Finding) -> None:
        """Brake, for what was found first."""
        if self.fault is not None:
            return
        name = f"{self._name(device - 1)}: " if device else ""
        self.fault = DriveFault(device, finding.trouble, name + finding.detail)
        if (device, finding.trouble) != self._known:  # one that stays is found again in every exchange
            self._known = device, finding.trouble
            self._tell(self.fault.sentence)

    def _name(self, part: int) -> str:
        return f"controller {self._settings.ids[part]}"

    # the measurement

    def _measurement(self, command: Command, saturated: bool) -> Measurement:
        a, b, c = self._angles
        va, vb, vc = self._velocities
        gripper = self._told[GRIPPER]
        finger = 0.0 if gripper is None else self._finger.position(gripper.angle)
        return Measurement(
            self._tick, (a, b, c), (va, vb, vc), finger, self._pads(), self._status(command, saturated)
        )  # fmt: skip

    def _pads(self) -> tuple[float, float]:
        places, forces = self._machine.forces, self._forces
        if places is None or forces is None:
            return 0.0, 0.0
        (one, at), (other, there) = places
        right, left = self._told[one], self._told[other]
        if right is None or left is None:
            return 0.0, 0.0
        return forces[0].force(right.inputs[at]), forces[1].force(left.inputs[there])

    def _status(self, command: Command, saturated: bool) -> DriveStatus:
        status = DriveStatus.SATURATED if saturated else DriveStatus.OK
        if self.fault is not None:
            return status | self.fault.status | DriveStatus.BRAKED
        if self._bitten:
            return status | DriveStatus.WATCHDOG | DriveStatus.BRAKED
        ready = all(told is not None and told.mode == Mode.POSITION for told in self._told[:GRIPPER])
        if command.enable and ready:
            status |= DriveStatus.ENABLED
        if command.brake or not command.enable or not ready:
            status |= DriveStatus.BRAKED
        return status
