"""Protection below the law and independent of it: pure functions and one table of limits, each with its reason.

What lies outside a limit is refused, stopped, braked or clamped; never silently.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from enum import IntEnum, unique
from typing import Final, NamedTuple

import numpy as np

from controller.model.compiled import SCALAR, VECTOR, Vector, compiled_as, direct
from controller.model.constants import DeltaModel
from controller.model.kinematics import OK, inverse_kinematics
from controller.model.workspace import workspace
from controller.protocol.causes import Cause
from hardware.interfaces import DriveStatus, Measurement, Triple
from hardware.parameters import RobotParameters
from hardware.table import TableSettings


@unique
class Reaction(IntEnum):
    """What follows from a cause, the mildest first."""

    REFUSE = 0
    """The motion does not begin; under way it is stopped."""
    STOP = 1
    """Controlled, jerk-limited stop, then hold."""
    LET_GO = 2
    """The same, and the fingers open."""
    COMPLIANT = 3
    """No stiffness, gravity and damping only, until the arm rests; then a soft hold, no motions until resume."""
    PROTECTIVE_STOP = 4
    """Controlled stop, then brakes."""
    BRAKE = 5
    """Brakes at once."""


REACTIONS: dict[Cause, Reaction] = {
    Cause.HOLD_COMMAND: Reaction.STOP,
    Cause.STOP_COMMAND: Reaction.STOP,
    Cause.CLIENT_LOST: Reaction.STOP,
    Cause.UNDERRUN: Reaction.STOP,
    Cause.SHUTDOWN: Reaction.STOP,
    Cause.UNKNOWN_EVENT: Reaction.STOP,
    Cause.PARKED: Reaction.STOP,
    Cause.GRIP_LOST: Reaction.STOP,
    Cause.STOP_PRESSED: Reaction.STOP,
    Cause.GRIP_FORCE: Reaction.LET_GO,
    Cause.TACTILE_OVERLOAD: Reaction.LET_GO,
    Cause.TRACKING: Reaction.COMPLIANT,
    Cause.TOOL_SPEED: Reaction.COMPLIANT,
    Cause.TOOL_OUTSIDE: Reaction.COMPLIANT,
    Cause.PRESSING: Reaction.COMPLIANT,
    Cause.RMS_TORQUE: Reaction.PROTECTIVE_STOP,
    Cause.MODEL: Reaction.BRAKE,
    Cause.DRIVE_FAULT: Reaction.BRAKE,
    Cause.WATCHDOG: Reaction.BRAKE,
    Cause.OVERSPEED: Reaction.BRAKE,
    Cause.NOT_ENABLED: Reaction.BRAKE,
    Cause.BAD_MEASUREMENT: Reaction.BRAKE,
    Cause.BAD_TORQUE: Reaction.BRAKE,
    Cause.NOT_AT_REST: Reaction.BRAKE,
    Cause.ENCODER: Reaction.BRAKE,
    Cause.JOINT_SPEED: Reaction.BRAKE,
    Cause.JOINT_RANGE: Reaction.BRAKE,
}
"""By cause; those not named are refusals."""


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
    shared_speed: float
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
    tracking_acceleration: float
    tracking_least: float
    tracking_most: float
    outside: float
    tool_speed: float
    joint_middle: Triple
    joint_range: float
    joint_speed: float
    encoder_jump: float
    encoder_way: float
    press_force: float
    grip_force: float
    force_ticks: int
    tactile: float
    torque: float
    torque_rate: float
    rms_torque: float
    rms_window: float


class Why(NamedTuple):
    """Documentation of one limit."""

    unit: str
    reaction: str
    why: str


WHY: dict[str, Why] = {
    "centre": Why("m", "refuse", "middle of the workspace box: over the board, half way up"),
    "half_size": Why("m", "refuse", "board, trays and home lie inside; below it the tool would press into the table"),
    "reach": Why(
        "m", "refuse", "from the base's axis; beyond it J_c is conditioned worse than 8: singular poses are near"
    ),
    "speed": Why(
        "m/s",
        "refuse",
        "contact limit of the tool's speed, with 2 % for rounding: speed decides the force of an impact",
    ),
    "shared_speed": Why(
        "m/s", "slow down", "contact limit where a person may be near, with 2 %; beyond it only where nobody is seen"
    ),
    "downward_speed": Why(
        "m/s", "refuse", "contact limit near the board, with 2 %: a clamped finger feels at most 140 N"
    ),
    "near_depth": Why("m", "-", "depth z₃ from which the tool counts as near the board"),
    "acceleration": Why(
        "m/s²", "refuse", "the fastest profile has 18 m/s² per axis, 31 in total; 40 per axis exceeds the peak torque"
    ),
    "start_position": Why("m", "refuse", "a motion must continue the reference: a step would be an impact"),
    "start_velocity": Why("m/s", "refuse", "the reference rests whenever a motion is admitted"),
    "start_acceleration": Why("m/s²", "refuse", "as above"),
    "position_step": Why(
        "m",
        "refuse",
        "one tick at the trapezoidal rule errs by 0.1 µm at 1000 m/s³; a larger step is not a smooth path",
    ),
    "velocity_step": Why(
        "m/s", "refuse", "lets the acceleration step by 68 m/s², no more; a jump in speed is an impact"
    ),
    "end_velocity": Why("m/s", "refuse", "the reference rests after a motion: a motion must come to rest by itself"),
    "stiffness": Why("1/s²", "refuse", "ω = 120 rad/s; beyond it the sampled loop loses its margin"),
    "damping": Why("1/s", "refuse", "2ω at 120 rad/s; beyond it encoder noise shakes the arm"),
    "tactile_gain": Why("1/kg", "refuse", "the paper uses 2; the sensor's lag limits what stays stable"),
    "finger_speed": Why("m/s", "refuse", "the gripper's own limit"),
    "tracking_acceleration": Why(
        "m/s²",
        "compliant",
        "k_p times the error along an axis: 13 N at 1.08 kg; 2.4 mm in the air, where 0.5 mm is usual",
    ),
    "tracking_least": Why("m", "-", "an axis, however stiff, may be this far from its reference"),
    "tracking_most": Why("m", "compliant", "an axis, however soft, may be no farther off: a touch-down needs 10 mm"),
    "outside": Why("m", "compliant", "beyond the workspace box: a controlled stop near its border ends within 25 mm"),
    "tool_speed": Why(
        "m/s",
        "compliant",
        "measured; the fastest reference plus its tracking error: beyond it something else moves the tool",
    ),
    "joint_middle": Why(
        "rad", "-", "servomotor angles with the tool in the middle of the workspace box over the default board"
    ),
    "joint_range": Why(
        "rad",
        "brakes",
        "to either side, where the stops are; at the places of all boards that fit, angles are below 2.0 rad",
    ),
    "joint_speed": Why("rad/s", "brakes", "fast moves reach 9.3 rad/s; the drives' own limit is 20"),
    "encoder_jump": Why("rad", "brakes", "between an angle's step and its own velocity; counts are 1.5 µrad"),
    "encoder_way": Why(
        "rad",
        "brakes",
        "commanded without one count of change, while another servomotor moves as commanded: 13,000 counts",
    ),
    "press_force": Why(
        "N", "compliant", "a person's hand tolerates far more; no planned motion presses this hard for this long"
    ),
    "grip_force": Why("N", "let go", "the gripper's motor gives 12 N; a piece is held with 5"),
    "force_ticks": Why("ticks", "-", "0.3 s: how long either may last"),
    "tactile": Why("N", "let go", "beyond what the sensors measure; two fingers' motor cannot cause it"),
    "torque": Why("N m", "clamp", "the drives' peak"),
    "torque_rate": Why(
        "N m/tick", "clamp", "half the peak in one tick: no motion and no contact needs that, only a faulty law does"
    ),
    "rms_torque": Why("N m", "stop, then brakes", "the rating of the servomotors: more overheats them"),
    "rms_window": Why("s", "-", "time constant of the mean, short against the motors' thermal one"),
}


def default_limits(parameters: RobotParameters, table: TableSettings) -> Limits:
    """The limits that follow from the robot and the table.

    Args:
        parameters: drives and gripper.
        table: where the board stands, contact limits.
    """
    room, surface, contact = workspace(parameters, table), table.centre_in_base[2], table.limits
    joint_middle(parameters, room.centre)  # a workspace whose middle is out of reach has no limits
    return Limits(
        centre=room.centre,
        half_size=room.half_size,
        reach=room.reach,
        speed=1.02 * contact.tool_speed,
        shared_speed=1.02 * (contact.shared_tool_speed or contact.tool_speed),
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
        tracking_acceleration=12.0,
        tracking_least=0.002,
        tracking_most=0.015,
        outside=0.030,
        tool_speed=1.25 * contact.tool_speed + 0.2,
        joint_middle=joint_middle(parameters, workspace(parameters, TableSettings()).centre),
        joint_range=2.2,
        joint_speed=14.0,
        encoder_jump=0.01,
        encoder_way=0.02,
        press_force=30.0,
        grip_force=15.0,
        force_ticks=round(0.3 / parameters.drive.tick),
        tactile=40.0,
        torque=parameters.drive.peak_torque,
        torque_rate=0.5 * parameters.drive.peak_torque,
        rms_torque=parameters.drive.rated_torque,
        rms_window=10.0,
    )


def joint_middle(parameters: RobotParameters, point: Triple) -> Triple:
    """Servomotor angles with the tool at a point, base frame [rad].

    Raises:
        ValueError: the arm does not reach it.
    """
    angles = np.empty(3)
    status, arm = inverse_kinematics(DeltaModel(parameters).constants, point, angles, np.empty(6))
    if status != OK:
        raise ValueError(f"the middle of the workspace {point} m is out of reach of arm {arm + 1}: move the board")
    a, b, c = angles.tolist()
    return a, b, c


def check_limits(limits: Limits) -> None:
    """Refuse limits that cannot be meant.

    Raises:
        ValueError: a limit is not finite or not positive.
    """
    for field in fields(limits):
        values = np.atleast_1d(getattr(limits, field.name))
        positive = field.name in ("centre", "joint_middle") or bool(np.all(values > 0.0))
        if not (np.all(np.isfinite(values)) and positive):
            raise ValueError(
                f"limit {field.name} is {getattr(limits, field.name)}, it must be finite and positive: correct it"
            )


def check_measurement(measurement: Measurement) -> Violation | None:
    """Whether the sensors' numbers are finite."""
    (a, b, c), (d, e, f), (g, h) = measurement.angle, measurement.velocity, measurement.tactile
    # a sum is finite exactly if all terms are (none is near the largest double)
    if math.isfinite(a + b + c + d + e + f + g + h + measurement.finger_position):
        return None
    return Violation(Cause.BAD_MEASUREMENT, math.nan, 0.0)


