"""Bench ``law``: how long a tick of the control law takes, on ticks that a supervisor lived through.

Row ``tick`` is the pair of calls that the supervisor makes, `TaskSpaceController.update` and `.torque`, from Python.
The same ticks must give the same torques, positions and velocities as in the supervisor, to the last bit.
"""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from time import perf_counter_ns
from typing import Final, NamedTuple

import numpy as np

from app.measure.bench.beds.recording import Tick, TickRecording, found, record
from app.measure.bench.parts import Poses, nothing, time_parts
from app.measure.bench.report import BenchReport, Progress, Row, row
from controller.law.task_space import TaskSpaceController, pack_reference
from controller.model.compiled import FloatArray
from controller.model.constants import DISTAL, DeltaModel
from controller.model.kinematics import arm_directions
from controller.model.state import blank_state

TICKS: Final = 10_000
SEED: Final = 1
TICK_LIMIT: Final = 3.0
"""p50 of a tick [µs]."""
TAIL_LIMIT: Final = 30.0
"""p99.9 of a tick [µs]."""
CLOSURE_LIMIT: Final = 1e-8
"""Newton must leave less than this between the arms' tool points [m]."""
FIRST_COMPILE_LIMIT: Final = 20.0
CACHED_START_LIMIT: Final = 1.0
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


def law_bench(quick: bool, progress: Progress) -> BenchReport:
    """Measure; ``quick``: the ticks once instead of five times, three starts from the cache instead of seven."""
    progress(f"recording {TICKS} ticks of a game in the simulated world")
    recording = record(TICKS, SEED)
    model = DeltaModel(recording.parameters)
    progress("comparing with the supervisor")
    rows, poses = _verified(model, recording)
    progress("timing the law")
    rows |= _timed(model, recording, 1 if quick else 5)
    rows |= {name: row(values, "µs") for name, values in time_parts(model, poses).items()}
    progress("compiling the law in a process with an empty cache (about 10 s)")
    starts = measure_starts(3 if quick else 7)
    rows["first_compile"] = row([starts.first], "s", FIRST_COMPILE_LIMIT)
    rows["cached_start"] = row(starts.cached, "s", CACHED_START_LIMIT)
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
    gc.collect()  # as the server does before its loop
    gc.freeze()
    try:
        tick = np.array([_tick_durations(model, recording) for _ in range(rounds)]) / 1e3
        update, torque = np.concatenate([_call_durations(model, recording) for _ in range(rounds)]).T / 1e3
        call = np.array(_calls(recording.ticks)) / 1e3
    finally:
        gc.unfreeze()
    tail = float(np.percentile(tick, 99.9))
    return {
        "tick": row(tick, "µs", TICK_LIMIT),
        "tick_p99_9": row([tail], "µs", TAIL_LIMIT, "max", tick.size),
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
        nothing(state, tick.angle, tick.velocity)
        durations.append(clock() - start)
    return durations


# how long a new process needs until its first tick: with nothing compiled yet, and from the cache on disk


class Starts(NamedTuple):
    """Seconds of wall time from the first import to the first torque."""

    first: float
    """With an empty cache: everything is compiled."""
    cached: list[float]
    """Later starts, one by one."""


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
