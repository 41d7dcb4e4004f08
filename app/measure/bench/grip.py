"""Bench ``grip``: whether the fingers hold what they hold.

A king is lifted, carried at full speed and shaken; how far it has slipped is measured from rest to rest. Then pieces of
all kinds that stand up to 4 mm off along both axes, turned at random, are grasped and carried to another square.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from app.measure.bench.beds.bed import Bed, plant_of
from app.measure.bench.report import BenchReport, Progress, row
from app.motion import PROFILES, MotionSettings, Plan, Profile
from app.motion.path import Vector
from app.motion.timing.reference import Bounds, join, line, to_samples
from app.pieces.inventory import Inventory, Stage, Transfer
from hardware.parameters import RobotParameters, load_parameters
from hardware.sim.bodies.placed import StandingPiece
from hardware.table import Colour, Kind, PieceSpec, Place, TableSettings, square_place

SEED: Final = 7
SHAKEN: Final = 12
QUICK_SHAKEN: Final = 3
GRASPS: Final = 1000
QUICK_GRASPS: Final = 60
OFF: Final = 0.004
"""Pieces stand up to so far off along each axis [m]."""
STROKE: Final = 0.06
"""Of the shaking, to and fro along each axis [m]."""
STROKES: Final = 6
LIFT: Final = 0.05
"""[m]"""
SLIP_LIMIT: Final = 0.1
"""[mm]"""
DROP_LIMIT: Final = 0.2
"""[%]"""
UPRIGHT: Final = np.radians(10.0)
"""A piece that leans by more has fallen [rad]."""
PLACED: Final = 0.010
"""A piece that stands further from where it was carried was not carried there [m]."""
SOURCES: Final = tuple(square_place(square) for square in (1, 6, 24, 31, 49, 54))
"""b1, g1, a4, h4, b7, g7: nothing stands beside them."""
TARGETS: Final = tuple(square_place(square) for square in (19, 20, 28, 35, 36, 27))


@dataclass(slots=True)
class Grasped:
    """What came of grasps: how many, and those that failed, each with what happened."""

    done: int = 0
    dropped: list[str] = field(default_factory=list)


def grip_bench(quick: bool, progress: Progress) -> BenchReport:
    """Run the bench; ``quick`` with fewer pieces."""
    parameters, table = load_parameters(), TableSettings()
    slips = []
    for number in range(QUICK_SHAKEN if quick else SHAKEN):
        progress(f"king {number + 1} is shaken")
        slips.append(1e3 * shake(number, parameters, table))
    grasped = grasps(QUICK_GRASPS if quick else GRASPS, SEED, parameters, table, progress)
    share = 100.0 * len(grasped.dropped) / grasped.done
    for sentence in grasped.dropped:
        progress(sentence)
    rows = {
        "slip": row(slips, "mm", SLIP_LIMIT, "max"),
        "dropped": row([share], "%", DROP_LIMIT, "max"),
        "grasps": row([grasped.done], "1"),
    }
    return BenchReport.of("grip", SEED, rows)


# a king, shaken


def shake(number: int, parameters: RobotParameters, table: TableSettings) -> float:
    """Grasp a king, lift it, carry it at full speed to the middle, and shake it along each axis.

    Args:
        number: decides on which square, how far off and how turned the king stands.
        parameters: robot.
        table: board.

    Returns:
        How far it has slipped in the fingers, from rest before to rest afterwards [m].

    Raises:
        RuntimeError: a motion did not end as it had to.
    """
    settings, rng = PROFILES[Profile.FAST], np.random.default_rng([SEED, number])
    table = table.model_copy(update={"limits": table.limits.model_copy(update={"tool_speed": settings.speed})})
    source = SOURCES[number % len(SOURCES)]
    standing = _stand(Kind.KING, source, table, rng)
    bed = _bed((standing,), settings, parameters, table)
    _grasp(bed, standing.spec, TARGETS[number % len(TARGETS)], settings, table)
    begun = _in_fingers(bed, standing.spec.name)
    bed.execute(_shaking(bed.arm[0], settings, parameters, table), followed=False)
    bed.wait(0.2)
    return float(np.linalg.norm(_in_fingers(bed, standing.spec.name) - begun))


def _shaking(
    start: Vector, settings: MotionSettings, parameters: RobotParameters, table: TableSettings
) -> NDArray[Any]:
    """Up, over to the middle, and to and fro along each axis and all of them together, at the profile's limits."""
    bounds = Bounds(settings.speed, settings.acceleration, settings.jerk)
    middle = table.base_from_board(np.array([0.0, 0.0, LIFT + 0.04]))
    points = [start, start - [0.0, 0.0, LIFT], middle]
    for axis in (*np.eye(3), np.full(3, 3.0**-0.5)):
        for _ in range(STROKES):
            points += [middle - STROKE * axis * np.array([1.0, 1.0, 0.5]), middle]
    tick = parameters.drive.tick
    path = join([line(a, b, bounds, tick) for a, b in itertools.pairwise(points)])
    frequency = settings.gains.frequency_in_air
    gains = np.repeat([[frequency**2] * 3 + [2.0 * settings.gains.damping_ratio * frequency] * 3], len(path), axis=0)
    return to_samples(path, gains, np.full(len(path), -settings.grip.closing_speed))