DRIVE_TROUBLE: Final = int(DriveStatus.FAULT | DriveStatus.WATCHDOG | DriveStatus.OVERSPEED)
"""What the drives say where they no longer follow."""


def check_drives(status: int) -> Violation | None:
    """Whether the drives are well; ``status`` is a ``DriveStatus`` as a number."""
    if not status & DRIVE_TROUBLE:
        return None
    if status & DriveStatus.FAULT:
        return Violation(Cause.DRIVE_FAULT, float(status), 0.0)
    cause = Cause.OVERSPEED if status & DriveStatus.OVERSPEED else Cause.WATCHDOG
    return Violation(cause, float(status), 0.0)


def check_tracking(
    position: list[float], reference: list[float], stiffness: list[float], limits: Limits
) -> Violation | None:
    """Whether the tool is near its reference along each axis, nearer where the gain is high.

    Args:
        position: of the tool, measured, base frame [m].
        reference: of the same [m].
        stiffness: k_p of each axis [1/s²].
        limits: the error may be tracking_acceleration / k_p, but at least and at most so much.
    """
    for is_at, should, gain in zip(position, reference, stiffness, strict=True):
        error = abs(is_at - should)
        if error <= limits.tracking_least:
            continue
        allowed = max(limits.tracking_least, min(limits.tracking_most, limits.tracking_acceleration / max(gain, 1.0)))
        if not error <= allowed:
            return Violation(Cause.TRACKING, error, allowed)
    return None


