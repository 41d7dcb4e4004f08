"""``MoteusServoBus``: four controllers as one servo bus, with a clock of its own.

An exchange waits for the next tick, sends every controller its command and its question in one frame each, and takes
the answers: what the controllers measure then is the measurement, and the command acts from then on.
"""

import math
import sys
import time
from collections.abc import Callable
from typing import Final

from hardware.drives.clock import ExchangeTimes, TickClock, periods_moved
from hardware.drives.faults import DriveFault, DriveFinding
from hardware.drives.joint import FingerScale
from hardware.drives.moteus.adapter import Adapter
from hardware.drives.moteus.answers import AnswerCollector
from hardware.drives.moteus.cycle import Told
from hardware.drives.moteus.fdcanusb import with_check_sum
from hardware.drives.moteus.health import ControllerWatch, look_at, of_all
from hardware.drives.moteus.registers import Mode
from hardware.drives.moteus.serial_port import SerialPort
from hardware.drives.moteus.servo import ServoAction, ServoJoint
from hardware.drives.moteus.settings import MoteusSettings
from hardware.drives.moteus.start import GRIPPER, Machine, machine_of, start
from hardware.drives.settings import DriveSettings
from hardware.interfaces import BusLost, Command, DriveStatus, DriveTrouble, HardwareError, Measurement, Triple
from hardware.parameters import RobotParameters

_BRAKES_CLOSE: Final = 0.2
"""Within so long a relay lets go and the brakes close [s]; until then the motors hold the arm."""


def say(sentence: str) -> None:
    """Tell people."""
    print(sentence, file=sys.stderr, flush=True)


