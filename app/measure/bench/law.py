"""Bench ``law``: how long a tick of the control law takes, on ticks that a supervisor lived through.

Row ``tick`` is the pair of calls that the supervisor makes, `TaskSpaceController.update` and `.torque`, from Python.
The same ticks must give the same torques, positions and velocities as in the supervisor, to the last bit.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from time import perf_counter_ns
from typing import Final, NamedTuple

import numpy as np

from app.measure.bench.beds.recording import Tick, TickRecording, found, record
from app.measure.bench.report import BenchReport, Progress, Row, row
from controller.law.task_space import TaskSpaceController, pack_reference
from controller.model.compiled import STATUS, TABLE, VECTOR, FloatArray, Vector, compiled, compiled_as, direct
from controller.model.constants import COULOMB, DISTAL, VISCOUS, DeltaModel
from controller.model.dynamics import gravity_torque, joint_inertia, shaft_friction
from controller.model.kinematics import Triad, arm_directions, control_jacobian, elbows, tool_point_near
from controller.model.state import blank_state
from hardware.realtime import quiet_memory

TICKS: Final = 10_000
SEED: Final = 1
CLOSURE_LIMIT: Final = 1e-8
"""Newton must leave less than this between the arms' tool points [m]."""
BATCH = 100  # ticks of one timed loop; its duration divided by this is one value of a part
FRICTION_SPEED = 0.05
Part = Callable[[slice], float]
FIRST_TICK = """
import time
start = time.perf_counter()
from controller.law.task_space import TaskSpaceController, pack_reference
from controller.model.constants import DeltaModel
from hardware.parameters import load_parameters
law = TaskSpaceController(DeltaModel(load_parameters()))
assert law.update((0.3, 0.3, 0.3), (0.0, 0.0, 0.0)) == 0
law.torque(pack_reference((0.0, 0.0, 0.4)))
print(time.perf_counter() - start)
"""
"""Run in a new process: how long until its first tick."""


class Poses(NamedTuple):
    """Recorded ticks as arrays, one row each."""

    angle: FloatArray  # y, shape (n, 3) [rad]
    velocity: FloatArray  # ẏ, shape (n, 3) [rad/s]
    near: FloatArray  # z from which Newton starts, shape (n, 3) [m]
    rods: FloatArray  # d_1, d_2, d_3, shape (n, 3, 3)
    elbows: FloatArray  # e_1, e_2, e_3, shape (n, 3, 3)
    jacobian: FloatArray  # J_c, shape (n, 3, 3) [m/rad]


def law_bench(quick: bool, progress: Progress) -> BenchReport:
    """Measure; ``quick``: the ticks once instead of five times, three starts from the cache instead of seven."""
    progress(f"recording {TICKS} ticks of a game in the simulated world")
    recording = record(TICKS, SEED)
    model = DeltaModel(recording.parameters)
    progress("comparing with the supervisor")
    rows, poses = _verified(model, recording)
    progress("timing the law")
    rows |= _timed(model, recording, 1 if quick else 5)
    rows |= {name: row(values, "µs") for name, values in _time_parts(model, poses).items()}
    progress("compiling the law in a process with an empty cache (about 10 s)")
    starts = measure_starts(3 if quick else 7)
    rows["first_compile"] = row([starts.first], "s", 20.0)
    rows["cached_start"] = row(starts.cached, "s", 1.0)
    return BenchReport.of("law", SEED, rows)


def replayed(model: DeltaModel, recording: TickRecording) -> TaskSpaceController:
    """A new law that has lived through the recording's first ticks, those on the brakes."""
    law = TaskSpaceController(model)
    for tick in recording.boot:
        law.update(tick.angle, tick.velocity)
    return law