def check_joints(measurement: Measurement, limits: Limits) -> Violation | None:
    """Whether the servomotors turn slowly enough and stand within their range."""
    for speed in measurement.velocity:
        if not abs(speed) <= limits.joint_speed:
            return Violation(Cause.JOINT_SPEED, abs(speed), limits.joint_speed)
    for angle, middle in zip(measurement.angle, limits.joint_middle, strict=True):
        if not abs(angle - middle) <= limits.joint_range:
            return Violation(Cause.JOINT_RANGE, angle, limits.joint_range)
    return None


def axis_beyond(position: list[float], limits: Limits) -> float:
    """How far a point (3,) lies outside the workspace box along its worst axis; negative inside [m]."""
    (x, y, z), (a, b, c), (p, q, r) = position, limits.centre, limits.half_size
    return max(abs(x - a) - p, abs(y - b) - q, abs(z - c) - r) + 0.0 * (x + y + z)  # max may overlook a NaN


def nearest_inside(position: list[float], limits: Limits) -> Triple:
    """The point of the workspace, box and reach, that is nearest to a point (3,), base frame [m]."""
    x, y, z = (
        min(max(at, centre - half), centre + half)
        for at, centre, half in zip(position, limits.centre, limits.half_size, strict=True)
    )
    back = min(1.0, limits.reach / max(math.hypot(x, y), limits.reach))
    return x * back, y * back, z


@compiled_as(VECTOR(VECTOR, VECTOR, SCALAR, SCALAR))
def clamp(torque: Vector, previous: Vector, limit: float, rate: float) -> Vector:
    """Torques within ±limit and within ±rate of the previous ones; see `clamp_torque`."""
    a, b, c = torque
    p, q, r = previous
    return (
        min(max(a, p - rate, -limit), p + rate, limit),
        min(max(b, q - rate, -limit), q + rate, limit),
        min(max(c, r - rate, -limit), r + rate, limit),
    )


_clamp: Final = direct(clamp)


def clamp_torque(torque: Triple, previous: Triple, limit: float, rate: float) -> tuple[Triple, bool]:
    """Torques within ±limit and within ±rate of the previous ones [N m], and whether any had to be changed.

    Args:
        torque: finite torques asked for.
        previous: torques of the tick before.
        limit: the drives' peak.
        rate: largest change in one tick.
    """
    clamped = _clamp(torque, previous, limit, rate)
    return clamped, clamped != torque
