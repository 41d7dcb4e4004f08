"""``ServoBus`` of EtherCAT drives: one frame a period, at absolute deadlines, and every fault on the brakes."""

import math
import sys
import time
from collections import deque
from collections.abc import Callable
from typing import Any, Final

from hardware.drives.clock import ExchangeTimes, TickClock, periods_moved
from hardware.drives.ethercat import al_status, faults
from hardware.drives.ethercat.axis import ServoAxis
from hardware.drives.ethercat.cia402 import DriveState, Wanted
from hardware.drives.ethercat.clock import ReferenceFollower
from hardware.drives.ethercat.gripper import GripperAxis, dead_channel, forces_of
from hardware.drives.ethercat.network import Health, Network, directly
from hardware.drives.ethercat.settings import ARMS, Device, EtherCatSettings
from hardware.drives.faults import DriveFault
from hardware.drives.settings import DriveSettings
from hardware.interfaces import BusLost, Command, DriveStatus, DriveTrouble, Measurement
from hardware.parameters import RobotParameters

REPLY: Final = 3
"""A frame may be under way for so many periods before it is lost: a busy computer is late, a cable is not."""
RESETTING: Final = 0.5
"""So long a fault that is being reset counts as reset [s]."""
LIFT_EVERY: Final = 0.02
"""Devices that are not in OP are asked for their next step so often, while the arm is on its brakes [s]."""
ASK_EVERY: Final = 0.25
"""All devices are asked for their state so often [s]: one without outputs leaves OP and the working counter stays."""
_NO_FORCES = (0.0, 0.0)
_TARGETS: Final = {Wanted.OFF: DriveState.READY, Wanted.STANDBY: DriveState.SWITCHED_ON, Wanted.RUN: DriveState.ENABLED}


def say(sentence: str) -> None:
    """Tell people."""
    print(sentence, file=sys.stderr, flush=True)


