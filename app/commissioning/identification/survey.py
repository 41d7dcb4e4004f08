"""The arm carries out the motion that shows what it weighs, and the controller's record of it is fetched.

The motion goes the way of every other: planned, checked, streamed, and kept within its limits by the controller. It
stays higher than the tallest piece, so that the board may be set up or empty, and is stopped as any motion is.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from app.commissioning.identification.excitation import Borders, Excitation, find_excitation
from app.commissioning.identification.recording import JointRecord, NoRecord, load_record
from app.motion import Motion, MotionSettings, Plan, Planner
from app.motion.gain_schedule import critical
from app.motion.timing.reference import Segment, to_samples
from app.rig.devices import Rig
from controller.loop.flight import RECORD_NAME
from controller.protection.limits import default_limits
from controller.protocol.messages import Telemetry
from controller.settings import CONTROLLER_FILE
from controller.wire.client import ControllerClient
from hardware.parameters import RobotParameters
from hardware.piece_set import PIECE_SHAPES
from hardware.table import TableSettings

DURATION: Final = 24.0
"""Of the motion [s]; the controller remembers 30 s."""
SPEED_SHARE: Final = 0.75
"""Of what the contact limits admit: the arm is not known yet."""
ACCELERATION: Final = 10.0
"""[m/s²]; the default profile has 15 along each axis."""
TORQUE_SHARE: Final = 0.6
RMS_SHARE: Final = 0.75
"""Of peak and rated torque, by what is believed of the robot."""
FREQUENCY: Final = 70.0
"""Of the gains [rad/s], as in the air of every motion."""
_CLEAR: Final = 0.012  # between pads and the tallest piece [m]
_INSIDE: Final = 0.02  # the workspace's own borders [m]
_FILE_PATIENCE: Final = 10.0  # for the record to be written [s, wall]

Progress = Callable[[str], None]


class Meter:
    """How far the motion has come; a listener of telemetry that tells somebody [s]."""

    def __init__(self, tell: Callable[[float, float], None]) -> None:
        self._tell, self._length = tell, 0.0

    def begin(self, duration: float) -> None:
        """The motion that counts comes next; it takes so long [s]."""
        self._length = duration

    def end(self) -> None:
        """It is over."""
        self._tell(self._length, self._length)
        self._length = 0.0

    def __call__(self, telemetry: Telemetry, period: float) -> None:
        """Take telemetry in, with ticks of a period [s]."""
        if self._length and telemetry.motion:
            self._tell(min(self._length, telemetry.executed * period), self._length)


def borders_of(parameters: RobotParameters, table: TableSettings) -> Borders:
    """Within which the tool may swing over a table."""
    limits = default_limits(parameters, table)
    centre, half = np.array(limits.centre), np.array(limits.half_size) - _INSIDE
    tallest = max(shape.height for shape in PIECE_SHAPES.values()) + parameters.pads.half_height + _CLEAR
    lowest = float(table.base_from_board(np.array([0.0, 0.0, tallest]))[2])
    low, high = centre - half, centre + half
    high[2] = min(high[2], lowest, limits.near_depth - 0.002)
    (a, b, c), (d, e, f) = low.tolist(), high.tolist()
    return Borders(
        (a, b, c), (d, e, f), limits.reach - _INSIDE, SPEED_SHARE * table.limits.tool_speed, ACCELERATION,
        TORQUE_SHARE * parameters.drive.peak_torque, RMS_SHARE * parameters.drive.rated_torque,
    )  # fmt: skip


def exciting_motion(excitation: Excitation, tick: float) -> Motion:
    """The samples, a tick apart [s]."""
    table = excitation.sampled(tick)
    gains = critical((FREQUENCY,) * 3, len(table))
    samples = to_samples(Segment(table), gains, np.zeros(len(table)))
    samples.flags.writeable = False
    return Motion("exciting motion", samples, excitation.duration)


def survey(
    rig: Rig, client: ControllerClient, parameters: RobotParameters, table: TableSettings, run_dir: Path,
    progress: Progress, meter: Meter | None = None, duration: float = DURATION,
) -> tuple[JointRecord, Excitation]:  # fmt: skip
    """Let the arm show what it weighs, and bring it home.

    Raises:
        NoRecord: the controller's record is not to be had here.
        UserError, ControllerError: the motion was refused or stopped; the arm rests.
    """
    motion_settings = MotionSettings().at(table)
    progress("searching for the most informative motion")
    excitation = find_excitation(parameters, borders_of(parameters, table), duration)
    x, y, z = excitation.middle.tolist()
    _go(rig, motion_settings.model_copy(update={"home": (x, y, z)}), parameters, table, "to the middle")
    motion = exciting_motion(excitation, client.period)
    if meter is not None:
        meter.begin(excitation.duration)
    rig.arm.execute(Plan(motion.label, (motion,)))
    if meter is not None:
        meter.end()
    done = rig.arm.last_motion
    path = fetch_record(client, run_dir)
    _go(rig, motion_settings, parameters, table, "home")
    return load_record(path, done), excitation


def _go(rig: Rig, settings: MotionSettings, parameters: RobotParameters, table: TableSettings, label: str) -> None:
    """Over everything to the place that the settings call home."""
    state = rig.arm.state()
    if np.linalg.norm(state.reference - np.array(settings.home)) < 1e-6:
        return
    plan = Planner.of(settings, parameters, table, state.reference, state.finger).home()
    rig.arm.execute(Plan(label, tuple(replace(one, label=label) for one in plan.motions)))


def fetch_record(client: ControllerClient, run_dir: Path) -> Path:
    """Have the controller write its record, and wait for the file.

    Ticks begin anew with each controller, and so do the numbers of motions: a record that was there before this
    controller held the drives tells of another time, whatever its name.

    Raises:
        NoRecord: it does not come.
    """
    address = run_dir / CONTROLLER_FILE
    began = address.stat().st_mtime_ns if address.exists() else 0
    tick = client.record()
    deadline = time.monotonic() + _FILE_PATIENCE
    while time.monotonic() < deadline:
        for path in run_dir.glob(f"{RECORD_NAME}-*.npz"):
            late = int(path.stem.removeprefix(f"{RECORD_NAME}-")) >= tick - 1
            if late and path.stat().st_mtime_ns >= began:
                return path
        time.sleep(0.02)
    raise NoRecord(
        f"the controller's record did not appear in {run_dir}: run this on the controller's PC, where its run_dir is"
    )