def _verified(model: DeltaModel, recording: TickRecording) -> tuple[dict[str, Row], Poses]:
    """Run the law over the recording: rows on what it found, and its poses."""
    law = replayed(model, recording)
    n = len(recording.ticks)
    poses = Poses(*(np.empty((n, *shape)) for shape in ((3,), (3,), (3,), (3, 3), (3, 3), (3, 3))))
    differing, steps, closure, state = 0, np.empty(n), np.empty(n), law.state
    for k, tick in enumerate(recording.ticks):
        poses.near[k] = state.position
        differing += not _same(law, tick)
        steps[k] = state.quality[2]
        poses.angle[k], poses.velocity[k] = state.angle, state.rate
        poses.jacobian[k] = state.jacobian
        x, y, z = state.position.tolist()
        poses.rods[k], poses.elbows[k] = arm_directions(model.constants, state.angle, (x, y, z))
        # with each distal link pointing to where the law says that the tool is, no two tips are farther apart
        closure[k] = 2.0 * model.constants[DISTAL] * np.abs(np.linalg.norm(poses.rods[k], axis=1) - 1.0).max()
    rows = {
        "differing_ticks": row([differing], "ticks", 0.0, "max"),
        "newton_steps": row(steps, "steps"),
        "newton_closure": row(closure, "m", CLOSURE_LIMIT, "max"),
    }
    return rows, poses


def _same(law: TaskSpaceController, tick: Tick) -> bool:
    """Whether the law finds in a tick what the supervisor's found, to the last bit."""
    law.update(tick.angle, tick.velocity)
    before = found(law)
    assert tick.reference is not None
    torque = law.torque(tick.reference, tick.tactile)
    return before.tobytes() == tick.found.tobytes() and np.array(torque).tobytes() == np.array(tick.torque).tobytes()


def _timed(model: DeltaModel, recording: TickRecording, rounds: int) -> dict[str, Row]:
    """Rows of the calls from Python [µs]."""
    with quiet_memory():  # as the server's loop has it
        tick = np.array([_tick_durations(model, recording) for _ in range(rounds)]) / 1e3
        update, torque = np.concatenate([_call_durations(model, recording) for _ in range(rounds)]).T / 1e3
        call = np.array(_calls(recording.ticks)) / 1e3
    tail = float(np.percentile(tick, 99.9))
    return {
        "tick": row(tick, "µs", 3.0),
        "tick_p99_9": row([tail], "µs", 30.0, "max", tick.size),
        "update": row(update, "µs"),
        "torque": row(torque, "µs"),
        "call": row(call, "µs"),
    }


def _tick_durations(model: DeltaModel, recording: TickRecording) -> list[int]:
    """Of ``update`` and ``torque`` together in each tick [ns]; the clock's own time is in it once."""
    law = replayed(model, recording)
    clock, update, torque = perf_counter_ns, law.update, law.torque
    durations, reference = [], pack_reference((0.0, 0.0, 0.0))
    for tick in recording.ticks:
        angle, velocity, tactile = tick.angle, tick.velocity, tick.tactile
        reference[:] = tick.reference  # one row that is written anew in each tick, as in the supervisor
        start = clock()
        update(angle, velocity)
        torque(reference, tactile)
        durations.append(clock() - start)
    return durations


def _call_durations(model: DeltaModel, recording: TickRecording) -> FloatArray:
    """Of ``update`` and ``torque`` by themselves, shape (n, 2) [ns]; the clock's own time is in each."""
    law = replayed(model, recording)
    times, reference = np.zeros((len(recording.ticks), 3), dtype=np.int64), pack_reference((0.0, 0.0, 0.0))
    clock, update, torque = perf_counter_ns, law.update, law.torque
    for k, tick in enumerate(recording.ticks):
        angle, velocity, tactile = tick.angle, tick.velocity, tick.tactile
        reference[:] = tick.reference
        start = clock()
        update(angle, velocity)
        middle = clock()
        torque(reference, tactile)
        times[k] = start, middle, clock()
    return np.asarray(np.diff(times, axis=1), dtype=np.float64)


def _calls(ticks: Sequence[Tick]) -> list[int]:
    """Durations of calls that do nothing [ns]."""
    state, clock = blank_state(), perf_counter_ns
    durations = []
    for tick in ticks:
        start = clock()
        _nothing(state, tick.angle, tick.velocity)
        durations.append(clock() - start)
    return durations


# how long a new process needs until its first tick: with nothing compiled yet, and from the cache on disk


class Starts(NamedTuple):
    """Seconds of wall time from the first import to the first torque."""

    first: float  # with an empty cache: everything is compiled
    cached: list[float]  # later starts, one by one


def measure_starts(cached: int) -> Starts:
    """Start the law in so many processes and one before, with a cache directory that is empty before that one."""
    with tempfile.TemporaryDirectory(prefix="touchmove-bench-") as folder:
        return Starts(start_once(folder), [start_once(folder) for _ in range(cached)])


