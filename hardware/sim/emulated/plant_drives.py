"""The simulated world behind emulated drives: joints to motors, and one loop for the world and the devices.

A device says what its motor does (torque, or nothing) and whether it holds its brake open; the plant says where the
motor stands. Scales of ``[drives]`` are applied the other way round than in the driver, so that a wrong one shows.
"""

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple, Protocol

from hardware.drives.clock import tick_now
from hardware.drives.joint import FingerScale, JointScale
from hardware.interfaces import Command, HardwareError, Measurement, Pace, Triple
from hardware.realtime import exact_timers
from hardware.sim.emulated.answer_times import AnswerTimes
from hardware.sim.emulated.pacing import FollowingPacer
from hardware.sim.emulated.planting import Faulty, Planting
from hardware.sim.process.server import World
from hardware.sim.process.settings import WorldSettings, load_settings

_IDLE: Final = 0.010
"""At rest and without a master the plant runs a bunch of ticks each so often [s]."""


_AWAKE: Final = 0.15
"""So early before its frames come a process in real time listens without sleeping, as a share of the period."""


class MotorCommand(NamedTuple):
    """What the devices do to the plant in one tick, motors counted as the devices count them."""

    torque: Triple
    """Of the three servomotors, at the motor's own shaft [N m]; 0 where a device is switched off."""
    gripper_velocity: float | None
    """The gripper's motor is asked for [rad/s]; None: it is not driven, and its gear, which locks itself, keeps the
    grip."""
    braked: bool
    """Brakes are closed: dry friction on every shaft."""
    powered: bool
    """At least one device drives; otherwise the brakes are closed, too."""
    damping: Triple = (0.0, 0.0, 0.0)
    """Of motors whose phases are shorted, each at its own shaft [N m s/rad]; whichever way round they are wired."""


class MotorState(NamedTuple):
    """What the plant shows the devices' own sensors."""

    tick: int
    angle: Triple
    """Of the servomotors' own shafts [rad]."""
    velocity: Triple
    """[rad/s]."""
    gripper_angle: float
    """Of the gripper's motor [rad]."""
    readings: tuple[float, float]
    """Of the right and left force sensor, in units of their input; 0 where there are none."""


class EmulatedDevices(Faulty, Protocol):
    """Devices of one bus, as the loop calls them. Nothing here waits."""

    @property
    def numbers(self) -> Sequence[int]:
        """Open files at which the master's messages come."""

    @property
    def prompt(self) -> bool:
        """The master's messages come from its own hands; otherwise a thread of the kernel brings them, which needs a
        processor that nobody keeps busy.
        """

    @property
    def complete(self) -> bool:
        """A whole cycle of commands has come since the last tick."""

    @property
    def heard(self) -> float:
        """When the master was heard last (``time.monotonic``) [s]."""

    def hear(self) -> None:
        """Take in what has come, and answer at once."""

    def act(self, now: float) -> MotorCommand:
        """What the devices do in the coming tick; their watchdogs bite here."""

    def sense(self, state: MotorState) -> None:
        """The plant has advanced by one tick, or this is the state before the first one."""

    @property
    def times(self) -> AnswerTimes | None:
        """Where answers are noted; None: nobody measures."""

    def close(self) -> None:
        """Give the bus up."""


