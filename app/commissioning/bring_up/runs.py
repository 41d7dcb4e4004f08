"""What each step does, given the arm and who stands beside it."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from app import UserError
from app.commissioning.bring_up.axes import try_axes
from app.commissioning.bring_up.controlled import arm_of, controller_of
from app.commissioning.bring_up.motion_judgement import judge_gravity, judge_tracking, judge_workspace
from app.commissioning.bring_up.motions import MovingArm, edge_points, follow, grid_points, touch, visit
from app.commissioning.bring_up.person import Commissioner
from app.commissioning.bring_up.rig_file_edit import name_parameters
from app.commissioning.bring_up.steps import CommissionStep
from app.commissioning.calibrate import run_calibrate
from app.commissioning.check_drives import check_bus
from app.commissioning.check_report import Finding, Judge
from app.commissioning.identify import FILE as IDENTIFIED_FILE
from app.commissioning.identify import run_identify
from app.commissioning.operate import STATUS, operate
from app.rig.rig_file import RigFile
from app.rig.simulation.processes import drives_of
from controller.loop.realtime import set_up_real_time
from controller.settings import CONTROLLER_FILE
from hardware.interfaces import HardwareError, ServoBus
from hardware.parameters import RobotParameters

GAME_PLIES: Final = 4
"""Of the first game."""

Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class CommissionSite:
    """The arm that is brought up, and who stands beside it."""

    name: str
    """Of the rig file."""
    rig: RigFile
    parameters: RobotParameters
    person: Commissioner
    progress: Progress


WHAT: Final = {
    CommissionStep.DEVICES: "drives, gripper and fingers; the brakes stay closed",
    CommissionStep.AXES: "each axis alone; the brakes open for milliseconds, and the tool drops by some millimetres: "
    "hands off, and nothing below the tool",
    CommissionStep.WORKSPACE: "home and the edges of the workspace at 0.1 m/s, above all pieces: keep hands away, and "
    "one hand at the emergency stop",
    CommissionStep.GRAVITY: "the arm holds still in poses across the workspace, moving at 0.1 m/s between them",
    CommissionStep.IDENTIFY: "the arm swings over the board for 24 s, quickly: keep hands away",
    CommissionStep.TRACKING: "across the board as in a game, then the pads touch the middle of the board: leave d4, "
    "d5, e4 and e5 empty",
    CommissionStep.CALIBRATE: "the arm shows its marker to the camera all over the board",
    CommissionStep.GAME: f"{GAME_PLIES} plies of a game in profile gentle; set the pieces up",
}
"""What is done, told before."""


# steps on the bare drives


def _on_drives(site: CommissionSite, try_it: Callable[[ServoBus], list[Finding]]) -> list[Finding]:
    """Open the drives for a step, and leave them on their brakes."""
    try:
        with drives_of(site.rig, site.progress) as drives:
            bus = drives.open(site.parameters)
            try:
                with set_up_real_time(site.rig.controller, bus):
                    return try_it(bus)
            finally:
                bus.close()
    except HardwareError as error:
        judge = Judge("drives")
        judge.wrong("connection", str(error), "fix what it says, then start this step again")
        return judge.findings


def require_free(site: CommissionSite) -> None:
    """Raises ``UserError`` if a controller has the drives: on this PC, where all of this is done."""
    if not (site.rig.run_dir / CONTROLLER_FILE).exists():
        return
    try:
        operate(STATUS, site.name)
    except UserError:
        return  # none answers
    raise UserError(
        f"a controller holds the drives of {site.name}: end it with 'touchmove controller shutdown --rig {site.name}'"
    )


def _devices(site: CommissionSite) -> list[Finding]:
    return _on_drives(site, lambda bus: check_bus(bus, site.parameters, site.rig.table))


def _axes(site: CommissionSite) -> list[Finding]:
    return _on_drives(site, lambda bus: try_axes(bus, site.parameters, site.rig.table, site.person, site.progress))


# steps behind the controller


def _moving(site: CommissionSite, move: Callable[[MovingArm], list[Finding]]) -> list[Finding]:
    """Do a step behind the rig's own controller; what stopped it is its finding."""
    try:
        with arm_of(site.name, site.rig, site.progress) as (devices, client):
            return move(MovingArm(devices, client, site.parameters, site.rig.table))
    except UserError as error:
        return _stopped(error)


