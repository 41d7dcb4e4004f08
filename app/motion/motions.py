"""Motions from routes: inside the workspace, timed, and no quicker than the drives can follow."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from app.motion.arcs import Workcell
from app.motion.plan import Motion, PlanRefused
from app.motion.route import Route, Timed, timed
from app.pieces.inventory import Stage

_ATTEMPTS: Final = 6
"""So often a motion is slowed down until its torques are feasible."""


def motion_of(
    cell: Workcell, label: str, route: Route, transfer: int | None, stage: Stage | None
) -> tuple[Motion, float]:
    """Time a route; with it where the fingers are in the end [m].

    Args:
        cell: what is moved.
        label: what the motion does, for people.
        route: where it goes.
        transfer: of the plan's transfers, the one it belongs to; None: to none.
        stage: of that transfer.

    Raises:
        PlanRefused: it leads out of the workspace, or takes more torque than the drives have.
    """
    _check(cell, label, route)
    route, done = _within_torque(cell, label, route)
    motion = Motion(
        label, done.samples, done.expected, grips=route.grips, touches=route.touches,
        continuation=cell.continuation(route), paths=done.paths, transfer=transfer, stage=stage,
    )  # fmt: skip
    return motion, done.finger


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
        share = 0.98 * max(limit - still, 0.1 * limit) / (peak - still)
        route = replace(route, bounds=tuple(bounds.scaled(share) for bounds in route.bounds))
    raise PlanRefused(
        f"{label} takes {peak:.1f} N m, the drives have {limit:.1f} N m for it, and holding still takes "
        f"{still:.1f} N m: move the board closer to the robot"
    )


def _check(cell: Workcell, label: str, route: Route) -> None:
    """Every corner of the way lies in the workspace: with it the whole way, which is in their hull."""
    limits = cell.limits
    for point in route.points[1:].tolist():
        x, y, height = cell.board(np.array(point))
        where = f"{label}: the way leads over ({x * 1e3:.0f}, {y * 1e3:.0f}) mm at {height * 1e3:.0f} mm"
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
