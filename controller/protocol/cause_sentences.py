"""What people are told of a refusal, a stop or a fault of the controller: a sentence for each cause."""

from __future__ import annotations

from collections.abc import Callable

from controller.protocol.causes import Cause
from controller.protocol.states import Event, State
from hardware.interfaces import DriveStatus, DriveTrouble, fault_of

_SENTENCES: dict[Cause, str] = {
    Cause.NONE: "nothing is wrong",
    Cause.LATE: "the motion was to start at tick {value:.0f}, but tick {limit:.0f} has already begun:"
    " announce it further ahead",
    Cause.TOO_EARLY: "the motion was to start {value:.0f} ticks ahead, at most {limit:.0f} are accepted:"
    " announce it later",
    Cause.LENGTH: "a motion of {value:.0f} samples was announced, 1 to {limit:.0f} are accepted: split it",
    Cause.OCCUPIED: "motion {value:.0f} is still under way: wait for its end or stop it first",
    Cause.NOT_HOLDING: "the controller is in state {word}, motions are admitted only in state HOLD: wait for it",
    Cause.NOT_ADMITTED: "a hold is in force: send resume before the next motion",
    Cause.START_POSITION: "the motion starts {value:.3g} m from the present reference,"
    " at most {limit:.3g} m is accepted: plan from the reference in the telemetry",
    Cause.START_VELOCITY: "the motion starts with {value:.3g} m/s, at most {limit:.3g} m/s is accepted: start at rest",
    Cause.START_ACCELERATION: "the motion starts with {value:.3g} m/s², at most {limit:.3g} m/s² is accepted:"
    " start at rest",
    Cause.NOT_FINITE: "sample {value:.0f} holds a number that is not finite: fix the planner",
    Cause.WORKSPACE: "a sample lies {value:.4f} m from the middle of the workspace box along one axis,"
    " at most {limit:.4f} m is accepted: plan inside the box",
    Cause.REACH: "a sample lies {value:.4f} m from the base's axis, at most {limit:.4f} m is accepted:"
    " plan inside the reach",
    Cause.SPEED: "a sample asks for {value:.3f} m/s, at most {limit:.3f} m/s is accepted: slow the motion down",
    Cause.DOWNWARD_SPEED: "a sample goes down at {value:.3f} m/s near the board, at most {limit:.3f} m/s is accepted:"
    " slow the descent down",
    Cause.ACCELERATION: "a sample asks for {value:.2f} m/s², at most {limit:.2f} m/s² is accepted:"
    " slow the motion down",
    Cause.POSITION_STEP: "positions jump by {value:.3g} m beyond what their velocities say,"
    " at most {limit:.3g} m is accepted: sample one continuous path once per tick",
    Cause.VELOCITY_STEP: "velocities jump by {value:.3g} m/s beyond what their accelerations say,"
    " at most {limit:.3g} m/s is accepted: sample one continuous path once per tick",
    Cause.STIFFNESS: "a stiffness of {value:.4g} 1/s² was requested, 0 to {limit:.4g} 1/s² are accepted:"
    " choose softer gains",
    Cause.DAMPING: "a damping of {value:.4g} 1/s was requested, 0 to {limit:.4g} 1/s are accepted: choose softer gains",
    Cause.TACTILE_GAIN: "a tactile gain of {value:.3g} 1/kg was requested, 0 to {limit:.3g} 1/kg are accepted: lower "
    "it",
    Cause.FINGER_SPEED: "a finger velocity of {value:.3f} m/s was requested, at most {limit:.3f} m/s is accepted:"
    " slow down the fingers",
    Cause.GUARD: "guard {value:.0f} is not known, 0 to {limit:.0f} are, each with a level of at least 0 N:"
    " fix the planner",
    Cause.ENDS_MOVING: "the motion ends with {value:.3g} m/s, at most {limit:.3g} m/s is accepted: end at rest",
    Cause.HOLD_COMMAND: "a hold was commanded: send resume, then plan again from the reference in the telemetry",
    Cause.STOP_COMMAND: "a stop was commanded: plan again from the reference in the telemetry",
    Cause.CLIENT_LOST: "the client was silent for {value:.2f} s, at most {limit:.2f} s is accepted: connect again",
    Cause.UNDERRUN: "sample {value:.0f} was due, but only {limit:.0f} had arrived:"
    " send further ahead or use a better network",
    Cause.SHUTDOWN: "the controller is shutting down: start it again",
    Cause.UNKNOWN_EVENT: "event {word} is not expected in state {limit:.0f}: report this as a defect",
    Cause.PARKED: "no client was connected for {value:.1f} s, at most {limit:.1f} s is accepted, so the arm is on its"
    " brakes: send enable",
    Cause.GRIP_LOST: "a pad felt {value:.2f} N from the piece in the fingers, at least {limit:.2f} N was expected: "
    "look where it has gone",
    Cause.STOP_PRESSED: "somebody pressed STOP: say 'go' when the arm may move again",
    Cause.TRACKING: "the tool was {value:.4f} m from its reference along one axis, at most {limit:.4f} m is accepted:"
    " check what stands in its way, then send resume",
    Cause.MODEL: "the kinematics failed with status {value:.0f} (1 singular, 2 not converged, 3 unreachable):"
    " compare the arm's geometry with the parameters",
    Cause.DRIVE_FAULT: "{word}, then clear the fault",
    Cause.WATCHDOG: "the drives braked because no command came in time ({word}): clear the fault",
    Cause.OVERSPEED: "a servomotor exceeded its speed limit ({word}): clear the fault",
    Cause.NOT_ENABLED: "the drives did not enable within {limit:.0f} ticks ({word}):"
    " check their power and safety circuit",
    Cause.BAD_MEASUREMENT: "a measurement is not finite: check the encoders and sensors, then clear the fault",
    Cause.BAD_TORQUE: "the law gave a torque that is not finite: report this as a defect, then clear the fault",
    Cause.ENCODER: "the encoder of servomotor {value:.0f} contradicts itself or stands still while the others move:"
    " check its cable, then clear the fault",
    Cause.JOINT_SPEED: "a servomotor turned at {value:.2f} rad/s, at most {limit:.2f} rad/s is accepted:"
    " check what drove it, then clear the fault",
    Cause.JOINT_RANGE: "a servomotor stood at {value:.3f} rad, and its range ends {limit:.3f} rad from the middle:"
    " move the arm back by hand with the brakes open, then clear the fault",
    Cause.TOOL_SPEED: "the tool moved at {value:.3f} m/s, at most {limit:.3f} m/s is accepted:"
    " check what drove it, then send resume",
    Cause.TOOL_OUTSIDE: "the tool was {value:.4f} m outside the workspace, at most {limit:.4f} m is accepted:"
    " check what pushed it there, then send resume",
    Cause.PRESSING: "the arm pressed with {value:.1f} N for too long, at most {limit:.1f} N is accepted:"
    " check what is in its way, then send resume",
    Cause.GRIP_FORCE: "the fingers gripped with {value:.1f} N for too long, at most {limit:.1f} N is accepted:"
    " check what is between them, then send resume",
    Cause.TACTILE_OVERLOAD: "a tactile sensor felt {value:.1f} N, at most {limit:.1f} N is accepted:"
    " check what is between the fingers, then send resume",
    Cause.RMS_TORQUE: "a servomotor gave {value:.2f} N m on average over the window, {limit:.2f} N m is its rating:"
    " let it cool, then clear the fault and move more slowly",
    Cause.NOT_AT_REST: "the arm still moved at {value:.3f} rad/s after {limit:.0f} ticks on its brakes: check the "
    "brakes",
}