class DrivenWorld(World):
    """A world in pace real whose drives are devices in its own thread; nobody else gets them.

    It ends at SIGTERM, or when no master was heard for as long as the settings let it be.
    """

    def __init__(self, run_dir: Path, settings: WorldSettings, devices: EmulatedDevices) -> None:
        """See ``World``; raises ``ValueError`` in pace fast, in which no bus can run."""
        if settings.pace is not Pace.REAL or settings.drives is None:
            raise ValueError("emulated drives need pace real, and the settings of their bus: see [drives]")
        super().__init__(run_dir, settings)
        self.hold_drives()
        self._devices, self._linger, self._first = devices, settings.linger, settings.first_controller
        self._joints = tuple(JointScale.of(joint) for joint in settings.drives.joints)
        self._finger = FingerScale.of(settings.drives.finger)
        self._forces = settings.drives.forces
        self._grip = self.plant.grip
        newton = [force.reading(1.0) - force.zero for force in self._forces or ()]
        self._planting: Planting | None = None
        if settings.planted:
            self._planting = Planting(settings.planted, self._joints, newton, self.plant.set_brakes, devices)
        self.plant.tick = max(self.plant.tick, tick_now(settings.drives.period))
        self._begun = time.monotonic()
        self._period = settings.drives.period
        self._follow = FollowingPacer(self._period, self._begun)
        self._plant_faults()
        devices.sense(self.state())

    # between motors and joints

    def state(self) -> MotorState:
        """Where the motors stand."""
        said: Measurement = self.plant.measure(standing=False)
        one, two, three = self._joints
        a, b, c = said.angle
        va, vb, vc = said.velocity
        forces = self._forces
        readings = (0.0, 0.0)
        if forces is not None:
            readings = forces[0].reading(said.tactile[0]), forces[1].reading(said.tactile[1])
        angle = one.motor_angle(a), two.motor_angle(b), three.motor_angle(c)
        velocity = one.motor_velocity(va), two.motor_velocity(vb), three.motor_velocity(vc)
        if self._planting is not None:
            (a, b, c), (va, vb, vc), seen = self._planting.shown(angle, velocity, readings)
            angle, velocity = (a, b, c), (va, vb, vc)
            readings = seen[0], seen[1]
        return MotorState(said.tick, angle, velocity, self._finger.motor_angle(said.finger_position), readings)

    def drive(self, command: MotorCommand) -> None:
        """Advance by one tick."""
        one, two, three = self._joints
        u, v, w = command.torque if self._planting is None else self._planting.given(command.torque)
        if command.gripper_velocity is None:
            finger = self._grip
        else:
            finger = self._finger.velocity(command.gripper_velocity)
            self._grip = min(0.0, finger)
        torque = one.torque(u), two.torque(v), three.torque(w)
        if any(command.damping):
            torque = self._damped(torque, command.damping)
        asked = Command(
            torque, finger,
            command.braked, command.powered, busy=False,
        )  # fmt: skip
        self.plant.apply(asked)
        self._applied = asked
        self._advance(asked)

    def _damped(self, torque: Triple, damping: Triple) -> Triple:
        """Torques of the joints with those of shorted motors [N m]."""
        velocity = self.plant.measure(standing=False).velocity
        a, b, c = (
            u - scale.torque(d * scale.motor_velocity(v))
            for u, d, v, scale in zip(torque, damping, velocity, self._joints, strict=True)
        )
        return a, b, c

    # the loop

    def run(self) -> None:
        """See ``World.run``."""
        with exact_timers():
            super().run()
        if self._devices.times is not None:
            self._devices.times.save(self._run_dir)

    def _turn(self) -> None:
        self._one_turn()
        heard = self._devices.heard
        patience = self._linger if heard > self._begun else self._first
        if time.monotonic() - max(heard, self._begun) > patience:
            self._ending = True

    def _one_turn(self) -> None:
        """Hear until a tick is due, and run it."""
        devices, pacer = self._devices, self._follow
        early, late = pacer.window
        while True:
            now = time.monotonic()
            until = early if devices.complete else late
            if self.plant.resting and now - devices.heard > _IDLE:
                until += _IDLE
            if until <= now:
                break
            if self._realtime and devices.prompt and not devices.complete:  # awake when their frames come
                until = max(now, min(until, pacer.expected - _AWAKE * self._period))
            if self.listen(until - now, devices.numbers):
                if time.monotonic() > late + self._period:  # this process was held up, and its motors were not
                    self._run_due(time.monotonic())
                    _, late = pacer.window
                devices.hear()
        self._run_due(now)

    def _plant_faults(self) -> None:
        if self._planting is not None:
            self._planting.turn(self._period, driven=not self.plant.braked)

    def _run_due(self, now: float) -> None:
        """The next tick, and all that are due: more than one after a rest, or where this process was held up."""
        devices, pacer = self._devices, self._follow
        while True:
            commanded = devices.complete
            self._plant_faults()
            self.drive(devices.act(now))
            devices.sense(self.state())
            pacer.ran(now, commanded)
            if pacer.window[1] > now:
                return


def driven_world_of(run_dir: Path, devices: EmulatedDevices) -> DrivenWorld:
    """The world of a run directory; ``HardwareError``: its settings or parameters are missing or impossible."""
    try:
        return DrivenWorld(run_dir, load_settings(run_dir), devices)
    except ValueError as error:
        raise HardwareError(f"this world cannot be made: {error}") from error