def start_once(cache: str) -> float:
    """Seconds from the first import to the first torque in a new process with this cache directory."""
    done = subprocess.run(
        [sys.executable, "-c", FIRST_TICK],
        env={**os.environ, "NUMBA_CACHE_DIR": cache}, stdin=subprocess.DEVNULL, capture_output=True, text=True,
        check=True, timeout=120,
    )  # fmt: skip
    return float(done.stdout)


# the parts of a tick, each alone in a compiled loop over recorded ticks: what they cost without Python's calls; every
# loop returns a sum of what it computed, so that nothing of it can be left out by the compiler


@compiled_as(STATUS(TABLE, VECTOR, VECTOR))
def _idle(state: FloatArray, angle: Vector, velocity: Vector) -> int:
    """Takes what the estimator takes and does nothing."""
    return 0


_nothing = direct(_idle)  # the price of a call from Python


@compiled
def _triad(rows: FloatArray) -> Triad:
    return (
        (rows[0, 0], rows[0, 1], rows[0, 2]),
        (rows[1, 0], rows[1, 1], rows[1, 2]),
        (rows[2, 0], rows[2, 1], rows[2, 2]),
    )


@compiled
def _newton(constants: FloatArray, angle: FloatArray, near: FloatArray) -> float:
    total = 0.0
    for k in range(angle.shape[0]):
        centres, _ = elbows(constants, angle[k])
        _, steps, z, _ = tool_point_near(constants, centres, (near[k, 0], near[k, 1], near[k, 2]))
        total += steps + z[2]
    return total


@compiled
def _jacobian(constants: FloatArray, rods: FloatArray, elbows: FloatArray, room: FloatArray) -> float:
    total = 0.0
    for k in range(rods.shape[0]):
        total += control_jacobian(constants, _triad(rods[k]), _triad(elbows[k]), room[:3], room[3:])[1]
    return total


@compiled
def _inertia(constants: FloatArray, elbows: FloatArray, jacobian: FloatArray, room: FloatArray) -> float:
    total = 0.0
    for k in range(elbows.shape[0]):
        joint_inertia(constants, _triad(elbows[k]), jacobian[k], room[:3])
        total += room[0, 0]
    return total


@compiled
def _gravity(constants: FloatArray, elbows: FloatArray, jacobian: FloatArray, room: FloatArray) -> float:
    total = 0.0
    for k in range(elbows.shape[0]):
        gravity_torque(constants, _triad(elbows[k]), jacobian[k], room[0])
        total += room[0, 0]
    return total


@compiled
def _friction(constants: FloatArray, velocity: FloatArray, viscous: float, coulomb: float, speed: float) -> float:
    total = 0.0
    for k in range(velocity.shape[0]):
        for i in range(3):
            total += shaft_friction(velocity[k, i], viscous, coulomb, speed)
    return total


def tick_parts(model: DeltaModel, poses: Poses) -> dict[str, Part]:
    """The parts by name; each runs over a slice of the recorded ticks."""
    c, p, room = model.constants, poses, np.zeros((6, 3))
    viscous, coulomb = float(c[VISCOUS]), float(c[COULOMB])
    return {
        "newton": lambda s: _newton(c, p.angle[s], p.near[s]),
        "jacobian": lambda s: _jacobian(c, p.rods[s], p.elbows[s], room),
        "inertia": lambda s: _inertia(c, p.elbows[s], p.jacobian[s], room),
        "gravity": lambda s: _gravity(c, p.elbows[s], p.jacobian[s], room),
        "friction": lambda s: _friction(c, p.velocity[s], viscous, coulomb, FRICTION_SPEED),
    }


def _time_parts(model: DeltaModel, poses: Poses) -> dict[str, list[float]]:
    """Duration of each part for one tick [µs]: one value for each batch of ticks."""
    slices = [slice(k, k + BATCH) for k in range(0, len(poses.angle), BATCH)]
    found = dict[str, list[float]]()
    for name, part in tick_parts(model, poses).items():
        part(slices[0])  # compiles, or loads what was compiled
        found[name] = []
        for which in slices:
            start = perf_counter_ns()
            part(which)
            found[name].append((perf_counter_ns() - start) / 1e3 / BATCH)
    return found
