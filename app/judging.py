"""Does the physical board equal the logical one? Judged on ground truth, for records and the exit status alone."""

from __future__ import annotations

import math
from dataclasses import dataclass

from app.manipulation import Inventory, expected
from hardware.sim.truth import PiecePose, Truth
from hardware.table import Box, PieceSpec, Place, TableSettings

UPRIGHT = math.radians(5.0)
"""A piece that leans further than this does not stand; standing ones lean below 0.1°."""
ON_SURFACE = 0.002
"""A foot further above or below the surface than this does not stand on it [m]."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """What the referee found after a ply.

    Attributes:
        failures: a sentence for each piece that is not as it should be.
        errors: distance of every piece that stands from the centre of its place [m], by name.
    """

    failures: tuple[str, ...]
    errors: dict[str, float]

    @property
    def ok(self) -> bool:
        """The physical board equals the logical one."""
        return not self.failures


def judge(truth: Truth, inventory: Inventory) -> Verdict:
    """Compare every piece with where the game says it stands: within a quarter square of the centre,
    upright; in a box, anyhow within its walls.
    """
    table = inventory.table
    poses = {pose.name: pose for pose in truth.pieces}
    failures: list[str] = []
    errors: dict[str, float] = {}
    for place, piece in expected(inventory).items():
        pose = poses.pop(piece.name, None)
        if pose is None:
            failures.append(f"{piece.name} should be on {place} but does not exist")
            continue
        if place.in_box:
            box = table.box_of(place)
            if not (box.holds(pose.x, pose.y) and -ON_SURFACE <= pose.z <= box.height):
                failures.append(_outside(piece, pose, place, box))
            continue
        x, y = table.xy(place)
        errors[piece.name] = math.hypot(pose.x - x, pose.y - y)
        problem = _problem(piece, pose, place, errors[piece.name], table)
        if problem:
            failures.append(problem)
    failures += [f"{name} is unknown to the game" for name in poses]
    return Verdict(tuple(failures), errors)


def _outside(piece: PieceSpec, pose: PiecePose, place: Place, box: Box) -> str:
    return (
        f"{piece.name} was dropped into the box ({place}) and lies outside: ({(pose.x - box.x) * 1e3:.0f}, "
        f"{(pose.y - box.y) * 1e3:.0f}) mm from its middle, {pose.z * 1e3:.0f} mm above the board; its inside ends at "
        f"±{box.half_x * 1e3:.0f} and ±{box.half_y * 1e3:.0f} mm, its walls at {box.height * 1e3:.0f} mm"
    )


def _problem(piece: PieceSpec, pose: PiecePose, place: Place, error: float, table: TableSettings) -> str | None:
    limit = table.square / 4.0
    if pose.tilt > UPRIGHT:
        return f"{piece.name} on {place} leans by {math.degrees(pose.tilt):.0f}°"
    if abs(pose.z) > ON_SURFACE:
        return f"{piece.name} on {place} stands {pose.z * 1e3:.1f} mm above the board"
    if error > limit:
        return (
            f"{piece.name} is {error * 1e3:.1f} mm from the centre of {place}, at most {limit * 1e3:.0f} mm are allowed"
        )
    return None
