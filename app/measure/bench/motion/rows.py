"""Bench ``motion``: how quickly and how gently the pieces of random games are moved, in the world.

Every piece stands off its place by up to 3 mm along both axes, and the controller's masses are wrong by up to 5 %.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from app.measure.bench.beds.parts import Part
from app.measure.bench.beds.plies import Disorder, Done, Games, slides
from app.measure.bench.beds.touchdown import TARGET, Touchdown, set_down
from app.measure.bench.motion.optimum import NoOptimum, casadi, optimal_duration
from app.measure.bench.motion.torques import worst_rms
from app.measure.bench.report import BenchReport, Progress, Row, row
from app.motion import PROFILES, Motion, MotionSettings, Profile, contact_speeds
from app.motion.path import STRAIGHT, Path, blend, turns
from app.motion.settings import Law
from app.motion.timing.time_law import Bounds, bounds_of_pieces, time_law
from app.pieces.inventory import MoveKind
from controller.protocol import Guard
from hardware.parameters import load_parameters
from hardware.piece_set import Kind
from hardware.table import TableSettings, square_place

SEED: Final = 1
TRANSFERS: Final = {Profile.DEFAULT: 500, Profile.FAST: 150, Profile.GENTLE: 60}
QUICK: Final = {Profile.DEFAULT: 20, Profile.FAST: 12, Profile.GENTLE: 4}
COMPARED: Final = {True: 8, False: 150}  # motions whose duration is compared with the optimum, by ``quick``
DISORDER: Final = Disorder(offset=(0.003, 0.003), mass_error=0.05)
QUIET: Final = {Profile.DEFAULT: 1.6, Profile.FAST: 0.95}
"""A quiet ply from home to home, mean [s]."""
CAPTURE: Final = {Profile.DEFAULT: 2.6, Profile.FAST: 1.8}
"""A capture, likewise [s]."""
HANDLING: Final = (Profile.DEFAULT, Profile.FAST)
"""Profiles of which it is looked at how pieces are handled; gentle does it as default, but slower."""
GRASPS: Final = {True: 10, False: 300}  # by ``quick``
TOUCH_FORCE: Final = 10.0
"""On feet of 100 N/mm, with the target's height wrong by up to … [N]"""
HEIGHT_ERROR: Final = 0.003  # … this [m]
CORNER: Final = square_place(63)
SLIDE: Final = 1.0
"""Median way that a piece up to 3 mm off along the fingers is pushed before both hold it [mm]."""


def motion_bench(quick: bool, progress: Progress) -> BenchReport:
    """Measure; ``quick``: 36 transfers instead of 710.

    Raises:
        UserError: CasADi is not installed.
    """
    casadi()  # before minutes are spent on the rest
    rows: dict[str, Row] = {}
    failures: list[str] = []
    for profile, transfers in (QUICK if quick else TRANSFERS).items():
        progress(f"profile {profile.value}: {transfers} transfers in the world")
        games = Games(transfers, PROFILES[profile], TableSettings(limits=contact_speeds(profile)), DISORDER, SEED)
        failures += games.failures
        rows |= _rows_of(profile, games)
        if profile is Profile.DEFAULT:
            progress("comparing with the optimum and with stopping")
            rows |= _against(games.done, COMPARED[quick])
    settings = PROFILES[Profile.DEFAULT]
    without = settings.model_copy(update={"gains": settings.gains.model_copy(update={"tactile_gain": 0.0})})
    for name, moved, limit in (
        ("slide", settings, SLIDE), ("slide_without", without, None), ("fast_slide", PROFILES[Profile.FAST], SLIDE),
    ):  # fmt: skip
        pushed = slides(GRASPS[quick], moved, SEED, progress)
        rows[name] = row([1e3 * way for way in pushed], "mm", limit)
    progress("setting pieces down where the board is up to 3 mm higher or lower than believed")
    for profile in HANDLING:
        forces = _touch_forces(PROFILES[profile], quick=quick)
        rows[_name(profile, "touch_force")] = row(forces, "N", TOUCH_FORCE, "max")
    rows["failed"] = row([float(len(failures))], "plies", 0.0, "max")
    for sentence in failures:
        progress(sentence)
    return BenchReport.of("motion", SEED, rows)