_FLAGS = (1 << len(DriveStatus)) - 1
_DEVICES = (
    "the bus",
    "servomotor 1",
    "servomotor 2",
    "servomotor 3",
    "the gripper",
    "a sensor",
    "a device",
    "a device",
)


def _drives(value: float) -> str:
    return DriveStatus(int(value) & _FLAGS).name or "OK"


def _drive_fault(value: float) -> str:
    """What a fault is of, in words, and what to do."""
    device, trouble = fault_of(int(value))
    if trouble is DriveTrouble.UNSPECIFIED:
        return f"a drive reports a fault ({_drives(value)}): read its display"
    return f"{_DEVICES[device]} {trouble.words}: {trouble.remedy}"


_WORDS: dict[Cause, Callable[[float], str]] = {
    Cause.NOT_HOLDING: lambda value: State(int(value)).name,
    Cause.UNKNOWN_EVENT: lambda value: Event(int(value)).name,
    Cause.DRIVE_FAULT: _drive_fault,
    Cause.WATCHDOG: _drives,
    Cause.OVERSPEED: _drives,
    Cause.NOT_ENABLED: _drives,
}
"""Causes whose value is a number of an enum."""


def template(cause: Cause) -> str:
    """The sentence of a cause with places for its value, its limit and a word."""
    return _SENTENCES[cause]


def explain(cause: Cause, value: float = 0.0, limit: float = 0.0) -> str:
    """One clear sentence: what happened, the value and its limit, the next step."""
    word = _WORDS.get(cause)
    return _SENTENCES[cause].format(value=value, limit=limit, word=word(value) if word else "")
