"""Bench ``commission``: an arm that nobody knows is brought up behind real drivers, from nothing to its first game.

Drives are emulated, as pace real has it. For each bus, robots whose masses and friction a seed has drawn go through the
whole procedure, with somebody beside them who agrees to everything and measures the tool where it is. Then each fault
is planted in a robot and device drawn for it, and steps ``devices`` and ``axes`` are done until one fails: by which
step, with which sentence, and how far the tool was from where it had been.
"""

from __future__ import annotations

import random
import tempfile
from collections.abc import Sequence
from contextlib import chdir, closing
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from app.commissioning.bring_up.axes import try_axes
from app.commissioning.bring_up.commission import run_commission
from app.commissioning.bring_up.person import Commissioner, GivenAnswers
from app.commissioning.bring_up.steps import CommissionReport, CommissionStep, StepState
from app.commissioning.check_drives import check_bus
from app.commissioning.check_report import CheckState, Finding
from app.measure.bench.beds.unknown_robot import ENCODER_NOISE, RANGES
from app.measure.bench.report import BenchReport, Progress, Row, Tally, row
from app.rig.rig_file import RIG_FILE, DrivesSection, RigFile, WorldSection, save_rig
from app.rig.simulation.processes import drives_of
from app.rig.simulation.settings import EMULATED, own_rig
from app.settings.defaults import Drives
from controller.loop.realtime import set_up_real_time
from controller.model.compiled import FloatArray
from hardware.interfaces import HardwareError, Pace
from hardware.parameters import DEFAULT_FILE
from hardware.sim.clients.referee import SimReferee
from hardware.sim.process.planted import PlantedFault, PlantedKind
from hardware.sim.process.randomisation import Randomisation

SEED: Final = 2800
"""Of the first robot."""
ROBOTS: Final = {True: 0, False: 1}  # that go through the whole procedure on each bus, by ``quick``
TRIES: Final = {True: 1, False: 3}  # of each fault
MOST_AGAIN: Final = 2
"""Failed steps are done again so often: this computer may have been held up."""
TOOL_LIMIT: Final = 0.050
"""How far the tool may come from where it was, as docs/commissioning.md states for ``TOTAL_WAY`` of a shaft [m]."""
_KINDS: Final = PlantedKind
_THREE: Final = (1, 2, 3)


class ExpectedFinding(NamedTuple):
    """What a planted fault has to be stopped by."""

    step: CommissionStep
    words: str
    """In the first finding that is wrong; {device} stands for the device's number."""
    devices: Sequence[int] = _THREE
    amounts: Sequence[float | None] = (None,)


FAULTS: Final = {
    _KINDS.ENCODER_SIGN: ExpectedFinding(CommissionStep.AXES, "change the sign of joint {device}"),
    _KINDS.TORQUE_SIGN: ExpectedFinding(CommissionStep.AXES, "torque's sign in drive {device}"),
    _KINDS.ENCODERS_EXCHANGED: ExpectedFinding(CommissionStep.AXES, "are exchanged", (1,), (2.0, 3.0)),
    _KINDS.ZERO: ExpectedFinding(CommissionStep.AXES, "to the offset of joint {device}", amounts=(0.0873, -0.0873)),
    _KINDS.ENCODER_DEAD: ExpectedFinding(CommissionStep.AXES, "at drive {device}"),
    _KINDS.ENCODER_SCALE: ExpectedFinding(CommissionStep.AXES, "the ratio of joint {device}", amounts=(0.5, 2.0)),
    _KINDS.TORQUE_SCALE: ExpectedFinding(CommissionStep.AXES, "of joint {device}, and its", amounts=(0.5, 2.0)),
    _KINDS.BRAKE_STUCK: ExpectedFinding(CommissionStep.AXES, "the brake of axis {device} stays closed"),
    _KINDS.BRAKE_SLIPS: ExpectedFinding(CommissionStep.AXES, "a closed brake does not hold", amounts=(0.2, 0.25)),
    _KINDS.FORCE_DEAD: ExpectedFinding(CommissionStep.DEVICES, "it is dead", (1, 2)),
    _KINDS.FORCE_OFFSET: ExpectedFinding(CommissionStep.DEVICES, "set the sensor's zero", (1, 2)),
    _KINDS.TOO_HOT: ExpectedFinding(CommissionStep.DEVICES, "servomotor {device} is too hot"),
    _KINDS.UNDER_VOLTAGE: ExpectedFinding(CommissionStep.DEVICES, "servomotor {device} has too little voltage"),
    _KINDS.SILENT: ExpectedFinding(CommissionStep.DEVICES, "answer"),
    _KINDS.WATCHDOG_DEAD: ExpectedFinding(CommissionStep.DEVICES, "does not trip"),
}  # fmt: skip


class ScriptedCommissioner(Commissioner):
    """Somebody who agrees to everything, and measures the tool of a simulated arm to a millimetre."""

    def __init__(self, rig: RigFile) -> None:
        super().__init__(GivenAnswers(), None)
        self._rig = rig

    def sees_room(self, believed: float, needed: float) -> bool:
        """See ``Commissioner``."""
        return float(self.tool(np.zeros(3))[2]) >= needed

    def tool(self, believed: FloatArray) -> FloatArray:
        """Where it is, board frame (3,) [m]."""
        return np.round(self._rig.table.board_from_base(true_tool(self._rig)), 3)


def true_tool(rig: RigFile) -> FloatArray:
    """Where the tool is, by the referee, base frame (3,) [m]."""
    with closing(SimReferee(rig.run_dir)) as referee:
        return np.array(referee.look()[0].tool)


