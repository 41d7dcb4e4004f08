"""Bench ``loop``: how regularly the controller ticks while the rest of the program is busy.

World, controller and this process run in pace real, telemetry flows, the arm moves back and forth, and Stockfish thinks
on every core. The figures are the controller's own, of its whole run. With watchers it is measured twice, without and
with a page at which so many browsers show the arm in three dimensions and the camera's picture.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from itertools import cycle
from typing import Final

import chess
import numpy as np

from app import UserError
from app.commissioning.link_test import ProcessorTime, stolen_share
from app.measure.bench.beds.bed import straight
from app.measure.bench.beds.watched_page import watched_page
from app.measure.bench.report import BenchReport, Progress, Row, row
from app.motion import Motion, MotionSettings, Plan
from app.motion.timing.reference import Bounds, Vector
from app.rig.arm import Arm, ArmPaused
from app.rig.shown_arm import ShownArm
from app.rig.simulation.timed import RunEnd, Statistics, TimedRig, timed_rig
from controller.wire.errors import ControllerError
from engine.errors import EngineProblem
from engine.stockfish import Engine, EngineSettings

SEED: Final = 1
DURATION: Final = {True: 15.0, False: 60.0}  # how long the arm moves [s], by ``quick``
MISSED_LIMIT: Final = 0.1  # ticks without an exchange, with real time [%]
WORK_LIMIT: Final = 200.0  # p99 of a tick's whole computation, with real time [µs]
STOLEN: Final = 0.001  # share of the processors' time; no privilege helps against a host that takes more
WAY: Final = ((0.12, 0.02, 0.335), (-0.12, -0.05, 0.345), (0.06, -0.10, 0.355), (-0.08, 0.10, 0.33))
"""The arm goes round these tool points, base frame [m]; above every piece."""
THOUGHT: Final = 0.5  # Stockfish is asked anew after this [s]
POSITION: Final = "r1bq1rk1/pp2bppp/2n1pn2/3p4/3P1B2/2PBPN2/PP1N1PPP/R2Q1RK1 w - - 0 9"
"""A middle game with much to think about."""
HASH_MB: Final = 64


def loop_bench(quick: bool, progress: Progress, watchers: int = 0) -> BenchReport:
    """Measure for 60 s, or ``quick`` for 15 s; says, too, which part of real time was not granted.

    With ``watchers`` once more, with a page and so many browsers at it.

    Raises:
        UserError: there is no Stockfish, or it failed; or the page did.
    """
    duration, cameras = DURATION[quick], watchers > 0
    end, stopped, stolen, _ = _measured(duration, progress, 0, cameras=cameras)
    rows = loop_rows(end, stopped, stolen)
    if watchers:
        unwatched = rows["missed_ticks"]
        end, stopped, stolen, watched = _measured(duration, progress, watchers, cameras=cameras)
        rows = {**watched_rows(loop_rows(end, stopped, stolen), unwatched, end), **watched}
    for note in end.statistics.realtime.notes:
        progress(note)
    if stolen > STOLEN:
        progress(
            f"the host of this virtual machine took {100.0 * stolen:.2g} % of its processors, at most "
            f"{100.0 * STOLEN:g} % leaves a loop alone: measure on a PC of its own"
        )
    return BenchReport.of("loop", SEED, rows, "real")


def _measured(
    duration: float, progress: Progress, watchers: int, *, cameras: bool
) -> tuple[RunEnd, int, float, dict[str, Row]]:
    """A run: its end, motions that did not end as planned, stolen time, and the rows of the page where it has one."""
    with timed_rig(SEED, progress, cameras=cameras) as timed, ExitStack() as stack:
        page = None
        arm: Arm = timed.rig.arm
        if watchers:
            page = stack.enter_context(watched_page(timed.rig, timed.file.run_dir.parent, watchers, progress))
            arm = ShownArm(arm, page.publisher.path)
        stack.enter_context(thinking(progress))
        progress(f"moving the arm for {duration:g} s")
        first, before = None if page is None else page.glance(), ProcessorTime.now()
        stopped = sweep(timed, arm, duration, progress)
        stolen = stolen_share(before, ProcessorTime.now())
        rows = {} if page is None or first is None else first.rows_until(page.glance())
        return timed.finish(), stopped, stolen, rows


def watched_rows(rows: dict[str, Row], unwatched: Row, end: RunEnd) -> dict[str, Row]:
    """Those of a run with watchers beside what was missed without them: no more may be, as far as runs repeat."""
    limit = unwatched.max + MISSED_LIMIT if end.statistics.realtime.granted else None
    missed = row([rows["missed_ticks"].max], "%", limit, "max", rows["missed_ticks"].n)
    return {**rows, "missed_ticks": missed, "missed_unwatched": unwatched}


def loop_rows(end: RunEnd, stopped: int, stolen: float) -> dict[str, Row]:
    """The rows: what must hold holds only where real time was granted, but the arm must rest in any case.

    ``stopped`` motions did not end as planned; ``stolen`` is the share of the processor's time that the host of a
    virtual machine took, 0 to 1.
    """
    statistics, granted = end.statistics, end.statistics.realtime.granted
    limit = MISSED_LIMIT if granted else None
    return {
        "real_time": row([float(granted)], "granted"),
        "missed_ticks": row([100.0 * statistics.missed], "%", limit, "max", statistics.ticks + statistics.skipped),
        "tick_work": time_row(statistics.work, WORK_LIMIT if granted else None),
        "law": time_row(statistics.law),
        "lateness": time_row(statistics.lateness),
        "period_error": time_row(statistics.period_error),
        "stolen_time": row([100.0 * stolen], "%"),
        "stopped_motions": row([stopped], "motions"),
        "arm_not_at_rest": row([float(not end.at_rest)], "arms", 0.0, "max"),
    }


def sweep(timed: TimedRig, arm: Arm, duration: float, progress: Progress) -> int:
    """Move an arm of a rig back and forth for so long [s, wall]; the number of motions that did not end as planned.

    Why they did not is said, each reason once.
    """
    until, reasons = time.monotonic() + duration, list[str]()
    for target in cycle(WAY):
        if time.monotonic() >= until:
            break
        try:
            motion = sweep_motion(arm.state().reference, np.array(target), timed.motion, timed.tick)
            arm.execute(Plan("sweep", (motion,)))
        except (ControllerError, ArmPaused) as error:
            if timed.rig.failure() is not None:
                raise UserError(f"the bench was cut short: {timed.rig.failure()}") from error
            if str(error) not in reasons:
                progress(f"a motion was stopped: {error}")
            reasons.append(str(error))
            arm.resume()  # otherwise all that follow would be refused, and count
    return len(reasons)


def sweep_motion(start: Vector, end: Vector, settings: MotionSettings, tick: float) -> Motion:
    """One straight motion from the present reference at the speed of a game, base frame (3,) [m], fingers at rest.

    ``tick`` is that of the drives [s]: of samples for another one the controller finds that positions jump.
    """
    bounds = Bounds(settings.speed, settings.acceleration, settings.jerk)
    samples = straight(start, end, bounds, settings.gains.frequency_in_air, tick)
    return Motion("sweep", samples, len(samples) * tick)


@contextmanager
def thinking(progress: Progress) -> Iterator[None]:
    """Stockfish thinks on every core within the block.

    Raises:
        UserError: there is no Stockfish, or it failed.
    """
    settings = EngineSettings(threads=os.cpu_count() or 1, hash_mb=HASH_MB, move_time=THOUGHT)
    progress(f"Stockfish thinks with {settings.threads} threads")
    done, troubles = threading.Event(), list[EngineProblem]()

    def think(engine: Engine) -> None:
        try:
            while not done.is_set():
                engine.choose(chess.Board(POSITION))
        except EngineProblem as error:
            troubles.append(error)

    try:
        with Engine(settings) as engine:
            thinker = threading.Thread(target=think, args=(engine,), name="thinking")
            thinker.start()
            try:
                yield
            finally:
                done.set()
                thinker.join()
        if troubles:
            raise troubles[0]
    except EngineProblem as error:
        raise UserError(str(error)) from error


def time_row(statistics: Statistics, limit: float | None = None) -> Row:
    """In µs; a limit is one of p99."""
    mean, p50, p99, largest = (1e6 * v for v in (statistics.mean, statistics.p50, statistics.p99, statistics.max))
    holds = limit is None or p99 <= limit
    return Row(unit="µs", n=statistics.n, mean=mean, p50=p50, p99=p99, max=largest, limit=limit, holds=holds)