def _stopped(error: UserError) -> list[Finding]:
    judge = Judge("arm")
    judge.wrong("motion", str(error), "fix what it says, then repeat this step")
    return judge.findings


def _workspace(site: CommissionSite) -> list[Finding]:
    points = edge_points(site.parameters, site.rig.table)
    return _moving(site, lambda stage: judge_workspace(list(visit(stage, points)), site.parameters))


def _gravity(site: CommissionSite) -> list[Finding]:
    points = grid_points(site.parameters, site.rig.table)
    identified = site.rig.parameters == _identified_file(site)
    return _moving(
        site, lambda stage: judge_gravity(list(visit(stage, points)), site.parameters, identified=identified)
    )


def _identified_file(site: CommissionSite) -> Path:
    return Path(site.name).absolute().parent / IDENTIFIED_FILE


def _identify(site: CommissionSite) -> list[Finding]:
    """Find what the robot weighs, and name the file in the rig file if the person agrees."""
    try:
        with controller_of(site.name, site.rig, site.progress):
            report = run_identify(site.name, None, site.person.answers.pole_pairs, site.progress)
    except UserError as error:
        return _stopped(error)
    judge = Judge("robot")
    told = sum(one.told for one in report.values)
    judge.judge(
        "parameters", f"{told} of {len(report.values)} values determined, written to {report.file}", report.holds,
        "the motion did not determine all base parameters: check that nothing hinders the arm, then repeat this step",
    )  # fmt: skip
    if report.holds and site.person.agrees(f"name {IDENTIFIED_FILE} as 'parameters' in {site.name}?"):
        name_parameters(Path(site.name), IDENTIFIED_FILE)
        judge.good("rig file", f"{site.name} names {IDENTIFIED_FILE}")
    return judge.findings


def _tracking(site: CommissionSite) -> list[Finding]:
    def move(stage: MovingArm) -> list[Finding]:
        followed = follow(stage, site.rig.run_dir)
        height, force = touch(stage, site.rig.run_dir)
        return judge_tracking(followed, height, force)

    return _moving(site, move)


def _calibrate(site: CommissionSite) -> list[Finding]:
    judge = Judge("camera")
    if not site.rig.sees:
        judge.left_out("calibration", "the rig has no camera: games are played blind")
        return judge.findings
    if site.parameters.marker is None:
        judge.wrong("marker", "the tool has none", "print one, and add it as [marker] to the parameters file")
        return judge.findings
    try:
        with controller_of(site.name, site.rig, site.progress):
            report = run_calibrate(site.name, None, site.progress)
    except UserError as error:
        return _stopped(error)
    found = report.calibration
    if found is None:
        judge.wrong("calibration", report.failure or "it failed", "fix what it says, then repeat this step")
    else:
        judge.good("calibration", f"worst expected error {1e3 * found.worst_error:.2f} mm, written to {report.file}")
    return judge.findings


def _game(site: CommissionSite) -> list[Finding]:
    """A process of its own, as a person would start it; what it says goes where this program's words go."""
    arguments = ["demo", "--rig", site.name, "--profile", "gentle", "--plies", str(GAME_PLIES), "--headless"]
    try:
        with controller_of(site.name, site.rig, site.progress):
            done = subprocess.run(
                [sys.executable, "-P", "-m", "app.cli", *arguments],
                stdin=subprocess.DEVNULL, stdout=sys.stderr, stderr=sys.stderr, check=False,
            )  # fmt: skip
    except UserError as error:
        return _stopped(error)
    judge = Judge("game")
    judge.judge(
        "first game", f"'touchmove {' '.join(arguments)}' ended with status {done.returncode}", done.returncode == 0,
        "read its messages above, and run 'touchmove report'",
    )  # fmt: skip
    return judge.findings


RUNS: Final[dict[CommissionStep, Callable[[CommissionSite], list[Finding]]]] = {
    CommissionStep.DEVICES: _devices,
    CommissionStep.AXES: _axes,
    CommissionStep.WORKSPACE: _workspace,
    CommissionStep.GRAVITY: _gravity,
    CommissionStep.IDENTIFY: _identify,
    CommissionStep.TRACKING: _tracking,
    CommissionStep.CALIBRATE: _calibrate,
    CommissionStep.GAME: _game,
}
"""Each leaves the arm at rest on its brakes; raises ``UserError`` where it cannot begin."""