class EtherCatServoBus:
    """Drives, gripper and force sensors on one cable; ``HardwareError`` if they are not as the settings say.

    Attributes:
        fault: the last one, None before the first.
        lost: frames that did not come back.
        times: of the last exchange; nothing before it.
    """

    lockstep = False

    def __init__(
        self,
        settings: EtherCatSettings,
        drives: DriveSettings,
        parameters: RobotParameters,
        enter: Any = directly,
        tell: Callable[[str], None] = say,
    ) -> None:
        self.period = drives.period
        self._settings, self._watchdog = settings, drives.watchdog
        self._network = network = Network(settings, drives, parameters, enter)
        self._arms = [
            ServoAxis(joint, parameters.drive, network.facts[device])
            for joint, device in zip(drives.joints, ARMS, strict=True)
        ]
        self._gripper = GripperAxis(drives.finger, network.facts[Device.GRIPPER])
        self._axes: dict[Device, ServoAxis | GripperAxis] = {
            **dict(zip(ARMS, self._arms, strict=True)), Device.GRIPPER: self._gripper,
        }  # fmt: skip
        self._forces = drives.forces if settings.has_forces else None
        self._tell, self._closed = tell, False
        self._follower = ReferenceFollower(self.period) if settings.distributed_clocks else None
        self.fault: DriveFault | None = None
        self.lost = 0
        self.times: ExchangeTimes | None = None
        self._came: deque[bool] = deque(maxlen=faults.FRAMES)
        self._losses, self._lossy = 0, False
        self._latched: DriveFault | None = None
        self._ill = False
        """The last exchange has found something, be it what is latched already."""
        self._cleared_since = self._wanted_since = self._lifted = self._asked = time.monotonic()
        self._wrong, self._doubt = 0, True
        self._gone = frozenset[Device]()
        """Who did not answer when all were asked last."""
        self._unanswered: float | None = None
        self._answered = self._sent = self._made = time.monotonic()
        self._clock = TickClock(self.period)
        self._due = self._clock.due() - self.period
        self._ran = self._energised = False

    # the exchange

    def exchange(self, command: Command) -> Measurement:
        """See ``ServoBus.exchange``. A frame that is lost is a tick that is missed; ``BusLost`` if none comes back."""
        if self._closed:
            raise BusLost("the EtherCAT drives were given up")
        if self._latched is not None and not command.enable and not self._ill:
            self._clear()
        self._ill = False
        finite = math.isfinite(sum(command.torque) + command.finger_velocity)
        if not finite:
            self._latch(DriveFault(0, DriveTrouble.NOT_FINITE, f"{command.torque}, {command.finger_velocity}"))
            command = command._replace(torque=(0.0, 0.0, 0.0), finger_velocity=0.0)
        while True:
            self._put_out(command, self._clock.due())
            began = self._clock.next()
            if self._cycle():
                break
            self._miss(began)
        measurement = self._measure(command)
        self.times = ExchangeTimes(began, self._sent, self._answered, time.monotonic())
        return measurement

    def close(self) -> None:
        """See ``ServoBus.close``: the devices go to INIT, where brakes are closed."""
        if not self._closed:
            self._closed = True
            self._network.close()

    def _put_out(self, command: Command, due: float) -> None:
        """What the next frame takes along, before its time has come, so that it sets out at once then."""
        network, wanted = self._network, self._wanted(command)
        reset = not command.enable
        elapsed, self._due = min(due - self._due, self._watchdog), due
        for arm, device, torque in zip(self._arms, ARMS, command.torque, strict=True):
            network.output(device, arm.outputs(torque, wanted, elapsed, reset=reset))
        velocity = command.finger_velocity if self._latched is None else min(0.0, command.finger_velocity)
        network.output(Device.GRIPPER, self._gripper.outputs(velocity, Wanted.RUN, reset=reset))

    def _cycle(self) -> bool:
        """One frame; whether it came back with the data of all."""
        network = self._network
        self._sent = time.monotonic()
        network.send()
        counter = network.receive(REPLY * self.period)
        self.lost += counter < 0
        self._count(lost=counter < 0)
        if counter == network.expected:
            self._wrong = 0
            return True
        self._wrong = 0 if counter < 0 else self._wrong + 1
        if self._wrong >= faults.WRONG and self._latched is None:
            self._latch(faults.of_health(self._health()) or faults.of_counter(counter, network.expected))
        return self._wrong >= faults.WRONG

    def _wanted(self, command: Command) -> Wanted:
        if self._latched is not None or self._lossy or not command.enable:
            return Wanted.OFF
        return Wanted.STANDBY if command.brake else Wanted.RUN

    def _miss(self, began: float) -> None:
        """A frame is lost, or not everybody has served it."""
        if self._unanswered is None:
            self._unanswered = began
        silent = time.monotonic() - self._unanswered
        if silent > self._watchdog:
            raise BusLost(
                f"no EtherCAT frame has come back for {silent * 1e3:.0f} ms (limit {self._watchdog * 1e3:.0f} ms), "
                f"and the drives have braked by themselves: check the cable at {self._settings.interface} and the "
                "devices' power"
            )

    # what came back

    def _measure(self, command: Command) -> Measurement:
        now = time.monotonic()
        asked = self._clock.tick
        tick = self._clock.told(now, self._moved)
        made = self._sent + (tick - asked) * self.period  # drives say where they are as the frame passes them
        self._unanswered = None
        elapsed, gap = made - self._made, now - self._answered
        self._made = made
        silent = gap > self._watchdog and self._energised
        self._doubt = self._doubt or gap > self._watchdog
        self._answered, self._energised = now, command.enable
        if self._follower is not None:
            self._clock.shift(self._follower.correct(self._network.reference_time))
        if silent:
            for arm in self._arms:
                arm.begin_anew()
        self._take(now, elapsed)  # also where somebody is missing: the others say whether they have braked
        if silent:
            self._judge_silence(gap)
        if self._lossy and self._latched is None:  # this frame has braked the drives: now there is time to ask for more
            self._latch(faults.of_losses(self._losses, len(self._came), self._grown()))
        if self._latched is None:
            self._judge_states(command, now)
            self._ask_states(now)
        self._recover(now, command)
        status = self._status(command)
        one, two, three = self._arms
        return Measurement(
            tick, (one.angle, two.angle, three.angle), (one.velocity, two.velocity, three.velocity),
            self._gripper.position, self._felt(), status,
        )  # fmt: skip

    def _moved(self) -> float:
        one, two, three = self._arms
        a, b, c = (arm.angle_in(self._network.input(device)) for arm, device in zip(self._arms, ARMS, strict=True))
        before, velocity = (one.angle, two.angle, three.angle), (one.velocity, two.velocity, three.velocity)
        return periods_moved(before, velocity, (a, b, c), self.period)

    def _take(self, now: float, elapsed: float) -> None:
        network = self._network
        for arm, device in zip(self._arms, ARMS, strict=True):
            if self._wrong and device in self._gone:  # its process data are those of before
                arm.lose(elapsed)
                continue
            trouble = arm.take(network.input(device), self._sent, now, elapsed)
            if trouble is not None and not self._wrong:
                self._latch(faults.of_drive(device, self._settings.place(device), trouble))
        self._gripper.take(network.input(Device.GRIPPER))

    def _felt(self) -> tuple[float, float]:
        if self._forces is None:
            return _NO_FORCES
        inputs = self._network.input(Device.FORCES)
        channel = dead_channel(inputs)
        if channel:
            self._latch(
                DriveFault(5, DriveTrouble.UNSPECIFIED, f"channel {channel} reports that its value is not valid")
            )
        return forces_of(inputs, self._forces)

    def _judge_silence(self, gap: float) -> None:
        """Nothing was said for longer than the watchdog waits: the drives must have braked."""
        powered = (DriveState.SWITCHED_ON, DriveState.ENABLED)
        going_on = [device for arm, device in zip(self._arms, ARMS, strict=True) if arm.state in powered]
        seen = f"{gap * 1e3:.0f} ms without a frame, limit {self._watchdog * 1e3:.0f} ms"
        if going_on and gap > 1.5 * self._watchdog:
            device = going_on[0]
            self._latch(DriveFault(faults.NUMBERS[device], DriveTrouble.WATCHDOG_DEAD, seen))
        elif len(going_on) < len(ARMS):
            self._latch(DriveFault(0, DriveTrouble.WATCHDOG_BIT, seen))

    def _judge_states(self, command: Command, now: float) -> None:
        """Drives that report a fault, have left their state, or do not reach it."""
        wanted = self._wanted(command)
        forgiven = not command.enable and now - self._cleared_since < RESETTING
        lagging: Device | None = None
        for device, axis in self._axes.items():
            if axis.state in (DriveState.FAULT, DriveState.FAULT_REACTION) and not forgiven:
                self._latch(faults.of_code(device, self._settings.place(device), axis.error))
                return
            target = DriveState.ENABLED if device is Device.GRIPPER else _TARGETS[wanted]
            lagging = lagging or (device if axis.state is not target else None)
        fell = self._ran and wanted is Wanted.RUN and lagging is not None
        self._ran = wanted is Wanted.RUN and (self._ran or lagging is None)
        if lagging is None or not command.enable:
            self._wanted_since = now
            return
        place, state = self._settings.place(lagging), self._axes[lagging].state
        if fell:  # without a fault of its own, as by STO: were it back by itself, the arm would start with nobody there
            self._latch(faults.of_health(self._health()) or faults.of_fall(lagging, place, state))
        elif now - self._wanted_since > faults.STAY:
            self._latch(faults.of_stay(lagging, place, state, now - self._wanted_since))

    def _ask_states(self, now: float) -> None:
        """Now and then, while the arm runs: a device whose process data say nothing of it may have left OP."""
        if not self._ran or now - self._asked < ASK_EVERY:
            return
        self._asked = now
        said = [one for one in self._health() if one.state]  # of the others the working counter tells
        if (ill := faults.of_health(said)) is not None:
            self._latch(ill)

    def _status(self, command: Command) -> DriveStatus:
        states = [arm.state for arm in self._arms]
        status = DriveStatus.OK
        if not all(state is DriveState.ENABLED for state in states):
            status |= DriveStatus.BRAKED
        if self._latched is not None:
            bitten = self._latched.trouble is DriveTrouble.WATCHDOG_BIT
            return status | (DriveStatus.WATCHDOG if bitten else self._latched.status)
        if command.enable and all(state in (DriveState.SWITCHED_ON, DriveState.ENABLED) for state in states):
            status |= DriveStatus.ENABLED
        if any(arm.cut for arm in self._arms):
            status |= DriveStatus.SATURATED
        return status

    # faults

    def _latch(self, fault: DriveFault) -> None:
        """The arm goes onto its brakes, until it is disabled and nothing is found any more; the first fault counts."""
        self._ill = True
        if self._latched is None:
            self._latched = self.fault = fault
            self._ran = False
            self._tell(fault.sentence)

    def _clear(self) -> None:
        """Whoever has disabled the drives has seen the fault: it is over where all are well."""
        if any(axis.state in (DriveState.FAULT, DriveState.FAULT_REACTION) for axis in self._axes.values()):
            return  # their reset is under way
        if self._wrong or not all(one.well for one in self._health()):
            return
        self._latched = None
        if self._lossy:
            self._network.forget_receive_errors()
        self._came.clear()
        self._losses, self._lossy = 0, False
        self._cleared_since = self._wanted_since = time.monotonic()

    def _health(self) -> list[Health]:
        """How all devices stand, see ``Network.health``; who does not answer is noted."""
        health = self._network.health()
        self._gone = frozenset(one.device for one in health if not one.state)
        return health

    def _recover(self, now: float, command: Command) -> None:
        """Bring devices back that have left OP, while nobody wants the arm; no device is waited for."""
        doubt = self._doubt if self._latched is None else not command.enable
        if self._ran or not doubt or now - self._lifted < LIFT_EVERY:
            return
        self._lifted = now
        health = self._health()
        self._doubt = not all(one.well for one in health)
        for one in health:
            if one.state & 0x0F in (al_status.SAFEOP, al_status.OP) and not one.well:
                self._network.lift(one)

    def _count(self, *, lost: bool) -> None:
        """Frames that do not come back, one by one."""
        if self._lossy:
            return
        if len(self._came) == faults.FRAMES and not self._came[0]:
            self._losses -= 1
        self._came.append(not lost)
        self._losses += lost
        self._lossy = self._losses > faults.LOSSES * faults.FRAMES

    def _grown(self) -> list[tuple[Device, int, int]]:
        chain, counts = self._settings.chain, self._network.receive_errors()
        return [(chain[place], place, count) for place, count in enumerate(counts) if count > 0]
