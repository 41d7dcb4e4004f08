"""Steps ``workspace``, ``gravity`` and ``tracking``: motions through the controller, and what is measured meanwhile.

Motions are planned, checked and kept within their limits as those of a game. The tool stays above the tallest piece, so
that the board may be set up or empty, but for the touch, which wants the middle of the board free.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from app.commissioning.bring_up.motion_judgement import Followed, HeldPose, followed_of
from app.commissioning.identification.recording import NoRecord
from app.commissioning.identification.survey import borders_of, fetch_record
from app.motion import PROFILES, MotionSettings, Plan, Planner, Profile
from app.motion.arcs import Workcell, polygon
from app.motion.motions import motion_of
from app.motion.path import Vector
from app.motion.route import Route
from app.rig.devices import Rig
from controller.model.constants import DeltaModel
from controller.model.reach import posture_at
from controller.records.flight_file import FlightFileError, load_flight
from controller.wire.client import ControllerClient
from hardware.parameters import RobotParameters
from hardware.table import TableSettings

CREEP: Final = MotionSettings(speed=0.1, acceleration=1.0, jerk=20.0)
"""A tenth of a metre a second: a person steps back from it."""
_SETTLING: Final = 0.3  # at each point, before anything is measured [s]
_READINGS, _EVERY = 10, 0.03  # of the torques at each point, and from one to the next [s]
_AROUND: Final = 8  # directions in which the workspace's edge is visited
_MIDDLE: Final = 0.55  # share of the way to the edge, of poses whose gravity is measured
_BLOW: Final = 0.1  # after the touch was felt its force still counts [s]
_ABOVE: Final = 0.030  # the touch begins so high above the board [m]


@dataclass(frozen=True, slots=True)
class MovingArm:
    """An arm that holds behind its controller, over its table."""

    rig: Rig
    client: ControllerClient
    parameters: RobotParameters
    table: TableSettings

    def go(self, settings: MotionSettings, point: Vector, label: str) -> None:
        """Over everything to a tool point, base frame (3,) [m]."""
        state = self.rig.arm.state()
        if np.linalg.norm(state.reference - point) < 1e-6:
            return
        x, y, z = point.tolist()
        at = settings.model_copy(update={"home": (x, y, z)})
        plan = Planner.of(at, self.parameters, self.table, state.reference, state.finger).home()
        self.rig.arm.execute(Plan(label, tuple(replace(one, label=label) for one in plan.motions)))

    @property
    def home(self) -> Vector:
        """Tool point between plies, base frame (3,) [m]."""
        return np.array(MotionSettings().at(self.table).home)


def edge_points(parameters: RobotParameters, table: TableSettings) -> Vector:
    """Around the lower edge of the workspace above all pieces, and around its upper one, base frame (n, 3) [m]."""
    borders = borders_of(parameters, table)
    low, high, points = np.array(borders.low), np.array(borders.high), []
    centre = 0.5 * (low + high)
    for depth, directions in ((high[2], _AROUND), (low[2] + 0.25 * (high[2] - low[2]), _AROUND // 2)):
        for angle in 2.0 * np.pi * np.arange(directions) / directions:
            ray = np.array([np.cos(angle), np.sin(angle)])
            most = min(((high - centre)[:2] / np.maximum(np.abs(ray), 1e-9)).min(), borders.reach)
            point = centre[:2] + most * ray
            point *= min(1.0, borders.reach / float(np.hypot(*point)))
            points.append([*point, depth])
    return np.array(points)


def grid_points(parameters: RobotParameters, table: TableSettings) -> Vector:
    """Between the middle and the edges: poses in which gravity is measured, base frame (n, 3) [m]."""
    edges = edge_points(parameters, table)
    middle = edges.mean(axis=0)
    inner = np.array([*(middle[:2] + _MIDDLE * (edges[:, :2] - middle[:2])).T, edges[:, 2]]).T
    return np.array([*inner, *([[*middle[:2], depth] for depth in np.unique(edges[:, 2])])])


def visit(stage: MovingArm, points: Vector) -> Iterator[HeldPose]:
    """Go to each point at creep speed, and hold there; home in the end.

    Raises:
        UserError, ControllerError: a motion was refused or stopped; the arm rests.
    """
    model = DeltaModel(stage.parameters)
    for number, point in enumerate([stage.home, *points]):
        stage.go(CREEP, point, f"to point {number} of {len(points)}" if number else "home")
        stage.rig.clock.sleep(_SETTLING)
        torque, position = [], []
        for _ in range(_READINGS):
            stage.rig.clock.sleep(_EVERY)
            telemetry = stage.client.telemetry
            torque.append(telemetry.torque)
            position.append(telemetry.position)
        there = np.mean(position, axis=0)
        yield HeldPose.at(model, point, there, posture_at(model, there).y, np.mean(torque, axis=0))
    stage.go(CREEP, stage.home, "home")


def follow(stage: MovingArm, run_dir: Path) -> Followed:
    """Across the board and back as a game does; what the controller recorded of it.

    Raises:
        NoRecord: the controller's record is not to be had here.
        UserError, ControllerError: a motion was refused or stopped; the arm rests.
    """
    settings = PROFILES[Profile.DEFAULT].at(stage.table)
    points = edge_points(stage.parameters, stage.table)[:_AROUND]
    first = stage.rig.arm.last_motion + 1
    for index in range(0, 3 * _AROUND, 3):  # from edge to edge across the middle
        stage.go(settings, points[index % _AROUND], "across the board")
    stage.go(settings, stage.home, "home")
    return followed_of(_record(stage, run_dir), first, stage.rig.arm.last_motion)


def touch(stage: MovingArm, run_dir: Path) -> tuple[float, float]:
    """Touch the board's middle with the pads, as a piece is set down: how much higher it is than believed [m], and the
    largest force on the tool meanwhile [N].

    Raises as ``follow``; ``NothingTouched`` where there is no board.
    """
    settings = MotionSettings().at(stage.table)
    cell = Workcell.of(settings, stage.parameters, stage.table)
    lowest = stage.parameters.pads.half_height
    above = cell.base([(0.0, 0.0, lowest + _ABOVE)])[0]
    stage.go(settings, np.array([above[0], above[1], stage.home[2]]), "over the middle of the board")
    state = stage.rig.arm.state()
    end = cell.base([(0.0, 0.0, lowest + settings.touch_height)])[0]
    ways = polygon(cell, np.array([state.reference, end]), [], None)
    route = Route(*ways, contact=(lowest, lowest), finger=state.finger, touches=True)
    motion, _ = motion_of(cell, "touching the board", route)
    stage.rig.arm.execute(Plan(motion.label, (motion,)))
    touched = stage.rig.arm.last_motion
    record = _record(stage, run_dir)
    height = float(stage.table.board_from_base(np.array(stage.client.telemetry.position))[2]) - lowest
    stage.go(settings, stage.home, "home")
    begin, end = np.flatnonzero(record["motion"] == touched)[[0, -1]]
    force = record["force"][begin : end + round(_BLOW / stage.client.period), 2]
    return height, float(np.abs(force - force[0]).max())


def _record(stage: MovingArm, run_dir: Path) -> NDArray[Any]:
    path = fetch_record(stage.client, run_dir)
    try:
        return load_flight(path).ticks
    except FlightFileError as error:
        raise NoRecord(str(error)) from error
