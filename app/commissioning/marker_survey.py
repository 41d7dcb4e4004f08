"""The arm shows its marker to the camera, point by point over the whole board.

It stays higher than any piece, so that the board may be set up or empty. At each point it rests, one frame is taken
that was exposed after it came to rest, and the encoders say where the tool really is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from app.motion import MotionSettings, Plan, Planner, PlanRefused
from app.rig.devices import Rig
from hardware.interfaces import Camera, Frame, HardwareError
from hardware.parameters import Marker, RobotParameters
from hardware.piece_set import PIECE_SHAPES
from hardware.table import TableSettings
from vision.arrays import Array
from vision.camera.calibration import CalibrationFailed
from vision.camera.marker import SeenMarker, find_marker

Progress = Callable[[str], None]

PAUSE: Final = 0.15  # from rest to a picture: what swings comes to rest [s]
PATIENCE: Final = 3.0  # for a frame that was exposed after the arm came to rest [s]
MOST_AGE: Final = 0.5
_SIDES: Final = (-1.0, 0.0, 1.0)
_SPREAD: Final = 0.75
"""Points lie so far out, in half boards."""
_CLEAR: Final = 0.012  # between pads and the tallest piece [m]
_LAYERS: Final = (0.0, 0.045, 0.090)  # heights above the lowest one [m]
_INNER: Final = 8  # depth is taken from the middle of the marker, an eighth of its side to each side


@dataclass(frozen=True, slots=True)
class Setup:
    """What a calibration needs to know beforehand."""

    table: TableSettings
    parameters: RobotParameters
    motion: MotionSettings

    @property
    def marker(self) -> Marker:
        """On the tool.

        Raises:
            CalibrationFailed: the parameters have none.
        """
        if self.parameters.marker is None:
            raise CalibrationFailed(
                "the robot's parameters have no [marker]: put one on the tool and add its position "
                "(docs/calibration.md)"
            )
        return self.parameters.marker


@dataclass(frozen=True, slots=True, eq=False)
class MarkerObservation:
    """The marker at one point: where it was by the encoders, base frame (3,) [m], and in the picture, if at all."""

    point: Array
    seen: SeenMarker | None
    depth: float  # measured at its centre [m]; 0 where there is none


def showing_points(setup: Setup) -> tuple[Array, ...]:
    """Tool points at which the arm shows itself, base frame (3,) each [m], in an order with short ways.

    Over the whole board in three layers, fewer points higher up: there the marker leaves the picture of a camera that
    hangs low.
    """
    table, pads = setup.table, setup.parameters.pads
    low = max(shape.height for shape in PIECE_SHAPES.values()) + pads.half_height + _CLEAR
    half = 4.0 * _SPREAD * table.square
    grids: tuple[Sequence[tuple[float, float]], ...] = (
        [(i, j) for j in _SIDES for i in _SIDES],
        [(i, j) for j in (1.0, 0.25, -0.5) for i in (-0.8, 0.8)] + [(0.0, 0.6), (0.0, -0.2)],
        [(i, j) for j in (0.5, 1.0) for i in (-0.9, 0.0, 0.9)],
    )
    points = []
    for layer, grid in zip(_LAYERS, grids, strict=True):
        ordered = _snake([(i, j) for i, j in grid])
        points += [table.base_from_board(np.array([i * half, j * half, low + layer])) for i, j in ordered]
    return tuple(points)


def _snake(grid: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Row by row, every other one backwards."""
    rows = sorted({j for _i, j in grid})
    return [
        place
        for number, row in enumerate(rows)
        for place in sorted((one for one in grid if one[1] == row), reverse=number % 2 == 1)
    ]


def show(rig: Rig, setup: Setup, progress: Progress) -> list[MarkerObservation]:
    """Let the arm show its marker at all points that it reaches, and bring it home.

    Raises:
        CalibrationFailed: the rig has no camera, or the parameters no marker.
        UserError, HardwareError: a device failed.
    """
    marker, camera = setup.marker, rig.camera
    if camera is None:
        raise CalibrationFailed("this rig has no camera: name one in [camera] of its file")
    points = showing_points(setup)
    sightings = []
    for number, point in enumerate(points, start=1):
        try:
            _go(rig, setup, point, f"point {number} of {len(points)}")
        except PlanRefused as refused:
            progress(f"point {number} of {len(points)} is left out: {refused}")
            continue
        position = rig.arm.state().position
        rig.clock.sleep(PAUSE)
        frame = fresh_frame(rig, camera)
        seen = find_marker(frame.colour, marker.number)
        sightings.append(MarkerObservation(position + np.array(marker.centre), seen, _depth(frame, seen)))
        if seen is None:
            progress(f"point {number} of {len(points)}: the marker is not visible")
    _go(rig, setup, np.array(setup.motion.home), "home")
    return sightings


def _go(rig: Rig, setup: Setup, point: Array, label: str) -> None:
    """To a point that is higher than all pieces: up or level first, then over."""
    x, y, z = point.tolist()
    state = rig.arm.state()
    motion = setup.motion.model_copy(update={"home": (x, y, z)})
    plan = Planner.of(motion, setup.parameters, setup.table, state.reference, state.finger).home()
    if np.linalg.norm(state.reference - point) > 1e-6:
        rig.arm.execute(Plan(label, tuple(replace(one, label=label) for one in plan.motions)))


def fresh_frame(rig: Rig, camera: Camera) -> Frame:
    """A frame that was exposed from now on."""
    since, deadline = rig.clock.now(), rig.clock.now() + PATIENCE
    while True:
        frame = camera.read(MOST_AGE)
        if frame.stamp >= since:
            return frame
        if rig.clock.now() > deadline:
            raise HardwareError(f"the camera gave no new picture within {PATIENCE:.0f} s: check its cable")
        rig.clock.sleep(0.01)


def _depth(frame: Frame, seen: SeenMarker | None) -> float:
    """At the marker's centre [m], 0 where there is none."""
    if seen is None or frame.depth is None:
        return 0.0
    side = float(np.linalg.norm(seen.corners[1] - seen.corners[0]))
    u, v = np.rint(seen.centre).astype(int).tolist()
    half = max(2, round(side / _INNER))
    patch = frame.depth[max(0, v - half) : v + half + 1, max(0, u - half) : u + half + 1]
    known = patch[patch > 0.0]
    return float(np.median(known)) if known.size else 0.0
