"""Drives, gripper and fingers, with the brakes closed all the time: nothing moves, and nothing needs to be known of the
controller.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from app.commissioning.check_report import Finding, Judge
from app.motion.path import Vector
from controller.law.task_space import TaskSpaceController
from controller.loop.realtime import set_up_real_time
from controller.model.constants import DeltaModel
from controller.settings import ControllerSettings
from hardware.drives.faults import status_words
from hardware.interfaces import BusLost, Command, DriveStatus, Measurement, ServoBus
from hardware.parameters import RobotParameters
from hardware.table import TableSettings

DURATION: Final = 1.0  # how long the drives are listened to [s of plant time]
SETTLING: Final = 0.5  # before that, as a share of it
PERIOD_TOLERANCE: Final = 0.02  # of the tick's length
LOST_TICKS: Final = 0.05  # share of ticks that may go by without an exchange: one pause of a PC that does much else
STILL: Final = 0.01  # closed brakes hold the servomotors below this [rad/s]
_WINDOW: Final = 20  # ticks over whose mean velocities count: an encoder that flickers does not move
NOISE_COUNTS: Final = 4.0  # standard deviation of an encoder at rest [counts]
FINGER_TOLERANCE: Final = 0.001  # beyond its stroke [m]
TACTILE_OFFSET: Final = 0.5
TACTILE_NOISE: Final = 0.2
"""Of a finger that holds nothing [N]."""
SILENCE: Final = 5.0  # how long nothing is said to try the drives' watchdog, in its own times
_SWITCHING: Final = 0.5  # amplifiers go on or off within this [s]
_LEAST_EXCHANGES: Final = 20  # and are listened to for so many exchanges
_HALVINGS: Final = 4  # of twice its time, until it is known when it bites
BELOW_BOARD: Final = 0.02  # the tool cannot be deeper than so far below the playing surface [m]

_REST: Final = Command((0.0, 0.0, 0.0), 0.0, brake=True, enable=False, busy=True)
_POWERED: Final = Command((0.0, 0.0, 0.0), 0.0, brake=True, enable=True, busy=True)


@dataclass(frozen=True, slots=True)
class Heard:
    """What the drives said for a while; one row a fresh tick."""

    wall: float  # how long it took [s]
    ticks: Vector  # tick numbers, (n,)
    angle: Vector  # (n, 3) [rad]
    velocity: Vector  # (n, 3) [rad/s]
    finger: Vector  # (n,) [m]
    tactile: Vector  # (n, 2) [N]
    status: DriveStatus  # of the last one


def check_drives(
    open_bus: Callable[[RobotParameters], ServoBus],
    parameters: RobotParameters,
    table: TableSettings,
    settings: ControllerSettings,
) -> list[Finding]:
    """Listen to the drives on their brakes, then see whether they notice silence; in such real time as the settings of
    their controller ask for.

    Raises:
        HardwareError: they cannot be opened.
    """
    bus = open_bus(parameters)
    try:
        with set_up_real_time(settings, bus):
            return check_bus(bus, parameters, table)
    finally:
        bus.close()


def check_bus(bus: ServoBus, parameters: RobotParameters, table: TableSettings) -> list[Finding]:
    """As ``check_drives``, of a bus that is open; it is left on its brakes."""
    drives = Judge("drives")
    try:
        heard = _listen(bus, round(DURATION / bus.period))
        _judge_time(drives, bus, heard)
        _judge_status(drives, heard)
        _judge_encoders(drives, heard, parameters)
        _judge_pose(drives, heard, parameters, table)
        _judge_watchdog(drives, bus, parameters)
        gripper = _judge_gripper(heard, parameters)
    except BusLost as error:
        drives.wrong("connection", str(error), "check their power and cables, then try again")
        return drives.findings
    return drives.findings + gripper


def _listen(bus: ServoBus, ticks: int) -> Heard:
    first = bus.exchange(_REST).tick
    while (begin := bus.exchange(_REST)).tick - first < ticks * SETTLING:
        pass  # brakes that have just closed give a little
    said = [begin]
    since = time.perf_counter()
    while said[-1].tick - said[0].tick < ticks:
        measured = bus.exchange(_REST)
        if measured.tick != said[-1].tick:
            said.append(measured)
    wall = time.perf_counter() - since
    return Heard(
        wall, _column(said, "tick"), _column(said, "angle"), _column(said, "velocity"),
        _column(said, "finger_position"), _column(said, "tactile"), said[-1].status,
    )  # fmt: skip


def _column(said: Sequence[Measurement], name: str) -> Vector:
    return np.array([getattr(one, name) for one in said], dtype=float)


def _judge_time(drives: Judge, bus: ServoBus, heard: Heard) -> None:
    passed = heard.ticks[-1] - heard.ticks[0]
    if bus.lockstep:
        drives.left_out("tick", "plant time waits for its controller here (pace fast)")
        return
    period = heard.wall / passed
    drives.judge(
        "tick", f"{1e3 * period:.3f} ms, {1e3 * bus.period:.3f} ms stated",
        abs(period / bus.period - 1.0) <= PERIOD_TOLERANCE,
        "set the motion board's interrupt to the stated period, or state its own in the parameters' drive.tick",
    )  # fmt: skip
    lost = 1.0 - (len(heard.ticks) - 1) / passed
    drives.judge(
        "missed ticks", f"{100.0 * lost:.2f} %", lost <= LOST_TICKS,
        "end other programs on this PC; 'touchmove link-test' tells you more",
    )  # fmt: skip


def _judge_status(drives: Judge, heard: Heard) -> None:
    status = heard.status
    on_brakes = bool(status & DriveStatus.BRAKED) and not status & (DriveStatus.FAULT | DriveStatus.ENABLED)
    drives.judge(
        "status", status_words(status), on_brakes,
        "read the fault on the amplifiers' displays; while disabled, they must be on their brakes",
    )  # fmt: skip


def _judge_encoders(drives: Judge, heard: Heard, parameters: RobotParameters) -> None:
    if not np.isfinite(heard.angle).all() or not np.isfinite(heard.velocity).all():
        drives.wrong("encoders", "their readings are not numbers", "check the encoders' cables")
        return
    window = np.full(_WINDOW, 1.0 / _WINDOW)
    fastest = max(float(np.abs(np.convolve(one, window, "valid")).max()) for one in heard.velocity.T)
    drives.judge(
        "brakes", f"servomotors move by up to {fastest:.4f} rad/s", fastest <= STILL,
        "the brakes do not hold, or a person moves the arm: check the brakes before anything else",
    )  # fmt: skip
    # from tick to tick, since brakes may give slowly
    jumps = float(np.diff(heard.angle, axis=0).std(axis=0).max()) / np.sqrt(2.0)
    counts = jumps * 2.0**parameters.drive.encoder_bits / (2.0 * np.pi)
    drives.judge(
        "encoders", f"noise {counts:.1f} counts of {parameters.drive.encoder_bits} bit", counts <= NOISE_COUNTS,
        "check shield and earth of the encoders' cables",
    )  # fmt: skip


def _judge_pose(drives: Judge, heard: Heard, parameters: RobotParameters, table: TableSettings) -> None:
    law = TaskSpaceController(DeltaModel(parameters))
    a, b, c = heard.angle.mean(axis=0).tolist()
    said = f"servomotors at {np.degrees(a):.1f}°, {np.degrees(b):.1f}°, {np.degrees(c):.1f}°"
    advice = "set the encoders' zero where each proximal link is horizontal, and their sign so that down is positive"
    if law.update((a, b, c), (0.0, 0.0, 0.0)) != 0:
        drives.wrong("pose", f"{said}: no tool point exists for them", advice)
        return
    x, y, height = table.board_from_base(law.state.position).tolist()
    drives.judge(
        "pose", f"{said}: tool {1e3 * height:.0f} mm above the board, at ({1e3 * x:.0f}, {1e3 * y:.0f}) mm",
        height > -BELOW_BOARD, f"the tool would be in the table: {advice}; or correct centre_in_base in the rig file",
    )  # fmt: skip


def _judge_watchdog(drives: Judge, bus: ServoBus, parameters: RobotParameters) -> None:
    """Amplifiers on, brakes closed, no torque; then say nothing."""
    if bus.lockstep:
        drives.left_out("watchdog", "plant time waits for its controller here (pace fast)")
        return
    powered = _switch(bus, _POWERED, on=True)
    if not powered.status & DriveStatus.ENABLED:
        bus.exchange(_REST)
        drives.wrong("watchdog", "the amplifiers do not switch on", "check their enable line and emergency stop")
        return
    limit = parameters.drive.watchdog_ticks * bus.period
    advice = (
        f"the drives must brake by themselves {1e3 * limit:.0f} ms after the last command: nothing above them does it"
    )
    if not _bites(bus, SILENCE * limit):
        drives.wrong("watchdog", f"it does not trip within {1e3 * SILENCE * limit:.0f} ms of silence", advice)
    else:
        bears, bites = _bite_time(bus, 2.0 * limit)
        drives.judge(
            "watchdog",
            f"trips after {1e3 * bears:.0f} to {1e3 * bites:.0f} ms of silence, {1e3 * limit:.0f} ms stated",
            bites <= 2.0 * limit and bears > 0.0, advice,
        )  # fmt: skip
    _judge_disable(drives, bus)


def _switch(bus: ServoBus, command: Command, *, on: bool) -> Measurement:
    """Ask for amplifiers on or off until they are, or have had time enough; the last measurement."""
    for exchange in range(round(_SWITCHING / bus.period)):
        said = bus.exchange(command)
        if exchange >= _LEAST_EXCHANGES and bool(said.status & DriveStatus.ENABLED) is on:
            break
    return said


def _bites(bus: ServoBus, silence: float) -> bool:
    """Whether amplifiers that are on, brakes closed, switch off after so long a silence [s]; they are off then."""
    for exchange in range(round(_SWITCHING / bus.period)):  # what bit before has to be over
        said = bus.exchange(_REST)
        if exchange >= _LEAST_EXCHANGES and not said.status & (DriveStatus.WATCHDOG | DriveStatus.FAULT):
            break
    _switch(bus, _POWERED, on=True)
    time.sleep(silence)
    after = bus.exchange(_POWERED)
    bus.exchange(_REST)
    return bool(after.status & DriveStatus.WATCHDOG) and not after.status & DriveStatus.ENABLED


def _bite_time(bus: ServoBus, longest: float) -> tuple[float, float]:
    """Between which silences the watchdog begins to bite [s]; the second is infinite where ``longest`` is too short."""
    if not _bites(bus, longest):
        return longest, math.inf
    low, high = 0.0, longest
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if _bites(bus, middle) else (middle, high)
    return low, high


def _judge_disable(drives: Judge, bus: ServoBus) -> None:
    """What STOP ends with: amplifiers off, brakes on."""
    _switch(bus, _POWERED, on=True)
    off = _switch(bus, _REST, on=False)
    drives.judge(
        "switching off", status_words(off.status),
        bool(off.status & DriveStatus.BRAKED) and not off.status & DriveStatus.ENABLED,
        "a drive that is disabled must close its brake: check the brakes' relay",
    )  # fmt: skip


def _judge_gripper(heard: Heard, parameters: RobotParameters) -> list[Finding]:
    gripper, stroke, finger = Judge("gripper"), parameters.gripper.stroke, float(heard.finger.mean())
    gripper.judge(
        "fingers", f"{1e3 * finger:.1f} mm from the middle, stroke {1e3 * stroke:.0f} mm",
        -FINGER_TOLERANCE <= finger <= stroke + FINGER_TOLERANCE,
        "find the gripper's zero again: both pads touch where it reads 0",
    )  # fmt: skip
    mean, noise = heard.tactile.mean(axis=0), heard.tactile.std(axis=0)
    holding = min(mean) > TACTILE_OFFSET
    for side, offset, spread in zip(("right", "left"), mean.tolist(), noise.tolist(), strict=True):
        what = f"{side} pad"
        if holding:
            gripper.left_out(what, f"{offset:.2f} N: the fingers hold something")
            continue
        gripper.judge(
            what, f"{offset:.2f} N ± {spread:.2f} N, holding nothing",
            abs(offset) <= TACTILE_OFFSET and spread <= TACTILE_NOISE,
            "take everything out of the fingers and set the sensor's zero; check its cable if it is noisy",
        )  # fmt: skip
    dead = heard.tactile.min(axis=0) == heard.tactile.max(axis=0)
    if dead.any() and not dead.all():  # both: there are none, or the simulation is ideal
        side = "right" if dead[0] else "left"
        gripper.wrong(
            f"{side} sensor", f"says {mean[0 if dead[0] else 1]:.2f} N in every tick; the other one flickers",
            "it is dead: check its cable and amplifier",
        )  # fmt: skip
    return gripper.findings