def _in_fingers(bed: Bed, name: str) -> Vector:
    """Where the piece is, seen from the tool [m]."""
    data = bed.plant.data
    position: Vector = data.body(name).xpos - data.site("tool").xpos
    return position.copy()


# grasps


def grasps(count: int, seed: int, parameters: RobotParameters, table: TableSettings, progress: Progress) -> Grasped:
    """Grasp so many pieces that stand off their places and carry each to another square."""
    settings, found = MotionSettings(), Grasped()
    for world in itertools.count():
        rng = np.random.default_rng([seed, world])
        kinds = rng.permutation(list(Kind))
        pieces = tuple(_stand(Kind(kind), place, table, rng) for kind, place in zip(kinds, SOURCES, strict=True))
        bed = _bed(pieces, settings, parameters, table)
        stands = [piece.spec for piece in pieces]
        for index, target in enumerate(TARGETS):
            trouble = _carry(bed, stands, index, target, settings, table)
            found.done += 1
            if trouble is not None:
                found.dropped.append(f"world {world}, {stands[index].kind} on {stands[index].place}: {trouble}")
                break  # what lies there would be in the way of the next
            stands[index] = replace(stands[index], place=target)
            if found.done == count:
                return found
        if world % 10 == 0:
            progress(f"{found.done} of {count} grasps, {len(found.dropped)} dropped")
    raise AssertionError("worlds never end")


def _carry(
    bed: Bed, stands: Sequence[PieceSpec], index: int, target: Place, settings: MotionSettings, table: TableSettings
) -> str | None:
    """Carry one of the pieces that stand there away; a sentence if it did not arrive."""
    try:
        for motion, _ in bed.continued(_plan(bed, stands, index, target, settings, table)):
            bed.carry_out(motion)
    except RuntimeError as error:
        return str(error)
    pose = next(one for one in bed.plant.truth(reset_peak=False).pieces if one.name == stands[index].name)
    x, y = table.xy(target)
    off = float(np.hypot(pose.x - x, pose.y - y))
    if pose.tilt > UPRIGHT or off > PLACED:
        return f"it ended {1e3 * off:.1f} mm from {target}, leaning by {np.degrees(pose.tilt):.0f}°"
    return None


def _plan(
    bed: Bed, stands: Sequence[PieceSpec], index: int, target: Place, settings: MotionSettings, table: TableSettings
) -> Plan:
    """Of a transfer."""
    inventory = Inventory.of(stands, table)
    return bed.planner(settings, table).ply("", [Transfer.of(stands[index], target)], inventory)


def _grasp(bed: Bed, spec: PieceSpec, target: Place, settings: MotionSettings, table: TableSettings) -> None:
    for motion, _ in bed.continued(_plan(bed, [spec], 0, target, settings, table)):
        bed.carry_out(motion, followed=motion.stage is Stage.GRASP)
        if motion.stage is Stage.GRASP:
            break
    bed.wait(settings.grip.settle)


def _stand(kind: Kind, place: Place, table: TableSettings, rng: np.random.Generator) -> StandingPiece:
    x, y = np.array(table.xy(place)) + rng.uniform(-OFF, OFF, 2)
    spec = PieceSpec(f"{kind}-{place}", kind, Colour.WHITE, place)
    return StandingPiece(spec, float(x), float(y), float(rng.uniform(-np.pi, np.pi)))


def _bed(
    pieces: tuple[StandingPiece, ...], settings: MotionSettings, parameters: RobotParameters, table: TableSettings
) -> Bed:
    return Bed(plant_of(pieces, table, settings, parameters), parameters, table)
