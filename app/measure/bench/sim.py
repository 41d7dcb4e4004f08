"""Bench ``sim``: how fast the simulated world runs with everything that belongs to it, and whether it repeats itself.

A game of Stockfish against itself in pace fast, world and controller in one process. The world keeps every command, so
that the same ticks can be done again by MuJoCo alone, which is what a tick costs at least. Then the game is played once
more, world and controller apart, while another process burns a processor: it is the same game. At last it is played on
one processor, and twice at once, each on a processor of its own.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from app import UserError
from app.measure.bench.report import BenchReport, Progress, Row, row
from app.play.launch import run_games
from app.records import Report
from app.records.telemetry import TELEMETRY_FILE, read_telemetry
from app.rig.simulation.settings import FAST_TELEMETRY
from app.settings.defaults import Processes
from app.settings.files import settings_of
from app.terminal.game_display import UserInterface
from hardware.interfaces import Pace
from hardware.sim.process.construction import Construction
from hardware.sim.process.journal import Replay, step_alone
from hardware.sim.process.settings import END_FILE, load_settings

SEED: Final = 1
PLIES: Final = {True: 6, False: 24}  # by ``quick``
NODES: Final = 20_000
COST_LIMIT: Final = 1.0 / 20.0
"""Wall time of a simulated second while ticks run, controller in the loop [s]."""
OVERHEAD_LIMIT: Final = 1.5  # that, over the cost of the same ticks in MuJoCo alone
AT_ONCE_LIMIT: Final = 0.85  # speed of each of two games at once, over that of one alone
CLOSURE_LIMIT: Final = 30.0  # of the arm's loops [µm]


class PlayedGame(NamedTuple):
    """A game as played."""

    report: Report
    wall: float  # how long it took [s, wall]
    telemetry: dict[int, str]  # what plant and controller told, by tick


class Again(NamedTuple):
    """A game's ticks done again."""

    simulated: float  # plant time [s]
    wall: float  # wall time of MuJoCo alone [s]
    closure: float  # widest gap of a closure [m]
    differs: bool  # whether the last state is another one than the world's


def sim_bench(quick: bool, progress: Progress) -> BenchReport:
    """Measure; ``quick``: 6 plies instead of 24.

    Raises:
        UserError: a game failed, or something is missing on this machine.
    """
    plies = PLIES[quick]
    with tempfile.TemporaryDirectory(prefix="touchmove-sim-") as name:
        folder = Path(name)
        progress(f"a game of {plies} plies, {NODES} nodes a move")
        first = play(folder / "first", plies)
        progress("its ticks again, without controller and processes")
        again = do_again(folder / "first" / "run")
        progress("the game again, in separate processes, with a load on the machine")
        with _load():
            second = play(folder / "second", plies, Processes.SEPARATE)
        progress("the game on one processor, and twice at once")
        cores = sorted(os.sched_getaffinity(0))
        alone = speeds_of(folder, plies, cores[:1])
        at_once = speeds_of(folder, plies, cores[:2]) if len(cores) > 1 else []
    return BenchReport.of("sim", SEED, rows_of(first, second, again, alone, at_once))


def rows_of(
    first: PlayedGame, second: PlayedGame, again: Again, alone: list[float], at_once: list[float]
) -> dict[str, Row]:
    """The rows of two games and the ticks of the first one, and of the speeds on single processors."""
    report = first.report
    assert report.speed is not None, "a world of our own has one"
    ticking = again.simulated / report.speed
    thinking = float(str(report.details.get("thinking_s", 0.0)))
    differing = [report.world_state != second.report.world_state, telemetry_differs(first.telemetry, second.telemetry)]
    return {
        "speed": row([report.speed], "s/s"),
        "cost": row([1.0 / report.speed], "s/s", COST_LIMIT, "max"),
        "mujoco_alone": row([again.wall / again.simulated], "s/s"),
        "over_mujoco": row([ticking / again.wall], "1", OVERHEAD_LIMIT, "max"),
        "speed_under_load": row([second.report.speed or 0.0], "s/s"),
        "cost_on_one_core": row([1.0 / speed for speed in alone], "s/s", COST_LIMIT, "max"),
        **({"at_once": row([speed / alone[0] for speed in at_once], "1", AT_ONCE_LIMIT, "least")} if at_once else {}),
        "thinking": row([thinking], "s"),
        "rendering_and_rest": row([first.wall - ticking - thinking], "s"),
        "closure": row([1e6 * again.closure], "µm", CLOSURE_LIMIT, "max"),
        "again_differs": row([float(again.differs)], "states", 0.0, "max"),
        "second_differs": row(differing, "records", 0.0, "max"),
    }