def unknown_rig(folder: Path, kind: Drives, seed: int, planted: tuple[PlantedFault, ...] = ()) -> RigFile:
    """A rig whose file believes the nominal robot, and whose world has another one; in pace fast without a bus."""
    noise = ENCODER_NOISE * 2.0 * np.pi / 2.0**22
    ranges = Randomisation(
        robot_mass=RANGES.robot_mass, arm_mass=0.1, arm_friction=RANGES.arm_friction,
        devices=RANGES.devices.model_copy(update={"encoder_noise": noise, "tactile_noise": 0.03}),
    )  # fmt: skip
    emulated = kind in EMULATED
    world = WorldSection(
        seed=seed, cameras=False, linger=2.0, planted=planted, randomisation=ranges, robot=DEFAULT_FILE,
        pace=Pace.REAL if emulated else Pace.FAST, realtime=emulated,
    )  # fmt: skip
    return own_rig(folder / "run", world, drives=EMULATED[kind] if emulated else DrivesSection())


def commission_bench(quick: bool, progress: Progress) -> BenchReport:
    """Measure; ``quick`` without the whole procedure, and each fault once on each bus."""
    rows: dict[str, Row] = {}
    for kind in EMULATED:
        tally: Tally = Tally(list)
        for seed in range(SEED, SEED + ROBOTS[quick]):
            progress(f"{kind}, robot {seed}: from nothing to its first game")
            report, again = whole(kind, seed, progress)
            tally["done_again"].append(float(again))
            tally["not_held"].append(float(sum(line.state is not StepState.HELD for line in report.steps)))
            if tally["not_held"][-1]:
                progress(f"{kind}, robot {seed}: {report.next}: {[one for one in report.findings if _wrong(one)]}")
        for fault, expected in FAULTS.items():
            for number in range(TRIES[quick]):
                told, moved = try_fault(kind, fault, expected, SEED + 100 + number, progress)
                tally["misjudged"].append(float(not told))
                tally["moved"].append(1e3 * moved)
        if tally["not_held"]:
            rows[f"{kind}_steps_not_held"] = row(tally["not_held"], "steps", 0.0, "max")
            rows[f"{kind}_steps_done_again"] = row(tally["done_again"], "steps")
        rows[f"{kind}_faults_misjudged"] = row([sum(tally["misjudged"])], "faults", 0.0, "max", len(tally["misjudged"]))
        rows[f"{kind}_tool_moved"] = row(tally["moved"], "mm", 1e3 * TOOL_LIMIT, "max")
    return BenchReport.of("commission", SEED, rows, "real")


def whole(kind: Drives, seed: int, progress: Progress) -> tuple[CommissionReport, int]:
    """One robot, from nothing to the end of its first game, or to a step that fails again and again; and how many were
    done again, as they say themselves that they may be.
    """
    with tempfile.TemporaryDirectory(prefix="touchmove-") as folder, chdir(folder):  # where its game goes
        rig = unknown_rig(Path(folder), kind, seed)
        file = Path(folder) / RIG_FILE
        save_rig(rig, file)
        report, again = run_commission(str(file), ScriptedCommissioner(rig), progress, game=True), 0
        while not report.holds and again < MOST_AGAIN:
            report, again = run_commission(str(file), ScriptedCommissioner(rig), progress, game=True), again + 1
        return report, again


def try_fault(
    kind: Drives, fault: PlantedKind, expected: ExpectedFinding, seed: int, progress: Progress
) -> tuple[bool, float]:
    """Plant a fault, and do the first two steps: whether it was told as expected, and how far the tool moved [m]."""
    rng = random.Random(f"{kind} {fault} {seed}")
    device = rng.choice(expected.devices)
    planted = PlantedFault(kind=fault, device=device, amount=rng.choice(expected.amounts))
    with tempfile.TemporaryDirectory(prefix="touchmove-") as folder:
        rig = unknown_rig(Path(folder), kind, seed, (planted,))
        step, found, moved = first_two_steps(rig, progress)
    words = expected.words.format(device=device)
    told = found is not None and step is expected.step and words in f"{found.found}: {found.advice}"
    if not told:
        progress(f"{kind}, {fault} in device {device}: in step {step} it was told {found}, not '{words}'")
    return told, moved


def first_two_steps(rig: RigFile, progress: Progress) -> tuple[CommissionStep | None, Finding | None, float]:
    """Steps ``devices`` and ``axes``: the one that fails and its first wrong finding, and the tool's way [m]."""
    try:
        with drives_of(rig, lambda _: None) as drives:
            bus = drives.open(rig.robot())
            try:
                before = true_tool(rig)
                with set_up_real_time(rig.controller, bus):
                    found = [one for one in check_bus(bus, rig.robot(), rig.table) if _wrong(one)]
                    step = CommissionStep.DEVICES
                    if not found:
                        step = CommissionStep.AXES
                        tried = try_axes(bus, rig.robot(), rig.table, ScriptedCommissioner(rig), progress)
                        found = [one for one in tried if _wrong(one)]
                moved = float(np.linalg.norm(true_tool(rig) - before))
            finally:
                bus.close()
    except HardwareError as error:  # they cannot be opened
        found = [Finding(device="drives", what="connection", state=CheckState.WRONG, found=str(error), advice="")]
        return CommissionStep.DEVICES, found[0], 0.0
    return (step, found[0], moved) if found else (None, None, moved)


def _wrong(one: Finding) -> bool:
    return one.state is CheckState.WRONG
