"""Bench ``identify``: whether one motion tells what an unknown robot weighs, and what that is worth in a game.

Robots are drawn with masses and inertias up to 20 % off, friction up to 50 %, ripple, cogging and noise
(`beds.unknown_robot`). Each is identified from the nominal parameters. Then the same plies are carried out on it by
the law with the parameters identified, with the true ones and with the nominal ones; plans, pieces and noise are equal.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

import chess
import numpy as np

from app.commissioning.identification.estimation import FRICTION_NAMES, Identification, identify
from app.commissioning.identification.excitation import Excitation, find_excitation
from app.commissioning.identification.survey import DURATION, borders_of
from app.commissioning.identify import POLE_PAIRS
from app.measure.bench.beds.plies import Disorder, stand_off
from app.measure.bench.beds.unknown_robot import bed_of, recorded, unknown_plant, unknown_robot
from app.measure.bench.report import BenchReport, Progress, Tally, row
from app.motion import MotionSettings
from app.pieces.inventory import Inventory, Ply
from app.pieces.layout import start_layout
from app.pieces.manipulation import transfers
from controller.loop.supervisor import Supervisor
from controller.model.base_parameters import NAMES, base_of
from controller.model.compiled import FloatArray
from controller.protection.reference_check import STIFFNESS
from hardware.parameters import RobotParameters, load_parameters
from hardware.table import TableSettings

SEED: Final = 2400
"""Of the first robot; the others follow. Estimation and excitation were made with others."""
ROBOTS: Final = {True: 2, False: 20}  # by ``quick``
LINE: Final = "e4 d5 exd5 Qxd5 Nc3 Qa5"
"""The plies: near, far, and to both trays."""
OFFSET: Final = 0.001
"""Pieces stand up to so far off along each axis [m]."""
BASE_LIMIT: Final = 3.0  # of the worst base parameter, against the true one [%]
PARTS: Final = ("game", "air")
RATIO_LIMIT: Final = 1.2  # of the tracking error, against that with the true parameters


class Tracking(NamedTuple):
    """How far the tool was from its reference at each tick, by ply; up to the ply that was stopped, if one was."""

    game: list[FloatArray]
    """(n,) each [m]"""
    air: list[FloatArray]
    """Of those ticks alone in which the law is as stiff as in the air along all axes, and so touches nothing."""
    stopped: str | None
    """A sentence on the motion that did not end as it had to."""


def identify_bench(quick: bool, progress: Progress) -> BenchReport:
    """Measure; ``quick`` with fewer robots."""
    believed, table, tally = load_parameters(), TableSettings(), Tally(list)
    excitation = find_excitation(believed, borders_of(believed, table), DURATION)
    for number in range(ROBOTS[quick]):
        measure_robot(SEED + number, believed, table, excitation, tally, progress)
    rows = {
        "base": row(tally["base"], "%", BASE_LIMIT, "max"),
        "base_nominal": row(tally["base_nominal"], "%"),
        "untold": row(tally["untold"], "1"),
        "outside_band": row([100.0 * np.mean(tally["outside_band"])], "%"),
        "viscous": row(tally["viscous"], "N m s/rad"),
        "coulomb": row(tally["coulomb"], "N m"),
        "game_ratio": row(tally["game_identified/true"], "1", RATIO_LIMIT, "max"),
        "air_ratio": row(tally["air_identified/true"], "1", RATIO_LIMIT, "max"),
        "stopped": row([sum(tally["stopped_identified"] + tally["stopped_true"])], "games", 0.0, "max"),
        "nominal_stopped": row([sum(tally["stopped_nominal"])], "games"),
    }
    for name in (f"{part}_{what}" for part in PARTS for what in ("nominal/true", "identified", "true", "nominal")):
        if values := tally[name]:  # none where no robot played a ply with the nominal ones
            rows[name.replace("/true", "_ratio")] = row(values, "1" if "/" in name else "mm")
    return BenchReport.of("identify", SEED, rows)


def measure_robot(
    seed: int, believed: RobotParameters, table: TableSettings, excitation: Excitation, tally: Tally, progress: Progress
) -> None:
    """Draw a robot, identify it, let it play, and add up what came of it."""
    true = unknown_robot(believed, seed)
    record = recorded(bed_of(unknown_plant(true, table, excitation.middle, seed), believed, table), excitation)
    found = identify(record, believed, POLE_PAIRS)
    _compare(found, believed, true, tally)
    progress(
        f"robot {seed}: worst base parameter {tally['base'][-1]:.2f} % off, nominal {tally['base_nominal'][-1]:.0f} %"
    )
    played = {
        by: track(true, parameters, table, seed)
        for by, parameters in (("identified", found.parameters), ("true", true), ("nominal", believed))
    }
    for by, one in played.items():
        tally[f"stopped_{by}"].append(float(one.stopped is not None))
        if one.stopped is not None:
            progress(f"robot {seed}, {by} parameters: {one.stopped}")
    for part in PARTS:
        best = getattr(played["true"], part)
        for by, one in played.items():
            errors = getattr(one, part)
            common = min(len(errors), len(best))
            if common:  # else not one ply was played
                tally[f"{part}_{by}"].append(1e3 * _rms(errors))
                tally[f"{part}_{by}/true"].append(_rms(errors[:common]) / _rms(best[:common]))


def _compare(found: Identification, believed: RobotParameters, true: RobotParameters, tally: Tally) -> None:
    """What was found of the base parameters and of friction with what is so."""
    arms = [true.arm(number) for number in range(3)]
    base = base_of(true)
    truth = dict(zip(NAMES, base.tolist(), strict=True))
    truth |= dict(zip(FRICTION_NAMES, [a.viscous for a in arms] + [a.coulomb for a in arms], strict=True))
    told = [one for one in found.estimates if one.told]
    off = [abs(one.value / truth[one.name] - 1.0) for one in told if one.name in NAMES]
    tally["base"].append(100.0 * max(off, default=1.0))  # nothing told is nothing found
    tally["base_nominal"].append(100.0 * float(np.abs(base_of(believed) / base - 1.0).max()))
    tally["untold"].append(float(len(found.estimates) - len(told)))
    tally["outside_band"] += [float(abs(one.value - truth[one.name]) > one.band) for one in told]
    for kind in ("viscous", "coulomb"):
        errors = [abs(found.value(f"{kind}{k}") - truth[f"{kind}{k}"]) for k in (1, 2, 3)]
        tally[kind].append(max(errors))


def track(true: RobotParameters, believed: RobotParameters, table: TableSettings, seed: int) -> Tracking:
    """Play the line on the true robot by a law that believes something of it, until a motion is stopped."""
    inventory = Inventory.of(start_layout(chess.Board(), table), table)
    disorder = Disorder(offset=(OFFSET, OFFSET))
    standing = stand_off(tuple(inventory), table, disorder, np.random.default_rng([seed, 7]))
    home: FloatArray = np.array(MotionSettings().at(table).home)
    bed = bed_of(unknown_plant(true, table, home, seed, standing), believed, table)
    gaps = list[tuple[float, float]]()

    def note(supervisor: Supervisor) -> None:
        reference = supervisor.reference.position
        gap = float(np.linalg.norm(supervisor.law.state.position - reference))
        gaps.append((gap, float(supervisor.reference.row[STIFFNESS].min())))

    bed.listeners.append(note)
    game, air = list[FloatArray](), list[FloatArray]()
    in_air = bed.settings.gains.frequency_in_air**2
    for ply in _plies(inventory):
        gaps.clear()
        try:
            bed.execute_plan(bed.planner().ply(ply.san, ply.transfers, inventory))
        except RuntimeError as error:
            return Tracking(game, air, str(error))
        inventory = inventory.after(ply)
        gap, stiffness = np.array(gaps).T
        game.append(gap)
        air.append(gap[stiffness > 0.999 * in_air])
    return Tracking(game, air, None)


def _plies(inventory: Inventory) -> Iterator[Ply]:
    """The line, each ply as the pieces stand then."""
    board = chess.Board()
    for san in LINE.split():
        move = board.parse_san(san)
        ply = transfers(board, move, inventory)
        yield ply
        inventory = inventory.after(ply)
        board.push(move)


def _rms(parts: Sequence[FloatArray]) -> float:
    """Root mean square of all of them together."""
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))