def speeds_of(folder: Path, plies: int, cores: list[int]) -> list[float]:
    """Plant time in wall time of games at once, each with all its processes on one of these processors.

    Raises:
        UserError: one failed.
    """
    command = [
        sys.executable, "-P", "-m", "app.cli", "demo", "--pace", "fast", "--seed", str(SEED), "--plies", str(plies),
        "--nodes", str(NODES), "--no-cameras", "--no-page", "--linger", "5", "--json", "--out",
    ]  # fmt: skip
    games = [
        subprocess.Popen(
            ["taskset", "--cpu-list", str(core), *command, str(folder / f"on-{core}-of-{len(cores)}")],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        )
        for core in cores
    ]  # fmt: skip
    said = [game.communicate()[0] for game in games]
    if any(game.returncode for game in games):
        raise UserError("a game on one processor failed: try 'touchmove demo --pace fast --no-cameras'")
    return [float(json.loads(one)["speed"]) for one in said]


def play(folder: Path, plies: int, processes: Processes = Processes.TOGETHER) -> PlayedGame:
    """One game.

    Raises:
        UserError: it failed.
    """
    settings = settings_of(
        {
            "rig.pace": Pace.FAST, "rig.processes": processes, "rig.seed": SEED, "rig.video": False,
            "rig.linger": 5.0, "rig.journal": True,
            "game.plies": plies, "engine.nodes": NODES, "out": folder,
        }
    )  # fmt: skip
    since = time.perf_counter()
    done = run_games(settings, UserInterface())
    wall = time.perf_counter() - since
    if not done.holds:
        raise UserError(f"the game failed: {'; '.join(one.reason for one in done.report.failures)}")
    return PlayedGame(done.report, wall, _told(folder / TELEMETRY_FILE))


def _told(path: Path) -> dict[int, str]:
    """What telemetry says of plant and controller at the ticks at which it is sent in any case.

    What is told in between, and of the link, depends on the machine.
    """
    told = dict[int, str]()
    for _, one in read_telemetry(path):
        if one.tick % FAST_TELEMETRY == 0 and one.tick not in told:
            told[one.tick] = repr(
                (one.state, one.angle, one.angle_velocity, one.position, one.velocity, one.reference, one.torque,
                 one.finger_position, one.tactile)
            )  # fmt: skip
    return told


def telemetry_differs(first: dict[int, str], second: dict[int, str]) -> bool:
    """Whether two games told anything else, from when both recorders were listening to when the first one stopped."""
    begin, end = max(min(first), min(second)), min(max(first), max(second))
    return any(first.get(tick) != second.get(tick) for tick in first.keys() | second.keys() if begin <= tick <= end)


def do_again(run_dir: Path) -> Again:
    """What a world did, done again with a look at the closures in every tick, and then timed by MuJoCo alone."""
    construction, replay = Construction.of(load_settings(run_dir)), Replay(run_dir)
    watched, alone, widest = construction.plant(), construction.plant(), [0.0]
    acting = replay.run_watched(watched, lambda: widest.append(max(widest.pop(), watched.closure_gap())))
    since = time.perf_counter()
    step_alone(alone, acting)
    wall = time.perf_counter() - since
    end = json.loads((run_dir / END_FILE).read_text(encoding="utf-8"))
    differs = watched.digest() != end["state_sha256"] or not np.array_equal(watched.positions(), alone.positions())
    return Again(len(replay) * watched.parameters.drive.tick, wall, widest[0], differs)


@contextmanager
def _load() -> Iterator[None]:
    """Another process burns a processor within the block."""
    process = subprocess.Popen([sys.executable, "-c", "while True: sum(range(100_000))"])
    try:
        yield
    finally:
        process.kill()
        process.wait()
