"""Motions: from routes, inside the workspace, timed, and no quicker than the drives can follow; and from samples."""

import math
from dataclasses import replace
from typing import Final

import numpy as np

from app.motion.arcs import Workcell
from app.motion.path import Vector
from app.motion.plan import Motion, PlanRefused
from app.motion.route import Route, Timed, timed
from app.motion.timing.reference import Segment, dwell, eased, join, to_samples
from app.pieces.inventory import Stage

_ATTEMPTS: Final = 6
"""A motion is slowed down at most so often until its torques are feasible."""
_LOOSENING: Final = 0.4
"""For the way up from what holds the tool, and as long again until the tool, as soft as it is, comes to rest [s]."""


def motion_of(
    cell: Workcell, label: str, route: Route, transfer: int | None = None, stage: Stage | None = None
) -> tuple[Motion, float]:
    """Time a route, as a stage of one of the plan's transfers or of none; with it where the fingers end up [m]. Raises
    ``PlanRefused`` if it leads out of the workspace, or takes more torque than the drives have.
    """
    _check(cell, label, route)
    route, done = _within_torque(cell, label, route)
    motion = Motion(
        label, done.samples, done.expected, grips=route.grips is not None, touches=route.touches,
        continuation=cell.continuation(route), paths=done.paths, transfer=transfer, stage=stage,
    )  # fmt: skip
    return motion, done.finger


def sampled_motion(cell: Workcell, label: str, way: Vector, start: Vector, resting: float, upright: Vector) -> Motion:
    """A motion that follows from no route, with the fingers as they are and stiff but along z₃.

    ``way`` has position, velocity and acceleration a tick apart, from the second sample on, base frame (n, 9); it
    begins at ``start``, (3,) [m], and rests at its end [s]. ``upright`` is the natural frequency along z₃ [rad/s], one
    for all samples or each its own.
    """
    tick, gains = cell.tick, cell.settings.gains
    path = join([dwell(start, 1), Segment(way), dwell(way[-1, 0:3], math.ceil(resting / tick))])
    soft, stiff = np.broadcast_to(upright, len(path)), np.full(len(path), gains.frequency_in_air)
    double = 2.0 * gains.damping_ratio
    rows = np.stack([stiff**2, stiff**2, soft**2, double * stiff, double * stiff, double * soft], axis=1)
    samples = to_samples(path, rows, np.zeros(len(path)))
    samples.flags.writeable = False
    return Motion(label, samples, (len(path) - 1) * tick, continuation=cell.continuation())


def loosened(cell: Workcell, start: Vector, tool: Vector) -> Motion:
    """Up from what holds the tool up: the reference comes to the tool before the arm moves off, both base frame (3,)
    [m].

    As soft in height as at a touch, slowly, and nowhere but up.
    """
    share = eased(math.ceil(_LOOSENING / cell.tick), cell.tick)
    up = np.array([0.0, 0.0, min(0.0, float(tool[2] - start[2]))])  # z₃ points down
    way = np.hstack([np.outer(share[:, part], up) for part in range(3)])
    way[:, 0:3] += start
    soft = np.array(cell.settings.gains.frequency_at_contact)
    return sampled_motion(cell, "up from what was touched", way, start, _LOOSENING, soft)


def _within_torque(cell: Workcell, label: str, route: Route) -> tuple[Route, Timed]:
    """Timed, with slower accelerations where the drives could not follow otherwise."""
    limit = cell.settings.torque_share * cell.parameters.drive.peak_torque
    for _ in range(_ATTEMPTS):
        done = timed(route, cell.settings, cell.table, cell.tick)
        if not route.bounds:
            return route, done
        peak, still = cell.torque.peak(done.motion)
        if peak <= limit:
            return route, done
        if still >= limit:  # however slowly
            break
        share = 0.98 * max(limit - still, 0.1 * limit) / (peak - still)
        route = replace(route, bounds=tuple(bounds.scaled(share) for bounds in route.bounds))
    raise PlanRefused(
        f"{label} takes {peak:.1f} N m, the drives allow {limit:.1f} N m, and holding still takes "
        f"{still:.1f} N m: move the board closer to the robot"
    )


def _check(cell: Workcell, label: str, route: Route) -> None:
    """Every corner of the way lies in the workspace: with it the whole way, which is in their hull."""
    limits = cell.limits
    for point in route.points[1:].tolist():
        x, y, height = cell.board(np.array(point))
        where = f"{label}: the path leads over ({x * 1e3:.0f}, {y * 1e3:.0f}) mm at {height * 1e3:.0f} mm"
        reach = math.hypot(point[0], point[1])
        if reach > limits.reach:
            raise PlanRefused(
                f"{where}, {reach * 1e3:.0f} mm from the robot's axis, which reaches {limits.reach * 1e3:.0f} mm: "
                "use smaller squares or move the board"
            )
        for axis in range(3):
            value, centre, half = point[axis], limits.centre[axis], limits.half_size[axis]
            if abs(value - centre) > half:
                raise PlanRefused(
                    f"{where}, where z{axis + 1} is {value * 1e3:.0f} mm; the workspace ends {half * 1e3:.0f} mm "
                    f"from {centre * 1e3:.0f} mm: use smaller squares or pieces, or move the board"
                )
