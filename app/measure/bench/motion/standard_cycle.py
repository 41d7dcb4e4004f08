"""Bench ``motion --standard-cycle``: industry's pick cycle, 25 mm up, 305 mm over, 25 mm down, and back.

Each leg is planned as in a game, and carried out in the simulated world by the controller with its protection. The legs
lie where they take least torque, above the zone near the board in which the tool goes down slowly.

A king is held by the fingers. They cannot hold a kilogram, so it is bolted to the gripper's body, and the controller
knows of it.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.measure.bench.beds.bed import Bed, straight
from app.measure.bench.beds.parts import Part, time_by_part
from app.measure.bench.motion.torques import WINDOW, worst_rms
from app.measure.bench.report import BenchReport, Progress, Row, row
from app.motion import PROFILES, MotionSettings, Plan, Profile, contact_speeds
from app.motion.arcs import Arc, Workcell, over
from app.motion.obstacles import Crowd
from app.motion.path import Vector
from app.motion.route import Route, Timed, timed
from app.motion.settings import HIGHEST_HOME
from app.motion.timing.reference import Bounds
from app.motion.timing.torque import EVERY
from app.pieces.inventory import Inventory, Stage, Transfer
from controller.loop.supervisor import Supervisor
from controller.model.constants import DeltaModel
from controller.model.kinematics import inverse_kinematics
from controller.protection.warm_servomotors import WARM
from controller.protocol import Result
from controller.protocol.cause_sentences import explain
from hardware.contact_speeds import ContactSpeeds
from hardware.parameters import RobotParameters, load_parameters
from hardware.piece_set import PIECE_SHAPES, Colour, Kind
from hardware.sim.bodies.placed import StandingPiece
from hardware.sim.bodies.scene import build_model
from hardware.sim.plant.plant import Plant
from hardware.table import PieceSpec, TableSettings, square_place

RISE: Final = 0.025  # [m]
ACROSS: Final = 0.305  # [m]
KILOGRAM: Final = 1.0  # [kg]
FASTEST: Final = 2.5  # of the tool; the profiles' contact limits are for where people are [m/s]
TABLE: Final = TableSettings(limits=ContactSpeeds(tool_speed=FASTEST))
GAME: Final = PROFILES[Profile.FAST].model_copy(update={"lift": RISE, "swing": 0.0, "swing_down": 0.0})
A3: Final = square_place(16)
H6: Final = square_place(47)
"""304.6 mm from the other, with the board's middle between them."""
_KING: Final = PieceSpec("king", Kind.KING, Colour.WHITE, A3)
_CALM: Final = Bounds(0.3, 3.0, 60.0)
"""On the way to where the cycle begins [m/s, m/s², m/s³]."""
_SPARE: Final = 0.96
"""Share of each limit that a plan may take, but for the peak torque, of which the settings say it."""
_BORNE: Final = 0.98 * math.sqrt(WARM)
"""The same of the mean torque: beyond ``WARM`` the controller slows the arm down, and tracking adds two percent."""
_SHARPNESS: Final = (60.0, 120.0, 240.0, 480.0)
"""Jerks that are tried, over accelerations [1/s]."""
_STEPS: Final = 8
"""Of the search for the largest acceleration, by halves."""
_RESTING: Final = 0.2
"""Until what swings in the fingers rests [s]."""


class Load(NamedTuple):
    """What is carried: its name, its mass [kg], and whether the fingers hold it, else it is bolted on."""

    name: str
    mass: float
    held: bool


KING: Final = Load("king", PIECE_SHAPES[Kind.KING].mass, held=True)
LOADS: Final = (KING, Load("kilogram", KILOGRAM, held=False))


