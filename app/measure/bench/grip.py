"""Bench ``grip``: whether the fingers hold what they hold.

A king is lifted, carried at full speed and shaken; how far it has slipped is measured from rest to rest. Then pieces of
all kinds that stand up to 4 mm off along both axes, turned at random, are grasped and carried to another square.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from app.measure.bench.beds.bed import Bed, plant_of
from app.measure.bench.report import BenchReport, Progress, row
from app.motion import PROFILES, MotionSettings, Plan, Profile
from app.motion.path import Vector
from app.motion.timing.reference import Bounds, join, line, to_samples
from app.pieces.inventory import Inventory, Stage, Transfer
from hardware.sim.bodies.placed import StandingPiece
from hardware.table import Colour, Kind, PieceSpec, Place, TableSettings, square_place

SEED: Final = 7
SHAKEN: Final = {True: 3, False: 12}  # by ``quick``
GRASPS: Final = {True: 60, False: 1000}  # by ``quick``
OFF: Final = 0.004
"""Pieces stand up to so far off along each axis [m]."""
STROKE: Final = 0.06  # of the shaking, to and fro along each axis [m]
STROKES: Final = 6
LIFT: Final = 0.05
"""[m]"""
UPRIGHT: Final = np.radians(10.0)  # a piece that leans by more has fallen [rad]
PLACED: Final = 0.010  # a piece that stands further from where it was carried was not carried there [m]
SOURCES: Final = tuple(square_place(square) for square in (1, 6, 24, 31, 49, 54))
"""b1, g1, a4, h4, b7, g7: nothing stands beside them."""
TARGETS: Final = tuple(square_place(square) for square in (19, 20, 28, 35, 36, 27))


def grip_bench(quick: bool, progress: Progress) -> BenchReport:
    """Measure; ``quick`` with fewer pieces."""
    slips = []
    for number in range(SHAKEN[quick]):
        progress(f"king {number + 1} is shaken")
        slips.append(1e3 * shake(number))
    count = GRASPS[quick]
    dropped = grasps(count, progress)
    for sentence in dropped:
        progress(sentence)
    rows = {
        "slip": row(slips, "mm", 0.1, "max"),
        "dropped": row([100.0 * len(dropped) / count], "%", 0.2, "max"),
        "grasps": row([count], "1"),
    }
    return BenchReport.of("grip", SEED, rows)


# a king, shaken


def shake(number: int) -> float:
    """How far a king slips, from rest to rest [m], that is lifted, carried at full speed and shaken along each axis.

    The number decides on which square, how far off and how turned the king stands.

    Raises:
        RuntimeError: a motion did not end as it had to.
    """
    settings, rng = PROFILES[Profile.FAST], np.random.default_rng([SEED, number])
    table = TableSettings()
    table = table.model_copy(update={"limits": table.limits.model_copy(update={"tool_speed": settings.speed})})
    standing = _stand(Kind.KING, SOURCES[number % len(SOURCES)], table, rng)
    bed = Bed(plant_of((standing,), table, settings), table, settings)
    for motion, _ in bed.continued(_plan(bed, [standing.spec], 0, TARGETS[number % len(TARGETS)])):
        bed.carry_out(motion, followed=motion.stage is Stage.GRASP)
        if motion.stage is Stage.GRASP:
            break
    bed.wait(settings.grip.settle)
    begun = _in_fingers(bed, standing.spec.name)
    bed.execute(_shaking(bed))
    bed.wait(0.2)
    return float(np.linalg.norm(_in_fingers(bed, standing.spec.name) - begun))


def _shaking(bed: Bed) -> NDArray[Any]:
    """Up, over to the middle, and to and fro along each axis and all of them together, at the profile's limits."""
    settings, start = bed.settings, bed.arm[0]
    bounds = Bounds(settings.speed, settings.acceleration, settings.jerk)
    middle = bed.table.base_from_board(np.array([0.0, 0.0, LIFT + 0.04]))
    points = [start, start - [0.0, 0.0, LIFT], middle]
    for axis in (*np.eye(3), np.full(3, 3.0**-0.5)):
        for _ in range(STROKES):
            points += [middle - STROKE * axis * np.array([1.0, 1.0, 0.5]), middle]
    path = join([line(a, b, bounds, bed.parameters.drive.tick) for a, b in itertools.pairwise(points)])
    frequency = settings.gains.frequency_in_air
    gains = np.repeat([[frequency**2] * 3 + [2.0 * settings.gains.damping_ratio * frequency] * 3], len(path), axis=0)
    return to_samples(path, gains, np.full(len(path), -settings.grip.closing_speed))


def _in_fingers(bed: Bed, name: str) -> Vector:
    """Where the piece is, seen from the tool [m]."""
    data = bed.plant.data
    position: Vector = data.body(name).xpos - data.site("tool").xpos
    return position.copy()


# grasps


def grasps(count: int, progress: Progress) -> list[str]:
    """Grasp so many pieces that stand off their places and carry each to another square; what went wrong."""
    table, done, dropped = TableSettings(), 0, list[str]()
    for world in itertools.count():
        rng = np.random.default_rng([SEED, world])
        kinds = rng.permutation(list(Kind))
        pieces = tuple(_stand(Kind(kind), place, table, rng) for kind, place in zip(kinds, SOURCES, strict=True))
        bed = Bed(plant_of(pieces, table, MotionSettings()), table)
        stands = [piece.spec for piece in pieces]
        for index, target in enumerate(TARGETS):
            trouble = _carry(bed, stands, index, target)
            done += 1
            if trouble is not None:
                dropped.append(f"world {world}, {stands[index].kind} on {stands[index].place}: {trouble}")
            if done == count:
                return dropped
            if trouble is not None:
                break  # what lies there would be in the way of the next
            stands[index] = replace(stands[index], place=target)
        if world % 10 == 0:
            progress(f"{done} of {count} grasps, {len(dropped)} dropped")
    raise AssertionError("worlds never end")


def _carry(bed: Bed, stands: Sequence[PieceSpec], index: int, target: Place) -> str | None:
    """Carry one of the pieces that stand there away; a sentence if it did not arrive."""
    try:
        bed.execute_plan(_plan(bed, stands, index, target))
    except RuntimeError as error:
        return str(error)
    pose = next(one for one in bed.plant.truth(reset_peak=False).pieces if one.name == stands[index].name)
    x, y = bed.table.xy(target)
    off = float(np.hypot(pose.x - x, pose.y - y))
    if pose.tilt > UPRIGHT or off > PLACED:
        return f"it ended {1e3 * off:.1f} mm from {target}, leaning by {np.degrees(pose.tilt):.0f}°"
    return None


def _plan(bed: Bed, stands: Sequence[PieceSpec], index: int, target: Place) -> Plan:
    """Of a transfer."""
    return bed.planner().ply("", [Transfer.of(stands[index], target)], Inventory.of(stands, bed.table))


def _stand(kind: Kind, place: Place, table: TableSettings, rng: np.random.Generator) -> StandingPiece:
    x, y = np.array(table.xy(place)) + rng.uniform(-OFF, OFF, 2)
    spec = PieceSpec(f"{kind}-{place}", kind, Colour.WHITE, place)
    return StandingPiece(spec, float(x), float(y), float(rng.uniform(-np.pi, np.pi)))
