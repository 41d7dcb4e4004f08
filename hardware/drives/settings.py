"""What every kind of drives is told about the machine: ``[drives]`` of a rig file.

Angles, velocities and torques of settings are a joint's unless they say *motor*. A joint is a servomotor's shaft at the
arm, numbered 1 to 3 as in ``hardware.interfaces``; on a direct drive it is the motor's own shaft.
"""

from enum import StrEnum
from typing import Annotated, Literal, Self

from pydantic import Field, PositiveFloat, model_validator

from hardware.frozen import FrozenFinite
from hardware.parameters import Drive, RobotParameters


class VelocitySource(StrEnum):
    """Whence a joint's velocity comes."""

    DRIVE = "drive"
    """As the drive says it: from its own faster loop."""
    POSITION = "position"
    """From its positions, see ``hardware.drives.velocity``."""


class JointSettings(FrozenFinite):
    """One servomotor: how its shaft goes with the joint's angle, and what it bears."""

    ratio: PositiveFloat = 1.0
    """Turns of the motor for one turn of the joint; 1 on a direct drive."""
    sign: Literal[-1, 1] = 1
    """-1 where the motor turns against the joint: a positive angle of the joint points down."""
    offset: float = 0.0
    """The joint's angle where the motor says zero [rad], found by homing or a taught pose."""
    rated_torque: PositiveFloat | None = None
    """The motor's own, at its shaft [N m], where the drive counts torques in shares of it; as the drive says if left
    out."""
    peak_torque: PositiveFloat | None = None
    """Largest torque that is asked for [N m]; that of the robot's parameters if left out."""
    rms_torque: PositiveFloat | None = None
    """What the winding bears for ever [N m]; the rated torque of the robot's parameters if left out."""
    thermal_time: PositiveFloat = 60.0
    """Time constant of the winding [s]: so long it takes to two thirds of its final heat. Small motors have 30 to 120;
    assumed where nobody measured it."""
    derating_temperature: PositiveFloat = 70.0
    """Of drive or motor, whatever the drive tells [°C]: above it less torque is given …"""
    temperature_limit: PositiveFloat = 85.0
    """… and here none: a fault [°C]."""
    encoder_bits: Annotated[int, Field(ge=10, le=32)] = 20
    """Of a turn of the joint. Below 18 the tool is seen too coarsely to play."""
    velocity: VelocitySource = VelocitySource.DRIVE
    """Whence the joint's velocity comes."""
    encoder_jump: PositiveFloat = 0.01
    """Between a joint's step and its own velocity [rad]: more is a fault. The velocity that a drive says comes some
    2 ms late, which at ``acceleration`` makes 3 mrad of a period of 1 ms; three times that is 2 mm at the tool."""
    acceleration: PositiveFloat = 1500.0
    """No joint is faster at gaining or losing speed [rad/s²]: where an exchange came late, it may be as far off as that
    admits. The default is peak torque and brake together, 16 N m, on a proximal link with its rods, 0.011 kg m²."""
    torque_error: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.15
    """Share by which the torque that a drive says it gives may differ from what it was asked for: of the rated one, for
    what is wrong at no torque, and of the torque asked for, since torque constants are good to 10 % …"""
    torque_time: PositiveFloat = 0.02
    """… for so long [s]; then it is a fault. A current loop follows within 1 ms, and at the peak torque the lightest
    joint turns by 0.15 rad meanwhile."""

    @model_validator(mode="after")
    def _derated_before_the_limit(self) -> Self:
        if self.derating_temperature >= self.temperature_limit:
            raise ValueError(
                f"derating_temperature {self.derating_temperature:g} °C is not below temperature_limit "
                f"{self.temperature_limit:g} °C: lower it"
            )
        return self

    def peak(self, drive: Drive) -> float:
        """Largest torque of this joint on a robot with such drives [N m]."""
        return drive.peak_torque if self.peak_torque is None else self.peak_torque

    def rms(self, drive: Drive) -> float:
        """Torque that this joint bears for ever on a robot with such drives [N m]."""
        return drive.rated_torque if self.rms_torque is None else self.rms_torque


class FingerSettings(FrozenFinite):
    """The gripper's motor, which is asked for a velocity; ``finger`` is z4, of each finger, positive opening."""

    travel: PositiveFloat = 0.004
    """Of each finger for a radian of the motor [m/rad]: a pinion of 8 mm."""
    direction: Literal[-1, 1] = 1
    """-1 where the motor's positive sense closes."""
    position_offset: float = 0.0
    """z4 where the motor says zero [m]."""
    force_limit: PositiveFloat | None = None
    """Largest force of a finger [N]; that of the robot's parameters if left out."""


class ForceSettings(FrozenFinite):
    """One force sensor behind an analog input; N = gain × (reading - zero)."""

    gain: float
    """[N] for one unit of the input, negative where pressing lowers the reading. moteus: 1 is the whole range of the
    input; an EtherCAT terminal: 1 V."""
    zero: float = 0.0
    """Reading without a force, in the same unit."""

    def force(self, reading: float) -> float:
        """What presses on the pad [N]."""
        return self.gain * (reading - self.zero)

    def reading(self, force: float) -> float:
        """What the input reads under a force [N]; for emulated devices."""
        return self.zero + (force / self.gain if self.gain else 0.0)


class DriveSettings(FrozenFinite):
    """Fields of ``[drives]`` that mean the same on every bus."""

    period: Annotated[float, Field(ge=0.00025, le=0.004)] = 0.001
    """Of an exchange, and so of the controller's tick [s]."""
    watchdog: Annotated[float, Field(gt=0.0, le=0.5)] = 0.044
    """After so long without a command the drives brake by themselves [s]: at 0.8 m/s the tool goes 35 mm on."""
    joints: tuple[JointSettings, JointSettings, JointSettings] = (JointSettings(), JointSettings(), JointSettings())
    """Of arms 1, 2, 3."""
    finger: FingerSettings = FingerSettings()
    """The gripper."""
    forces: tuple[ForceSettings, ForceSettings] | None = None
    """Sensors of the right (+z1) and the left pad; left out: there are none, and both always read 0 N."""

    @model_validator(mode="after")
    def _watchdog_above_the_period(self) -> Self:
        if self.watchdog < 5.0 * self.period:
            raise ValueError(
                f"a watchdog of {self.watchdog:g} s trips within {self.watchdog / self.period:.0f} exchanges of "
                f"{self.period:g} s, and at least 5 must fit: lengthen it"
            )
        return self

    def robot(self, parameters: RobotParameters) -> RobotParameters:
        """A robot with its drives on this bus: their period, their watchdog, their coarsest encoder."""
        ticks, bits = round(self.watchdog / self.period), min(joint.encoder_bits for joint in self.joints)
        drive = parameters.drive.model_copy(update={"tick": self.period, "watchdog_ticks": ticks, "encoder_bits": bits})
        return parameters.model_copy(update={"drive": drive})
