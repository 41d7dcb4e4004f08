"""Protection below the law and independent of it: pure functions and one table of limits, each with its reason.

What lies outside a limit is refused, stopped, braked or clamped; never silently.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from controller.causes import Cause
from hardware.interfaces import DriveStatus, Measurement, Triple
from hardware.parameters import RobotParameters
from hardware.table import TableSettings


class Violation(NamedTuple):
    """A limit that does not hold: which, the number, the limit, and the offset of the sample it was found in."""

    cause: Cause
    value: float
    limit: float
    offset: int = 0


@dataclass(frozen=True, slots=True)
class Limits:
    """All limits, SI units, base frame. ``WHY`` says of each where it comes from and what happens beyond it."""

    centre: Triple
    half_size: Triple
    reach: float
    speed: float
    downward_speed: float
    near_depth: float
    acceleration: float
    start_position: float
    start_velocity: float
    start_acceleration: float
    position_step: float
    velocity_step: float
    end_velocity: float
    stiffness: float
    damping: float
    tactile_gain: float
    finger_speed: float
    tracking: float
    torque: float
    torque_rate: float


class Why(NamedTuple):
    """Documentation of one limit."""

    unit: str
    reaction: str
    why: str


WHY: dict[str, Why] = {
    "centre": Why("m", "refuse", "middle of the workspace box: over the board, half way up"),
    "half_size": Why("m", "refuse", "board, trays and home lie inside; below it the tool would press into the table"),
    "reach": Why("m", "refuse", "from the base's axis; beyond it the arm comes near its singular poses"),
    "speed": Why(
        "m/s",
        "refuse",
        "contact limit of the tool's speed, with 2 % for rounding: speed decides the force of an impact",
    ),
    "downward_speed": Why(
        "m/s", "refuse", "contact limit near the board, with 2 %: a clamped finger feels at most 140 N"
    ),
    "near_depth": Why("m", "-", "depth z₃ from which the tool counts as near the board"),
    "acceleration": Why(
        "m/s²", "refuse", "the fastest profile has 25 m/s² an axis, 43 together; 40 an axis exceed the peak torque"
    ),
    "start_position": Why("m", "refuse", "a motion must continue the reference: a step would be a blow"),
    "start_velocity": Why("m/s", "refuse", "the reference rests whenever a motion is admitted"),
    "start_acceleration": Why("m/s²", "refuse", "as above"),
    "position_step": Why(
        "m", "refuse", "one tick at the trapezoidal rule errs by 0.1 µm at 1000 m/s³; more is no smooth path"
    ),
    "velocity_step": Why(
        "m/s", "refuse", "lets the acceleration step by 68 m/s², no more; a jump of the speed is a blow"
    ),
    "end_velocity": Why("m/s", "refuse", "the reference rests after a motion: a motion must come to rest by itself"),
    "stiffness": Why("1/s²", "refuse", "ω = 120 rad/s; beyond it the sampled loop loses its margin"),
    "damping": Why("1/s", "refuse", "2ω at 120 rad/s; beyond it encoder noise shakes the arm"),
    "tactile_gain": Why("1/kg", "refuse", "the paper uses 2; the sensor's lag limits what stays stable"),
    "finger_speed": Why("m/s", "refuse", "the gripper's own limit"),
    "tracking": Why(
        "m",
        "stop, then brakes",
        "in free air it is below 0.5 mm, at the softest touch-down 10 mm: something is in the way",
    ),
    "torque": Why("N m", "clamp", "the drives' peak"),
    "torque_rate": Why(
        "N m/tick", "clamp", "half the peak in one tick: no motion and no contact asks for that, a wild law does"
    ),
}


def default_limits(parameters: RobotParameters, table: TableSettings) -> Limits:
    """The limits that follow from the robot and the table.

    Args:
        parameters: drives and gripper.
        table: where the board stands, contact limits.
    """
    x, y, surface = table.centre_in_base
    contact = table.limits
    return Limits(
        centre=(x, y, surface - 0.120),
        half_size=(0.300, 0.260, 0.125),
        reach=0.310,
        speed=1.02 * contact.tool_speed,
        downward_speed=1.02 * contact.downward_speed,
        near_depth=surface - contact.near_height,
        acceleration=45.0,
        start_position=1e-6,
        start_velocity=1e-6,
        start_acceleration=1e-3,
        position_step=2e-5,
        velocity_step=0.03,
        end_velocity=1e-6,
        stiffness=14400.0,
        damping=240.0,
        tactile_gain=10.0,
        finger_speed=parameters.gripper.max_speed,
        tracking=0.015,
        torque=parameters.drive.peak_torque,
        torque_rate=0.5 * parameters.drive.peak_torque,
    )


def check_limits(limits: Limits) -> None:
    """Refuse limits that cannot be meant.

    Raises:
        ValueError: a limit is not finite or not positive.
    """
    for field in fields(limits):
        values = np.atleast_1d(getattr(limits, field.name))
        positive = field.name == "centre" or bool(np.all(values > 0.0))
        if not (np.all(np.isfinite(values)) and positive):
            raise ValueError(
                f"limit {field.name} is {getattr(limits, field.name)}, it must be finite and positive: mend it"
            )


def check_measurement(measurement: Measurement) -> Violation | None:
    """Whether the sensors' numbers are finite."""
    (a, b, c), (d, e, f), (g, h) = measurement.angle, measurement.velocity, measurement.tactile
    # a sum is finite exactly if all terms are (none is near the largest double)
    if math.isfinite(a + b + c + d + e + f + g + h + measurement.finger_position):
        return None
    return Violation(Cause.BAD_MEASUREMENT, math.nan, 0.0)


_DRIVE_TROUBLE = int(DriveStatus.FAULT | DriveStatus.WATCHDOG | DriveStatus.OVERSPEED)


def check_drives(status: int) -> Violation | None:
    """Whether the drives are well; ``status`` is a ``DriveStatus`` as a number."""
    if not status & _DRIVE_TROUBLE:
        return None
    if status & DriveStatus.FAULT:
        return Violation(Cause.DRIVE_FAULT, float(status), 0.0)
    cause = Cause.OVERSPEED if status & DriveStatus.OVERSPEED else Cause.WATCHDOG
    return Violation(cause, float(status), 0.0)


def check_tracking(position: Triple | list[float], reference: Triple | list[float], limit: float) -> Violation | None:
    """Whether the tool is near its reference [m]."""
    error = math.dist(position, reference)
    return None if error <= limit else Violation(Cause.TRACKING, error, limit)


def clamp_torque(torque: Triple, previous: Triple, limit: float, rate: float) -> tuple[Triple, bool]:
    """Torques within ±limit and within ±rate of the previous ones [N m], and whether any had to be changed.

    Args:
        torque: finite torques asked for.
        previous: torques of the tick before.
        limit: the drives' peak.
        rate: largest change in one tick.
    """
    a, b, c = torque
    p, q, r = previous
    clamped = (
        min(max(a, p - rate, -limit), p + rate, limit),
        min(max(b, q - rate, -limit), q + rate, limit),
        min(max(c, r - rate, -limit), r + rate, limit),
    )
    return clamped, clamped != torque
