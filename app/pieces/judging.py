"""Does the physical board equal the logical one? Judged on ground truth, for records and the exit status alone."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from app.pieces.inventory import Inventory, expected
from hardware.referee import PiecePose, Truth
from hardware.table import Box, PieceSpec, Place, TableSettings
from vision.arrays import cheapest_pairs

UPRIGHT = math.radians(5.0)
"""A piece that leans further than this does not stand; standing ones lean below 0.1°."""
_OWN: Final = 1e-6
"""By so much nearer a piece's own place counts [m]."""
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


def most_off_centre(table: TableSettings) -> float:
    """How far from the centre of its place a piece may stand [m]: a quarter square."""
    return table.square / 4.0


def judge(truth: Truth, inventory: Inventory) -> Verdict:
    """Compare every piece with where the game says it stands: within a quarter square of the centre,
    upright; in a box in any way within its walls.

    Pieces alike may have changed places: nobody can see that, and the board is right all the same.
    """
    table = inventory.table
    poses = _as_named(truth, inventory)
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


def _as_named(truth: Truth, inventory: Inventory) -> dict[str, PiecePose]:
    """Poses by the name that the game has for what is there: of pieces alike, those that together are nearest to the
    places; by their own names, where that makes no difference.
    """
    poses = {pose.name: pose for pose in truth.pieces}
    groups = dict[tuple[str, str], list[tuple[Place, str]]]()
    for place, piece in expected(inventory).items():
        if piece.name in poses:
            groups.setdefault((piece.kind, piece.colour), []).append((place, piece.name))
    for group in groups.values():
        names = [name for _, name in group]
        far = np.array([[_away(poses[name], place, inventory.table) for name in names] for place, _ in group])
        if far.diagonal().max() <= most_off_centre(inventory.table):
            continue
        _, chosen = cheapest_pairs(far - _OWN * np.eye(len(names)))
        poses |= {name: replace(poses[names[one]], name=name) for name, one in zip(names, chosen.tolist(), strict=True)}
    return poses


def _away(pose: PiecePose, place: Place, table: TableSettings) -> float:
    """From a place, a square at most [m]; 0 within its box."""
    if place.in_box:
        return 0.0 if table.box_of(place).holds(pose.x, pose.y) else table.square
    x, y = table.xy(place)
    return min(math.hypot(pose.x - x, pose.y - y), table.square)


def _outside(piece: PieceSpec, pose: PiecePose, place: Place, box: Box) -> str:
    return (
        f"{piece.name} was dropped into the box ({place}) and lies outside: ({(pose.x - box.x) * 1e3:.0f}, "
        f"{(pose.y - box.y) * 1e3:.0f}) mm from its middle, {pose.z * 1e3:.0f} mm above the board; its inside ends at "
        f"±{box.half_x * 1e3:.0f} and ±{box.half_y * 1e3:.0f} mm, its walls at {box.height * 1e3:.0f} mm"
    )


def _problem(piece: PieceSpec, pose: PiecePose, place: Place, error: float, table: TableSettings) -> str | None:
    limit = most_off_centre(table)
    if pose.tilt > UPRIGHT:
        return f"{piece.name} on {place} leans by {math.degrees(pose.tilt):.0f}°"
    if abs(pose.z) > ON_SURFACE:
        return f"{piece.name} on {place} stands {pose.z * 1e3:.1f} mm above the board"
    if error > limit:
        return (
            f"{piece.name} is {error * 1e3:.1f} mm from the centre of {place}, at most {limit * 1e3:.0f} mm are allowed"
        )
    return None
