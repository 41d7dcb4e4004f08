"""The tactile outer loop of Fig. 4 as pure functions: sensors, gripper, feedback by k*, and what they do together.

Only the distance of the fingers is controlled: the right pad stands at z1 + z4, the left one at z1 - z4. Forces f press
on the pads' insides: the right one towards +z1, the left one towards -z1. The arm feels their difference, the gripper's
motor their sum, and the fingers' own motion does not move the arm:

    arm        ë + k_v ė + k_p e = (1/m) (f_right - f_left) + k* (s_right - s_left)        along z1, e = z1 - r1
    sensors    ṡ = k_s (f - s)
    gripper    2 (m_f + m_r) z̈4 = f_right + f_left + motor,    motor = 2 k_v4 (ṙ4 - ż4), limited

m is the mass that a force along z1 accelerates, 1/(Λ⁻¹)_11, m_f a finger's mass, m_r the motor's inertia as one finger
feels it through the large gear ratio. The second term of the arm is what the law (23) adds to v1, with the sign
explained there.
"""

from __future__ import annotations

import math

from hardware.parameters import Gripper, RobotParameters

Pair = tuple[float, float]
"""Of the right (+z1) and of the left (-z1) pad [N], as the drives' measurement and the law have it."""


def force_on_tool(forces: Pair) -> float:
    """What the arm feels along z1 of forces on the pads [N]."""
    return forces[0] - forces[1]


def sensor_rate(output: float, force: float, bandwidth: float) -> float:
    """ṡ of a sensor: first-order low-pass with bandwidth k_s [rad/s] [N/s]."""
    return bandwidth * (force - output)


def motor_force(gripper: Gripper, asked: float, velocity: float) -> float:
    """Force of the gripper's motor on both fingers together, opening positive [N].

    Args:
        gripper: velocity gain and limits.
        asked: ṙ4, of each finger, opening positive [m/s]; limited to the gripper's speed.
        velocity: ż4 [m/s].
    """
    asked = min(max(asked, -gripper.max_speed), gripper.max_speed)
    force = gripper.velocity_gain * (asked - velocity)
    return 2.0 * min(max(force, -gripper.max_force), gripper.max_force)


def gripper_acceleration(parameters: RobotParameters, asked: float, velocity: float, forces: Pair) -> float:
    """z̈4 under velocity control, with forces on the pads [m/s²]; arguments as for `motor_force`."""
    gripper = parameters.gripper
    moving = 2.0 * (parameters.inertia.finger_mass + gripper.reflected_mass)
    return (forces[0] + forces[1] + motor_force(gripper, asked, velocity)) / moving


def grip_force(gripper: Gripper, asked: float) -> float:
    """What each finger presses with when it has come to rest on an object, ṙ4 k_v4, limited [N]."""
    return -0.5 * motor_force(gripper, asked, 0.0)


def admittance(
    parameters: RobotParameters, mass: float, stiffness: float, damping: float, gain: float, s: complex
) -> complex:
    """A(s) = s (Z1 + Z4) / F of Fig. 5: velocity of a finger over a force on it; the paper leaves the formula out.

        s Z1 / F = s (1/m + k* k_s / (s + k_s)) / (s² + k_v s + k_p),      s Z4 / F = 1 / (2 (m_f + m_r) s + 2 k_v4)

    Args:
        parameters: sensor and gripper.
        mass: m, task-space inertia along z1 [kg].
        stiffness: k_p of z1 [1/s²].
        damping: k_v of z1 [1/s].
        gain: k* [1/kg].
        s: complex frequency [rad/s].

    Returns:
        [m/(N s)].
    """
    sensor, gripper = parameters.tactile.bandwidth, parameters.gripper
    arm = s * (1.0 / mass + gain * sensor / (s + sensor)) / (s * s + damping * s + stiffness)
    moving = 2.0 * (parameters.inertia.finger_mass + gripper.reflected_mass)
    return arm + 1.0 / (moving * s + 2.0 * gripper.velocity_gain)


def least_contact_damping(
    parameters: RobotParameters, mass: float, damping: float, gain: float, contact_stiffness: float
) -> float:
    """Damping that a contact with a fixed object needs, so that the loop with k* does not chatter on it [N s/m].

    The object answers with f = -K z1 - c ż1 at one pad. The loop's polynomial is of third order,

        s³ + (k_s + k_v + c/m) s² + (k_s (k_v + c (1/m + k*)) + k_p + K/m) s + k_s (k_p + K (1/m + k*)),

    and stable (Routh) if the product of the middle coefficients exceeds the last one. Here k_p = 0, as in a soft grasp.

    Args:
        parameters: sensor.
        mass: m, task-space inertia along z1 [kg].
        damping: k_v of z1 [1/s].
        gain: k* [1/kg].
        contact_stiffness: K [N/m].
    """
    k_s, inverse = parameters.tactile.bandwidth, 1.0 / mass
    # Routh's condition as a c² + b c + e > 0
    a = inverse * k_s * (inverse + gain)
    b = (k_s + damping) * k_s * (inverse + gain) + inverse * (k_s * damping + contact_stiffness * inverse)
    e = (k_s + damping) * (k_s * damping + contact_stiffness * inverse)
    e -= k_s * contact_stiffness * (inverse + gain)
    if e > 0.0:
        return 0.0
    return (-b + math.sqrt(b * b - 4.0 * a * e)) / (2.0 * a)