def _name(profile: Profile, quantity: str) -> str:
    """Of a row; those of the default profile have the quantity's alone."""
    return quantity if profile is Profile.DEFAULT else f"{profile.value}_{quantity}"


def _touch_forces(settings: MotionSettings, *, quick: bool) -> list[float]:
    """Of pieces with felt, with guard and gain schedule [N]."""
    errors = np.linspace(-HEIGHT_ERROR, HEIGHT_ERROR, 3 if quick else 7).tolist()
    cases = [(TARGET, Kind.KING)] if quick else [(p, k) for p in (TARGET, CORNER) for k in (Kind.PAWN, Kind.KING)]
    trials = (Touchdown(error, target=place, kind=kind) for place, kind in cases for error in errors)
    return [set_down(trial, settings).peak for trial in trials]


def _rows_of(profile: Profile, games: Games) -> dict[str, Row]:
    done, name, drive = games.done, profile.value, load_parameters().drive
    quiet, capture = games.durations(MoveKind.QUIET), games.durations(MoveKind.CAPTURE)
    rows = {f"{name}_quiet": row(quiet, "s", QUIET.get(profile), "mean")}
    if capture:
        rows[f"{name}_capture"] = row(capture, "s", CAPTURE.get(profile), "mean")
    for part in Part:
        took = [one.parts[part] for one in done if one.ply.kind is MoveKind.QUIET]
        rows[f"{name}_quiet_{part}"] = row([1e3 * time for time in took], "ms")
    torques = [one.torques for one in done]
    rows[f"{name}_torque"] = row([np.abs(t).max() for t in torques], "N m", drive.peak_torque, "max")
    if rms := _rms(games, drive.tick):
        rows[f"{name}_rms"] = row(rms, "N m", drive.rated_torque, "max")
    excess = [_excess(motion) for one in done for motion in one.plan.motions if motion.paths]
    rows[f"{name}_excess"] = row(excess, "1", 1e-6, "max")
    if profile is Profile.DEFAULT:
        rows["planning"] = row([1e3 * one.planning for one in done], "ms", 10.0, "p99")
        rows["default_quiet_p95"] = row([float(np.percentile(quiet, 95.0))], "s", 2.0, "max")
    return rows | _handling(profile, done) if profile in HANDLING else rows


def _handling(profile: Profile, done: Sequence[Done]) -> dict[str, Row]:
    """How pieces were taken and set down."""
    rows = {
        "placed": row(_placed(done, knights=False), "mm", 0.3, "mean"),
        "placed_worst": row([max(_placed(done, knights=False))], "mm", 1.0, "max"),
        "tool": row([1e3 * error for one in done for error in one.tool], "mm", 0.2, "mean"),
        "others_moved": row([1e3 * one.disturbed for one in done], "mm", 1.0, "max"),
        "contact_force": row([one.peak_contact for one in done], "N"),
    }
    if knights := _placed(done, knights=True):
        rows["placed_knights"] = row(knights, "mm")
    return {_name(profile, quantity): one for quantity, one in rows.items()}


def _placed(done: Sequence[Done], *, knights: bool) -> list[float]:
    """How far released pieces stand from their places' centres [mm]; knights are not round."""
    found = list[float]()
    for one in done:
        kinds = {transfer.name: transfer.kind for transfer in one.ply.transfers}
        found += [1e3 * error for name, error in one.released.items() if (kinds[name] is Kind.KNIGHT) is knights]
    return found


def _rms(games: Games, tick: float) -> list[float]:
    """Of each motor, in the worst window of plies that follow each other at once, in each world [N m]."""
    found, first = list[float](), 0
    for count in games.worlds:
        plies = games.done[first : first + count]
        first += count
        if plies:
            found += worst_rms(np.concatenate([one.torques for one in plies]), tick)
    return found


