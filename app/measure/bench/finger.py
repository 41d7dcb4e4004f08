"""Bench ``finger``: a person's finger in the way of the arm, free in the air and clamped between gripper and board.

Random straight moves at the profile's limits; somewhere on each an unannounced finger. Judged by what
the finger feels: the peak, how long until it feels less than 10 N for good, and what still presses afterwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from app.measure.bench.beds.bed import Bed, straight
from app.measure.bench.report import BenchReport, Progress, Row, row
from app.motion import MotionSettings
from app.motion.timing.reference import Bounds, Vector
from controller.loop.admission import Ended
from controller.protection.limits import REACTIONS, Reaction
from controller.protocol import Result
from controller.protocol.cause_sentences import explain
from controller.protocol.states import State
from hardware.contact_speeds import ContactSpeeds
from hardware.parameters import RobotParameters, load_parameters
from hardware.sim.bodies.finger_world import RADIUS, Finger, build_finger_world, finger_force
from hardware.sim.plant.plant import Plant
from hardware.table import TableSettings

SEED: Final = 1
TRIALS: Final = {True: 40, False: 200}  # by ``quick``
PROFILES: Final = {
    "default": (ContactSpeeds(), 140.0),
    "gentle": (ContactSpeeds(tool_speed=0.4, downward_speed=0.22), 70.0),
}
"""Speeds, and the largest force that a finger may feel [N]."""
RELEASED: Final = 10.0  # a finger that feels so much has been met; it must feel less … [N]
WITHIN: Final = 0.3  # … so long after it was met [s], and from then on
WATCHED: Final = 0.8  # how long a trial goes on after the contact [s]
_STIFF: Final = 70.0


class FingerTrial(NamedTuple):
    """One move and the finger in its way; points in the board frame [m]."""

    start: Vector
    end: Vector
    finger: Finger


class Missed(Exception):
    """The finger was not in the way after all."""


class Felt(NamedTuple):
    """What the finger felt."""

    peak: float  # [N]
    freed: float  # from the contact until it felt less than 10 N for good [s]
    pressing: float  # the largest force later than 0.3 s after the contact [N]
    at_rest: bool  # whether the arm rested at the end


def in_the_air(parameters: RobotParameters, random: np.random.Generator) -> FingerTrial:
    """A move over the board with a free finger in the way of pads, fingers or the gripper's body."""
    while True:
        start, end = (np.append(random.uniform(-0.16, 0.16, 2), random.uniform(0.06, 0.15)) for _ in range(2))
        if np.linalg.norm(end - start) > 0.12:
            break
    point = start + random.uniform(0.4, 0.7) * (end - start)
    side = random.choice([-1.0, 1.0]) * parameters.gripper.stroke / 2.0
    point += [side + random.uniform(-0.006, 0.006), random.uniform(-0.004, 0.004), random.uniform(-0.004, 0.02)]
    return FingerTrial(start, end, Finger((float(point[0]), float(point[1]), float(point[2])), clamped=False))


def on_the_board(parameters: RobotParameters, random: np.random.Generator) -> FingerTrial:
    """A descent lower than any grip, with a finger on the board below a pad."""
    x, y = random.uniform(-0.16, 0.16, 2)
    start, end = np.array([x, y, random.uniform(0.11, 0.15)]), np.array([x, y, random.uniform(0.010, 0.018)])
    side = random.choice([-1.0, 1.0]) * (parameters.gripper.stroke / 2.0 + 0.002)
    return FingerTrial(start, end, Finger((float(x + side), float(y), RADIUS), clamped=True))


KINDS: Final = {"free": in_the_air, "clamped": on_the_board}


def meet(trial: FingerTrial, limits: ContactSpeeds) -> Felt:
    """Carry a trial out, as fast as the profile's limits let it.

    Raises:
        Missed: the finger was not met.
        RuntimeError: the controller refused the move.
    """
    table, settings, parameters = TableSettings(limits=limits), MotionSettings(), load_parameters()
    tick = parameters.drive.tick
    start, end = table.base_from_board(trial.start), table.base_from_board(trial.end)
    plant = Plant(build_finger_world(parameters, table, start, trial.finger), parameters, ())
    bed = Bed(plant, table)
    bounds = Bounds(_speed(trial, limits), settings.acceleration, settings.jerk)
    bed.begin(straight(bed.arm[0], end, bounds, _STIFF, tick))
    forces: list[float] = []
    met = None
    while met is None or len(forces) < met + WATCHED / tick:
        bed.tick()
        forces.append(finger_force(plant.model, plant.data))
        if met is None and forces[-1] >= RELEASED:
            met = len(forces)
        if met is None and bed.supervisor.admission.motion.announced is None:
            _explain(bed.supervisor.admission.ended)
            met = len(forces)
    felt = np.array(forces[met - 1 :])
    pressed = np.flatnonzero(felt >= RELEASED)
    freed = float((pressed[-1] + 1) * tick) if pressed.size else 0.0
    resting = bed.supervisor.state in (State.HOLD, State.FAULT) and plant.arm_speed() < 0.02
    return Felt(float(felt.max()), freed, float(felt[round(WITHIN / tick) :].max()), resting)


def _speed(trial: FingerTrial, limits: ContactSpeeds) -> float:
    """As the planner has it: slower where a move goes down near the board [m/s]."""
    way = trial.end - trial.start
    down = -float(way[2]) / float(np.linalg.norm(way))
    if down <= 0.0 or trial.end[2] >= limits.near_height:
        return limits.tool_speed
    return min(limits.tool_speed, limits.downward_speed / down)


def _explain(ended: Ended) -> None:
    """A motion is over before the finger felt much: it missed it, gave way at once, or never began."""
    if ended.result is Result.DONE:
        raise Missed
    if REACTIONS.get(ended.reason.cause) is Reaction.COMPLIANT:
        return
    raise RuntimeError(f"the controller did not carry out the move: {explain(*ended.reason[:3])}")


def finger_bench(quick: bool, progress: Progress) -> BenchReport:
    """Measure; ``quick``: 40 moves instead of 200."""
    trials = TRIALS[quick] // (len(PROFILES) * len(KINDS))
    rows: dict[str, Row] = {}
    for profile, (limits, limit) in PROFILES.items():
        for kind in KINDS:
            progress(f"{trials} fingers, {kind}, profile {profile}")
            rows |= _rows(f"{profile}_{kind}", _trials(kind, trials, limits), limit)
    return BenchReport.of("finger", SEED, rows)


def _trials(kind: str, count: int, limits: ContactSpeeds) -> list[Felt]:
    """So many trials in which the finger was met; a random move that misses it is drawn again."""
    random = np.random.default_rng([SEED, list(KINDS).index(kind)])
    found: list[Felt] = []
    while len(found) < count:
        try:
            found.append(meet(KINDS[kind](load_parameters(), random), limits))
        except Missed:
            continue
    return found


def _rows(name: str, felt: Sequence[Felt], limit: float) -> dict[str, Row]:
    return {
        f"{name}_peak": row([one.peak for one in felt], "N", limit, "max"),
        f"{name}_freed": row([one.freed for one in felt], "s", WITHIN, "max"),
        f"{name}_pressing": row([one.pressing for one in felt], "N", RELEASED, "max"),
        f"{name}_moving_at_the_end": row([sum(not one.at_rest for one in felt)], "trials", 0.0, "max"),
    }
