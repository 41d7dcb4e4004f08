"""All devices of a rig, one after the other."""

from __future__ import annotations

import stat
import tempfile
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import chess

from app import UserError
from app.commissioning.check_cameras import check_camera
from app.commissioning.check_drives import check_drives
from app.commissioning.check_report import CheckReport, Finding, Judge
from app.commissioning.operate import STATUS, operate
from app.rig.remote import open_board_camera
from app.rig.rig_file import RigFile, WorldSection, load_rig
from app.rig.simulation.processes import drives_of, require_world
from app.rig.simulation.settings import own_rig
from app.settings.tree import SIMULATED
from controller.model.constants import DeltaModel
from controller.model.workspace import BoardDoesNotFit, require_fit
from engine.errors import EngineProblem
from engine.stockfish import Engine, EngineSettings
from hardware.interfaces import HardwareError
from hardware.parameters import ParametersError, RobotParameters, load_parameters
from hardware.table import PIECE_SHAPES

NODES = 2000
"""What the engine is asked to look at."""


class WallClock:
    """``Clock`` of a check: nothing else passes here."""

    def now(self) -> float:
        """Time since some moment [s]."""
        return time.monotonic()

    def sleep(self, duration: float) -> None:
        """Wait so long [s]."""
        time.sleep(max(0.0, duration))


def check_rig(name: str, progress: Callable[[str], None]) -> CheckReport:
    """Try each device of a rig.

    Args:
        name: ``sim``, which is started for it, or a rig file.
        progress: told what is being tried.

    Raises:
        UserError: there is no such rig, or something in its file is wrong.
    """
    if name != SIMULATED:
        return CheckReport.of(name, _check(name, load_rig(Path(name)), progress))
    with tempfile.TemporaryDirectory(prefix="touchmove-") as folder:
        return CheckReport.of(name, _check(name, own_rig(Path(folder) / "run", WorldSection()), progress))


def _check(name: str, rig: RigFile, progress: Callable[[str], None]) -> list[Finding]:
    progress("the robot's parameters")
    found, parameters = _check_robot(rig)
    if name != SIMULATED:
        progress("the key")
        found += _check_key(rig)
    if parameters is not None:
        progress("drives and gripper: the arm stays on its brakes")
        found += _check_drives(name, rig, parameters, progress)
    if not rig.simulated:
        progress("the camera")
        found += _check_camera(rig)
    progress("the engine")
    return found + _check_engine()


def _check_robot(rig: RigFile) -> tuple[list[Finding], RobotParameters | None]:
    robot = Judge("robot")
    try:
        parameters = load_parameters(rig.parameters)
    except ParametersError as error:
        robot.wrong("parameters", str(error), "correct that field")
        return robot.findings, None
    robot.good("parameters", rig.parameters.name)
    heaviest = max(shape.mass for shape in PIECE_SHAPES.values())
    try:
        found = require_fit(DeltaModel(parameters, heaviest), rig.table)
    except BoardDoesNotFit as error:
        robot.wrong("reach", str(error), "see 'touchmove figures workspace'")
    else:
        robot.good("reach", f"all {len(found.places)} places, condition of J_c at most {found.condition.max():.1f}")
    return robot.findings, parameters


def _check_key(rig: RigFile) -> list[Finding]:
    judge, key = Judge("key"), rig.controller.key
    if not key.exists():
        judge.left_out(key.name, "not there yet: the controller makes it at its first start")
        return judge.findings
    shared = bool(key.stat().st_mode & (stat.S_IRWXG | stat.S_IRWXO))
    judge.judge(key.name, "others can read it" if shared else "its owner's alone", not shared, f"chmod 600 {key}")
    return judge.findings


def _check_drives(
    name: str, rig: RigFile, parameters: RobotParameters, progress: Callable[[str], None]
) -> list[Finding]:
    judge = Judge("drives")
    if name != SIMULATED and rig.controller.key.exists():
        try:
            telemetry = operate(STATUS, name)
        except UserError as error:
            judge.left_out("controller", f"none holds them: {error}")
        else:
            host, port, _key = rig.address()
            held = f"a controller at {host}:{port} holds them: {telemetry.state.name}"
            judge.left_out("all", f"{held}; end it to try them alone")
            return judge.findings
    try:
        with drives_of(rig, progress) as open_bus:
            seen: list[Finding] = []
            if rig.simulated and rig.sees:  # first: the world ends when its drives are given up
                require_world(rig, progress)
                seen = _check_camera(rig)
            return judge.findings + check_drives(open_bus, parameters, rig.table) + seen
    except (UserError, HardwareError) as error:
        judge.wrong("connection", str(error), "put right what it says, then check again")
        return judge.findings


def _check_camera(rig: RigFile) -> list[Finding]:
    judge = Judge("camera")
    try:
        camera = open_board_camera(rig, WallClock())
    except HardwareError as error:
        judge.wrong("connection", str(error), "put right what it says, then check again")
        return judge.findings
    if camera is None:
        judge.left_out("all", "the rig file has no [camera]")
        return judge.findings
    with closing(camera):
        return check_camera(camera)


def _check_engine() -> list[Finding]:
    judge = Judge("engine")
    try:
        with Engine(EngineSettings(nodes=NODES, move_time=None)) as engine:
            decision = engine.choose(chess.Board())
    except EngineProblem as error:
        judge.wrong("Stockfish", str(error), "install it with 'sudo apt-get install stockfish'")
    else:
        judge.good("Stockfish", f"answers {chess.Board().san(decision.move)}")
    return judge.findings
