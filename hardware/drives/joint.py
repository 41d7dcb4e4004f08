"""Between a motor and its joint, pure functions of what the settings say. All angles in radians.

``joint = sign · motor / ratio + offset``; a torque goes the other way, so that the power is the same on both sides.
"""

from dataclasses import dataclass
from typing import Self

from hardware.drives.settings import FingerSettings, JointSettings


@dataclass(frozen=True, slots=True)
class JointScale:
    """Scale between one motor and its joint."""

    factor: float
    """Joint angle for one of the motor: sign / ratio."""
    offset: float
    """Joint angle where the motor says zero [rad]."""

    @classmethod
    def of(cls, settings: JointSettings) -> Self:
        """As the settings say."""
        return cls(settings.sign / settings.ratio, settings.offset)

    def angle(self, motor: float) -> float:
        """The joint's angle [rad], given the motor's [rad]."""
        return self.factor * motor + self.offset

    def motor_angle(self, joint: float) -> float:
        """The motor's angle [rad], given the joint's [rad]."""
        return (joint - self.offset) / self.factor

    def velocity(self, motor: float) -> float:
        """The joint's velocity [rad/s], given the motor's [rad/s]."""
        return self.factor * motor

    def motor_velocity(self, joint: float) -> float:
        """The motor's velocity [rad/s], given the joint's [rad/s]."""
        return joint / self.factor

    def torque(self, motor: float) -> float:
        """The joint's torque [N m], given the motor's [N m]."""
        return motor / self.factor

    def motor_torque(self, joint: float) -> float:
        """The motor's torque [N m], given the joint's [N m]."""
        return self.factor * joint


@dataclass(frozen=True, slots=True)
class FingerScale:
    """Scale between the gripper's motor and z4."""

    travel: float
    """Of each finger for a radian of the motor, with its sign [m/rad]."""
    offset: float
    """z4 where the motor says zero [m]."""

    @classmethod
    def of(cls, settings: FingerSettings) -> Self:
        """As the settings say."""
        return cls(settings.direction * settings.travel, settings.position_offset)

    def position(self, motor: float) -> float:
        """z4 [m], given the motor's angle [rad]."""
        return self.travel * motor + self.offset

    def motor_angle(self, position: float) -> float:
        """The motor's angle [rad], given z4 [m]."""
        return (position - self.offset) / self.travel

    def velocity(self, motor: float) -> float:
        """A finger's velocity [m/s], given the motor's [rad/s]."""
        return self.travel * motor

    def motor_velocity(self, finger: float) -> float:
        """The motor's velocity [rad/s], given a finger's [m/s]."""
        return finger / self.travel

    def motor_torque(self, force: float) -> float:
        """The motor's torque [N m] that presses both fingers with so much each [N]; without losses, its amount."""
        return 2.0 * abs(self.travel) * force
