"""Bench ``grip``: whether the fingers hold what they hold.

A king is lifted and shaken at full speed; how far it has slipped is measured from rest to rest. Then pieces of
all kinds that stand up to 4 mm off along both axes, turned at random, are grasped and carried to another square.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from app.measure.bench.beds.bed import Bed, plant_of
from app.measure.bench.report import BenchReport, Progress, row
from app.motion import PROFILES, MotionSettings, Plan, Profile
from app.motion.gain_schedule import Softness, scheduled
from app.motion.path import Vector
from app.motion.timing.reference import Bounds, dwell, join, line, to_samples
from app.pieces.inventory import Inventory, Stage, Transfer
from controller.protocol import Result
from controller.protocol.cause_sentences import explain
from hardware.piece_set import Colour, Kind
from hardware.sim.bodies.placed import StandingPiece
from hardware.table import PieceSpec, Place, TableSettings, square_place

SEED: Final = 7
SHAKEN: Final = {True: 3, False: 12}  # by ``quick``
GRASPS: Final = {True: 60, False: 1000}  # by ``quick``
OFF: Final = 0.004
"""Pieces stand up to so far off along each axis [m]."""
STROKE: Final = 0.06  # of the shaking, to and fro along each axis [m]
STROKES: Final = 6
LIFT: Final = 0.05
"""[m]"""
_HANGING: Final = 2.0  # [s]
_RESTING: Final = 0.2
"""Until what swings in the fingers rests [s]."""
UPRIGHT: Final = np.radians(10.0)  # a piece that leans by more has fallen [rad]
PLACED: Final = 0.010  # a piece that stands further from where it was carried was not carried there [m]
SOURCES: Final = tuple(square_place(square) for square in (1, 6, 24, 31, 49, 54))
"""b1, g1, a4, h4, b7, g7: nothing stands beside them."""
TARGETS: Final = tuple(square_place(square) for square in (19, 20, 28, 35, 36, 27))


def grip_bench(quick: bool, progress: Progress) -> BenchReport:
    """Measure; ``quick`` with fewer pieces."""
    shaken = []
    for number in range(SHAKEN[quick]):
        progress(f"king {number + 1} is shaken")
        shaken.append(shake(number))
    count = GRASPS[quick]
    dropped = grasps(count, progress)
    for sentence in dropped:
        progress(sentence)
    rows = {
        "slip": row([1e3 * one.slip for one in shaken], "mm", 0.1, "max"),
        "creep": row([1e6 * one.creep for one in shaken], "µm/s"),
        "dropped": row([100.0 * len(dropped) / count], "%", 0.2, "max"),
        "grasps": row([count], "1"),
    }
    return BenchReport.of("grip", SEED, rows)


# a king, shaken


class Shaken(NamedTuple):
    """How a king was held."""

    slip: float  # from rest to rest, beyond what it creeps in as much time at rest [m]
    creep: float  # of what hangs in the fingers at rest: that of the simulation's contacts [m/s]


def shake(number: int) -> Shaken:
    """Shake a king that is held in the air at full speed along each axis and all of them.

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
    middle = bed.table.base_from_board(np.array([0.0, 0.0, LIFT + 0.04]))
    _go(bed, [bed.arm[0] - [0.0, 0.0, LIFT], middle], Softness.LASTS)  # the tool has gone to the king
    name = standing.spec.name
    bed.wait(_HANGING)  # it stood askew, and hangs straight by then
    hung, since = _in_fingers(bed, name), bed.plant.tick
    bed.wait(_HANGING)
    begun, then = _in_fingers(bed, name), bed.plant.tick
    creep = (begun - hung) / (then - since)
    ways = (STROKE * axis * np.array([1.0, 1.0, 0.5]) for axis in (*np.eye(3), np.full(3, 3.0**-0.5)))
    _go(bed, [point for way in ways for point in STROKES * (middle - way, middle)])
    bed.wait(_RESTING)
    slip = _in_fingers(bed, name) - begun - creep * (bed.plant.tick - then)
    return Shaken(float(np.linalg.norm(slip)), float(np.linalg.norm(creep)) / bed.parameters.drive.tick)


def _go(bed: Bed, points: Sequence[Vector], softness: Softness = Softness.STIFF) -> None:
    """From point to point, base frame (3,) each [m], at the profile's limits, in the air, pressing what is held."""
    settings, tick = bed.settings, bed.parameters.drive.tick
    bounds = Bounds(settings.speed, settings.acceleration, settings.jerk)
    lines = [line(a, b, bounds, tick) for a, b in itertools.pairwise([bed.arm[0], *points])]
    path = join([dwell(bed.arm[0], 1), *lines])
    high, time = np.full(len(path), LIFT), tick * np.arange(float(len(path)))
    gains = scheduled(high, np.zeros(len(path)), time, time, softness, settings.gains)
    ended = bed.execute(to_samples(path, gains, np.full(len(path), -settings.grip.closing_speed)))
    if ended.result is not Result.DONE:
        raise RuntimeError(f"the shaking ended as {ended.result.name}: {explain(*ended.reason[:3])}")


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