class Middle(NamedTuple):
    """Of a cycle's way over, on the board, with the tool's height at its ends [m]; and its direction [rad]."""

    x: float
    y: float
    height: float
    direction: float

    @property
    def ends(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Points of the board and height, where the legs begin and end [m]."""
        dx, dy = (0.5 * ACROSS * part for part in (math.cos(self.direction), math.sin(self.direction)))
        return (self.x - dx, self.y - dy, self.height), (self.x + dx, self.y + dy, self.height)


@dataclass(frozen=True, slots=True)
class Cycle:
    """There and back, as planned, and what that takes."""

    middle: Middle
    settings: MotionSettings
    rest: NDArray[Any]
    """The sample in which it begins, (1,)."""
    samples: NDArray[Any]
    """Of one cycle, from rest to rest, from the tick after that."""
    start: Vector
    """Base frame, (3,) [m]."""
    used: dict[str, float]
    """Of each limit the share that the plan takes."""

    @property
    def limited_by(self) -> str:
        """The limit that it takes most of."""
        return max(self.used, key=lambda name: self.used[name])


class Went(NamedTuple):
    """How cycles were carried out; the torques of each tick, (n, 3) [N m]."""

    torques: Vector
    error: float  # the farthest the tool was from its reference, along an axis [m]
    speed: float  # the largest of the tool [m/s]
    slip: float  # of the king in the fingers [m]


def standard_cycle_bench(progress: Progress) -> BenchReport:
    """Measure: as quickly as the servomotors bear it without end, and once; a king also as profile fast moves.

    Raises:
        RuntimeError: a cycle was not carried out as planned.
    """
    rows = dict[str, Row]()
    for load in LOADS:
        middle = best_middle(load)
        progress(
            f"{load.name}: the way over is {middle.height * 1e3:.0f} mm above the board, its middle at "
            f"({middle.x * 1e3:.0f}, {middle.y * 1e3:.0f}) mm, {math.degrees(middle.direction):.0f}° from the ranks"
        )
        ways = {"lasting": quickest(middle, load, lasting=True)}
        ways["once"] = quickest(middle, load, lasting=False)
        if load.held:
            ways["game"] = planned(middle, GAME, load)
        for name, cycle in ways.items():
            bounds = cycle.settings
            progress(
                f"{load.name}, {name}: {cycle.limited_by} is at {max(cycle.used.values()):.0%} of what it may be, with "
                f"{bounds.speed:.1f} m/s, "
                f"{bounds.acceleration:.1f} m/s² and {bounds.jerk:.0f} m/s³"
            )
            rows |= _rows(f"{load.name}_{name}", cycle, load, lasting=name != "once")
    progress("king: grasped and set down at both ends")
    rows |= with_grasps()
    return BenchReport.of("standard cycle", 0, rows)


@cache
def loaded(load: Load) -> RobotParameters:
    """A robot with the load's mass at its gripper."""
    robot = load_parameters()
    inertia = robot.inertia
    heavier = inertia.model_copy(update={"gripper_body_mass": inertia.gripper_body_mass + load.mass})
    return robot.model_copy(update={"inertia": heavier})


def best_middle(load: Load) -> Middle:
    """Of those in reach the one at which profile fast takes the least mean torque."""
    return min(_middles(), key=lambda one: planned(one, GAME, load).used["mean torque"])


def _middles() -> Iterator[Middle]:
    """Where 305 mm may fit: above the zone near the board, and not so high that the arm is folded up."""
    lowest, highest = TABLE.limits.near_height, TABLE.centre_in_base[2] - HIGHEST_HOME - RISE
    for height in np.linspace(lowest, highest, 4).tolist():
        for y in np.linspace(-0.08, 0.08, 5).tolist():
            yield from (Middle(0.0, y, height, direction) for direction in (0.0, math.pi / 4.0, math.pi / 2.0))


# plans


def planned(middle: Middle, settings: MotionSettings, load: Load) -> Cycle:
    """Both legs; a place out of reach takes more than anything."""
    robot = loaded(load)
    cell = Workcell.of(settings, robot, TABLE)
    here, there = middle.ends
    legs = [_leg(cell, a, b, load) for a, b in ((here, there), (there, here))]
    drive, start = robot.drive, cell.base([here])[0]
    rest, samples = legs[0].samples[:1], np.concatenate([leg.samples[1:] for leg in legs])
    try:
        torques = np.concatenate([cell.torque.along(leg.motion)[0] for leg in legs])
    except ValueError:
        return Cycle(middle, settings, rest, samples, start, {"mean torque": math.inf})
    acceleration, speed = (np.linalg.norm(samples[of], axis=1).max() for of in ("acceleration", "velocity"))
    used = {
        "mean torque": float(np.sqrt((torques**2).mean(axis=0).max())) / drive.rated_torque / _BORNE,
        "peak torque": float(np.abs(torques).max()) / drive.peak_torque / settings.torque_share,
        "acceleration": float(acceleration) / cell.limits.acceleration / _SPARE,
        "speed": float(speed) / FASTEST,
        "servomotors' speed": _turning(cell, samples["position"]) / cell.limits.joint_speed / _SPARE,
    }
    return Cycle(middle, settings, rest, samples, start, used)


def _turning(cell: Workcell, positions: Vector) -> float:
    """The largest speed of a servomotor along positions a tick apart, base frame (n, 3) [rad/s]."""
    constants, angles = DeltaModel(cell.parameters).constants, np.zeros((len(positions[::EVERY]), 3))
    for (x, y, z), found in zip(positions[::EVERY].tolist(), angles, strict=True):
        inverse_kinematics(constants, (x, y, z), found, np.empty(6))
    return float(np.abs(np.diff(angles, axis=0)).max()) / (EVERY * cell.tick)


def _leg(cell: Workcell, here: tuple[float, float, float], there: tuple[float, float, float], load: Load) -> Timed:
    arc = Arc(here, there, 0.0, PIECE_SHAPES[Kind.KING], 0.0)  # whose corners are not to be passed over anything
    finger = 0.5 * cell.parameters.gripper.stroke
    route = Route(
        *over(cell, arc, Crowd.of([])), contact=(0.0, 0.0), finger=finger, opens=None if load.held else finger,
        holds=load.held,
    )  # fmt: skip
    return timed(route, cell.settings, cell.table, cell.tick)


def quickest(middle: Middle, load: Load, *, lasting: bool) -> Cycle:
    """The quickest cycle within all limits; ``lasting``: the mean torque, too, of cycles without end.

    Raises:
        RuntimeError: none is.
    """
    found = list[Cycle]()
    for speed in np.linspace(GAME.speed, FASTEST, 3).tolist():
        for sharpness in _SHARPNESS:
            low, high = 0.0, 45.0
            for _ in range(_STEPS):
                asked = 0.5 * (low + high)
                bounds = {"speed": speed, "acceleration": asked, "jerk": sharpness * asked}
                cycle = planned(middle, GAME.model_copy(update=bounds), load)
                limits = cycle.used if lasting else {**cycle.used, "mean torque": 0.0}
                if max(limits.values()) <= 1.0 + 1e-6:
                    low = asked
                    found.append(replace(cycle, used=limits))
                else:
                    high = asked
    if not found:
        raise RuntimeError(f"no cycle with {load.name} stays within the limits")
    return min(found, key=lambda one: len(one.samples))


# in the world


def _rows(name: str, cycle: Cycle, load: Load, *, lasting: bool) -> dict[str, Row]:
    """Carry a cycle out, again and again for more than the window, or once."""
    drive = load_parameters().drive
    duration = len(cycle.samples) * drive.tick
    went = carry_out(cycle, load, math.ceil(1.1 * WINDOW / duration) if lasting else 1)
    rows = {
        f"{name}_cycle": row([duration], "s"),
        f"{name}_torque": row([np.abs(went.torques).max()], "N m", drive.peak_torque, "max"),
        f"{name}_error": row([1e3 * went.error], "mm"),
        f"{name}_speed": row([went.speed], "m/s"),
    }
    if lasting:
        rows[f"{name}_rms"] = row(worst_rms(went.torques, drive.tick), "N m", drive.rated_torque, "max")
    if load.held:
        rows[f"{name}_slip"] = row([1e3 * went.slip], "mm")
    return rows


def carry_out(cycle: Cycle, load: Load, times: int) -> Went:
    """Cycles one after the other, from where the first one begins.

    Raises:
        RuntimeError: the controller stopped one, or the king was not grasped.
    """
    bed = _bed(load, TABLE)
    pressing = 0.0
    if load.held:
        pressing = -GAME.grip.closing_speed
        approach, grasp, *_ = _there_and_back(bed).motions
        bed.carry_out(approach)
        bed.carry_out(grasp, followed=True)
    for point in (np.append(bed.arm[0][:2], cycle.start[2]), cycle.start):
        _execute(bed, _going(bed, point, pressing))
    bed.wait(_RESTING)
    held_at = _in_fingers(bed)
    torques, errors, speeds = list[Any](), list[float](), list[float]()

    def note(supervisor: Supervisor) -> None:
        torques.append(supervisor.torque)
        state, reference = supervisor.law.state, supervisor.reference.position
        errors.append(float(np.abs(state.position - reference).max()))
        speeds.append(float(np.linalg.norm(state.velocity)))

    bed.listeners.append(note)
    _execute(bed, np.concatenate([cycle.rest, *[cycle.samples] * times]))
    bed.listeners.remove(note)
    bed.wait(_RESTING)
    slip = float(np.linalg.norm(_in_fingers(bed) - held_at))
    return Went(np.array(torques), max(errors), max(speeds), slip)


def _bed(load: Load, table: TableSettings) -> Bed:
    """A test bed with the load: a king that stands, or a mass that robot and controller have."""
    robot = load_parameters() if load.held else loaded(load)
    standing = (StandingPiece(_KING, *table.xy(_KING.place)),) if load.held else ()
    model = build_model(robot, table, standing, np.array(GAME.home), looks=False)
    return Bed(Plant(model, robot, tuple(piece.spec.name for piece in standing)), table, GAME)


def _there_and_back(bed: Bed) -> Plan:
    """The king is carried across the board and back again."""
    there = Transfer.of(_KING, H6)
    back = Transfer.of(replace(_KING, place=H6), A3)
    return bed.planner().ply("there and back", [there, back], Inventory.of([_KING], bed.table))


def _going(bed: Bed, point: Vector, finger_velocity: float) -> NDArray[Any]:
    """Straight to a point, base frame (3,) [m], calmly."""
    samples = straight(bed.arm[0], point, _CALM, GAME.gains.frequency_in_air, bed.parameters.drive.tick)
    samples["finger_velocity"] = finger_velocity
    return samples


def _execute(bed: Bed, samples: NDArray[Any]) -> None:
    ended = bed.execute(samples)
    if ended.result is not Result.DONE:
        raise RuntimeError(f"a cycle ended as {ended.result.name}: {explain(*ended.reason[:3])}")


def _in_fingers(bed: Bed) -> Vector:
    """Where the king is, seen from the tool [m]; nowhere if there is none."""
    here = np.array(bed.plant.truth(reset_peak=False).tool)
    king = bed.positions().get(_KING.name)
    return np.zeros(3) if king is None else king - here


def with_grasps() -> dict[str, Row]:
    """There and back in profile fast with all that a game does at both ends: the fingers close and open, the king is
    set down until it stands.
    """
    bed = _bed(KING, TableSettings(limits=contact_speeds(Profile.FAST)))
    plan, tick, parts = _there_and_back(bed), bed.parameters.drive.tick, Counter[Part]()
    for motion, followed in bed.continued(plan):
        begun = bed.supervisor.measurement.tick
        bed.carry_out(motion, followed)
        if motion.stage is not Stage.APPROACH:
            parts += time_by_part(motion, begun, bed.supervisor.admission.ended, tick)
    way = sum(math.dist(bed.table.xy(a), bed.table.xy(b)) for a, b in ((A3, H6), (H6, A3)))
    moving, whole = parts[Part.CARRY], sum(parts.values()) - parts[Part.RETURN]
    return {
        "grasped_cycle": row([whole], "s"),
        "grasped_moving": row([moving], "s"),
        "grasped_way": row([1e3 * way / 2.0], "mm"),
    }