def _excess(motion: Motion) -> float:
    """By what share samples exceed the loosest line's bounds of speed, acceleration and jerk; 0 if none does."""
    assert motion.route is not None
    bounds, samples = motion.route.bounds, motion.samples
    tick_steps = np.abs(np.diff(samples["acceleration"], axis=0)).max()
    speed = np.linalg.norm(samples["velocity"], axis=1).max()
    ratios = (
        speed / max(b.speed for b in bounds),
        np.abs(samples["acceleration"]).max() / max(b.acceleration for b in bounds),
        tick_steps / (load_parameters().drive.tick * max(b.jerk for b in bounds)),
    )
    return max(0.0, *(float(ratio) - 1.0 for ratio in ratios))


# against other laws on the same way


def _against(done: Sequence[Done], count: int) -> dict[str, Row]:
    """Of moving parts: how much longer they take than the optimum, and what share of stopping at every waypoint."""
    tick, touch_speed = load_parameters().drive.tick, PROFILES[Profile.DEFAULT].touch_speed
    moving = [(motion, path) for one in done for motion in one.plan.motions for path in motion.paths]
    chosen = [moving[i] for i in np.linspace(0, len(moving) - 1, min(count, len(moving))).astype(int)]
    to_optimum, to_stopping, unsolved = list[float](), list[float](), 0
    for motion, path in chosen:
        end_speed = touch_speed if motion.touches else 0.0
        try:
            to_optimum.append(_seconds(motion, path, tick) / optimal_duration(path, _bounds(motion, path), end_speed))
        except NoOptimum:
            unsolved += 1
    for one in done:
        ours = sum(_seconds(m, p, tick) for m in one.plan.motions for p in m.paths)
        to_stopping.append(ours / sum(_stopping(m, tick) for m in one.plan.motions if m.paths))
    return {
        "to_optimum": row(to_optimum, "1", 1.10, "mean"),
        "to_optimum_worst": row([max(to_optimum)], "1", 1.25, "max"),
        "optimum_not_found": row([float(unsolved)], "motions"),
        "to_stopping": row(to_stopping, "1", 0.80, "mean"),
    }


def _bounds(motion: Motion, path: Path) -> list[Bounds]:
    """Of each piece of one of a motion's paths."""
    assert motion.route is not None
    first = sum(int(other.line.max()) + 1 for other in motion.paths[: motion.paths.index(path)])
    return bounds_of_pieces(path, motion.route.bounds[first:])


def _seconds(motion: Motion, path: Path, tick: float) -> float:
    """How long a path of a motion takes in its samples [s], from the last sample of the first stay at its start."""
    at_start, at_end = (
        np.abs(motion.samples["position"] - point).max(axis=1) < 1e-9 for point in (path.flat[0], path.end)
    )
    first = int(np.flatnonzero(at_start)[0])
    away = np.flatnonzero(~at_start[first:])
    begins = first + int(away[0]) - 1 if away.size else len(at_start) - 1
    ends = np.flatnonzero(motion.samples["guard"] == Guard.TOUCH)[0] - 1 if motion.touches else np.argmax(at_end)
    return (int(ends) - begins) * tick


def _stopping(motion: Motion, tick: float) -> float:
    """Ruckig from rest to rest from waypoint to waypoint, with the same bounds [s]."""
    assert motion.route is not None
    points, bounds, total, first = motion.route.points, motion.route.bounds, 0.0, 0
    corners = [i + 1 for i, turn in enumerate(turns(points)) if turn > STRAIGHT] if len(points) > 2 else []
    for last in (*corners, len(points) - 1):
        way = blend(points[first : last + 1], np.zeros(last - first - 1))
        total += math.ceil(time_law(way, bounds[first:last], Law.RUCKIG).duration / tick) * tick
        first = last
    return total