class MoteusServoBus:
    """``ServoBus`` of moteus controllers.

    Args:
        drives: scales, period, watchdog.
        settings: port and ids.
        parameters: of the robot.
        tell: told every fault, a sentence.

    Attributes:
        fault: that the drives were braked for last; None once it was cleared.
        times: of the last exchange; nothing before it.

    Raises:
        HardwareError: a device is not there, or not as it has to be.
    """

    lockstep = False
    by_serial_port = True

    def __init__(
        self,
        drives: DriveSettings,
        settings: MoteusSettings,
        parameters: RobotParameters,
        tell: Callable[[str], None] = say,
    ) -> None:
        if settings.port is None:
            raise HardwareError(
                "the adapter's port is not given: give drives.moteus its port, such as /dev/serial/by-id/…"
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
        self._machine, self._controllers = machine, machine.controllers
        self._mechanical, self._watchdog = machine.pump is not None, drives.watchdog
        self._joints = [
            ServoJoint(controller, joint, parameters.drive, drives.watchdog)
            for controller, joint in zip(machine.controllers, drives.joints, strict=False)
        ]
        self._finger, self._forces = FingerScale.of(drives.finger), drives.forces
        self._watches = [ControllerWatch(self._settings.lost_replies) for _ in machine.controllers]
        limits = [joint.temperature_limit for joint in drives.joints]
        self._hot = [*limits, max(limits)]
        self._answers = AnswerCollector(self._adapter, machine.controllers, self._settings.reply_time)
        self._told: list[Told | None] = [None] * len(machine.controllers)
        self._bitten = self._ill = self._pumped = self._closed = False
        self._clock, self._tick = TickClock(self.period), 0
        self._sent = self._fed = math.nan
        self.times: ExchangeTimes | None = None

    def exchange(self, command: Command) -> Measurement:
        """See ``ServoBus.exchange``. A fault is cleared by an exchange without ``enable`` in which all are well."""
        if self._closed:
            raise BusLost("the moteus drives were given up")
        self._ill = False
        if not math.isfinite(sum(command.torque) + command.finger_velocity):
            self._fail(0, DriveFinding(DriveTrouble.NOT_FINITE, f"{command.torque}, {command.finger_velocity}"))
        self._cycle(command)
        while any(math.isnan(joint.angle) for joint in self._joints):  # the first answers are missing
            if self.fault is not None:
                raise BusLost(self.fault.sentence)
            self._cycle(command)
        if not command.enable and not self._ill:
            self.fault, self._bitten = None, False
        return self._measurement(command)

    def close(self) -> None:
        """See ``ServoBus.close``: brakes close at once, or the controllers hold the arm by themselves."""
        if self._closed:
            return
        self._closed = True
        try:
            if self._mechanical:
                self._write([controller.mode(Mode.BRAKE) for controller in self._controllers[:GRIPPER]])
                time.sleep(0.002)  # on their way
        except BusLost:
            pass  # their watchdogs brake
        finally:
            self._port.close()

    def _cycle(self, command: Command) -> None:
        """Wait for the next tick, tell all of them, and take their answers."""
        before, self._sent = self._sent, self._clock.next()
        elapsed = self._sent - before if math.isfinite(before) else self.period
        self._send(command, elapsed)
        self._take(command, elapsed)
        self.times = ExchangeTimes(self._sent, self._answers.sent, self._answers.came, time.monotonic())

    # commands

    @property
    def _tripped(self) -> bool:
        return self.fault is not None or self._bitten

    @property
    def _ready(self) -> bool:
        return all(joint.mode == Mode.POSITION for joint in self._joints)

    def _send(self, command: Command, elapsed: float) -> None:
        """A frame to each; brakes stay closed until all motors hold, and where a watchdog may have bitten meanwhile."""
        ready = self._ready and elapsed < 0.5 * self._watchdog
        opened = command.enable and not command.brake and not self._tripped and ready
        self._pumped = opened and not self._pumped
        if opened:
            self._fed = self._sent
        lines = [
            joint.frame(self._wanted(i, command), command.torque[i], elapsed, self._outputs(i))
            for i, joint in enumerate(self._joints)
        ]
        lines.append(self._gripper(command))
        self._answers.expect()
        self._write(lines)

    def _outputs(self, part: int) -> int:
        pump = self._machine.pump
        return pump[1] if pump is not None and pump[0] == part and self._pumped else 0

    def _wanted(self, i: int, command: Command) -> ServoAction:
        """What a servomotor is to do; until brakes have closed it holds its joint by itself."""
        if not command.enable and self._joints[i].mode in (Mode.FAULT, Mode.TIMEOUT):
            return ServoAction.OFF
        if self.fault is not None and self.fault.device == i + 1:
            return ServoAction.SHORT
        braked = command.brake or not command.enable or self._tripped
        if braked and (not self._mechanical or self._sent - self._fed < _BRAKES_CLOSE):
            return ServoAction.HOLD
        if self._tripped:
            return ServoAction.SHORT
        return ServoAction.RUN if command.enable else ServoAction.OFF

    def _gripper(self, command: Command) -> bytes:
        """The frame of the gripper; what it holds it keeps, whatever becomes of this computer."""
        controller, told, pump = self._controllers[GRIPPER], self._told[GRIPPER], self._outputs(GRIPPER)
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
        heard = self._answers.collect()
        answered, before = time.monotonic(), self._state
        self._ill |= None in heard.told  # who is silent may be what the fault is about
        missed = [
            None if told is not None else watch.missed(damage)
            for told, damage, watch in zip(heard.told, heard.damage, self._watches, strict=True)
        ]
        nobody = of_all(missed)
        if nobody is not None:
            self._fail(0, nobody)
        for part, told in enumerate(heard.told):
            finding = missed[part]
            if told is not None:
                self._told[part] = told
                self._watches[part].answered()
                finding = self._look(part, told, command, elapsed)
            if part < GRIPPER:
                joint = self._joints[part]
                moved = None if told is None else joint.take(told, self._sent, answered, elapsed)
                finding = finding or moved
                if told is None and finding is None:
                    joint.coast(elapsed)
                elif told is None:
                    joint.lose(elapsed)
            if finding is not None:
                self._fail(part + 1, finding)
        self._tick = self._clock.told(answered, lambda: periods_moved(*before, self._state[0], self.period))

    @property
    def _state(self) -> tuple[Triple, Triple]:
        """Angles and velocities of the joints, as measured last [rad, rad/s]."""
        one, two, three = self._joints
        return (one.angle, two.angle, three.angle), (one.velocity, two.velocity, three.velocity)

    def _look(self, part: int, told: Told, command: Command, elapsed: float) -> DriveFinding | None:
        """What is wrong with a device that has answered."""
        if told.mode == Mode.TIMEOUT:
            self._ill = True
            if command.enable and not self._bitten:
                self._bitten = True
                self._tell(DriveFault(part + 1, DriveTrouble.WATCHDOG_BIT, self._name(part)).sentence)
            return None
        if told.mode == Mode.FAULT and not command.enable:  # it is being cleared
            self._ill = True
            return None
        wanted = command.enable and not self._tripped
        return look_at(told, self._hot[part], self._settings) or self._watches[part].operates(
            told.mode, wanted, elapsed
        )

    def _fail(self, device: int, finding: DriveFinding) -> None:
        """Brake, for what was found first."""
        self._ill = True
        if self.fault is not None:
            return
        name = f"{self._name(device - 1)}: " if device else ""
        self.fault = DriveFault(device, finding.trouble, name + finding.detail)
        self._tell(self.fault.sentence)

    def _name(self, part: int) -> str:
        return f"controller {self._settings.ids[part]}"

    # the measurement

    def _measurement(self, command: Command) -> Measurement:
        gripper = self._told[GRIPPER]
        finger = 0.0 if gripper is None else self._finger.position(gripper.angle)
        return Measurement(
            self._tick, *self._state, finger, self._pads(), self._status(command),
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

    def _status(self, command: Command) -> DriveStatus:
        cut = any(joint.cut for joint in self._joints)
        status = DriveStatus.SATURATED if cut else DriveStatus.OK
        if self.fault is not None:
            return status | self.fault.status | DriveStatus.BRAKED
        if self._bitten:
            return status | DriveStatus.WATCHDOG | DriveStatus.BRAKED
        if command.enable and self._ready:
            status |= DriveStatus.ENABLED
        if command.brake or not command.enable or not self._ready:
            status |= DriveStatus.BRAKED
        return status
