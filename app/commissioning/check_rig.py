"""All devices of a rig, one after the other."""

from __future__ import annotations

import stat
import tempfile
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Final

import chess
import cv2
import numpy as np

from app import UserError
from app.commissioning.check_drives import check_drives
from app.commissioning.check_report import CheckReport, Finding, Judge
from app.commissioning.operate import STATUS, operate
from app.rig.remote import open_board_camera
from app.rig.rig_file import RigFile, WorldSection, load_rig
from app.rig.simulation.processes import drives_of, require_world
from app.rig.simulation.settings import own_rig
from app.settings.defaults import SIMULATED
from controller.model.constants import DeltaModel
from controller.model.workspace import BoardDoesNotFit, require_fit
from engine.errors import EngineProblem
from engine.stockfish import Engine, EngineSettings
from hardware.interfaces import Camera, Frame, HardwareError, StaleFrame
from hardware.parameters import ParametersError, RobotParameters
from hardware.piece_set import PIECE_SHAPES

FRAMES: Final = 6
MOST_AGE: Final = 0.5
"""Of a frame when it is read [s]."""
PATIENCE: Final = 5.0  # for the first such one [s, wall]
DARK, BRIGHT = 40.0, 215.0  # mean brightness of a picture, of 255
BLOWN: Final = 0.10  # share of pixels that may be white or black through and through
SHARP: Final = 20.0  # variance of the picture's Laplacian; a lens out of focus stays far below
DEPTH_SHARE: Final = 0.5  # of pixels with depth
NEAR, FAR = 0.2, 2.0  # between which most of the picture lies [m]
NODES: Final = 2000  # what the engine is asked to look at


class WallClock:
    """``Clock`` of a check: nothing else passes here."""

    def now(self) -> float:
        """Time since some moment [s]."""
        return time.monotonic()

    def sleep(self, duration: float) -> None:
        """Wait so long [s]."""
        time.sleep(max(0.0, duration))


def check_rig(name: str, progress: Callable[[str], None]) -> CheckReport:
    """Try each device of a rig, ``sim``, which is started for it, or a rig file.

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
        parameters = rig.robot()
    except ParametersError as error:
        robot.wrong("parameters", str(error), "correct that field")
        return robot.findings, None
    robot.good("parameters", rig.parameters.name)
    heaviest = max(shape.mass for shape in PIECE_SHAPES.values())
    try:
        found = require_fit(DeltaModel(parameters, heaviest), rig.table)
    except BoardDoesNotFit as error:
        robot.wrong("reach", str(error), "run 'touchmove figures workspace'")
    else:
        robot.good("reach", f"all {len(found.places)} places, condition of J_c at most {found.condition.max():.1f}")
    return robot.findings, parameters


def _check_key(rig: RigFile) -> list[Finding]:
    judge, key = Judge("key"), rig.controller.key
    if not key.exists():
        judge.left_out(key.name, "not there yet: the controller creates it when it first starts")
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
            judge.left_out("all", f"{held}; end it to test them separately")
            return judge.findings
    try:
        with drives_of(rig, progress) as drives:
            seen: list[Finding] = []
            if rig.simulated and rig.sees:  # first: the world ends when its drives are given up
                require_world(rig, progress)
                seen = _check_camera(rig)
            return judge.findings + check_drives(drives.open, parameters, rig.table, rig.controller) + seen
    except (UserError, HardwareError) as error:
        judge.wrong("connection", str(error), "fix what it says, then check again")
        return judge.findings


def _check_camera(rig: RigFile) -> list[Finding]:
    judge = Judge("camera")
    try:
        camera = open_board_camera(rig, WallClock())
    except HardwareError as error:
        judge.wrong("connection", str(error), "fix what it says, then check again")
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


# a camera, alone: whether pictures come, in time, and whether something can be seen in them


def check_camera(camera: Camera) -> list[Finding]:
    """Read some frames of a camera that is open."""
    judge = Judge("camera")
    try:
        frames = [_first(camera)]
        since = time.perf_counter()
        for _ in range(FRAMES):
            frames.append(camera.read(MOST_AGE))
    except HardwareError as error:
        judge.wrong("pictures", str(error), "check its cable, then try again")
        return judge.findings
    rate = FRAMES / (time.perf_counter() - since)
    last = frames[-1]
    height, width = last.colour.shape[:2]
    stamps = np.array([frame.stamp for frame in frames])
    judge.judge(
        "pictures", f"{width}×{height}, {rate:.0f} reads a second", bool((np.diff(stamps) >= 0.0).all()),
        "its clock runs backwards: give it a newer firmware",
    )  # fmt: skip
    _judge_light(judge, last)
    _judge_depth(judge, last)
    return judge.findings


def _first(camera: Camera) -> Frame:
    """The first frame that is young enough; a camera that has just been opened may need a while."""
    give_up = time.monotonic() + PATIENCE
    while True:
        try:
            return camera.read(MOST_AGE)
        except StaleFrame:
            if time.monotonic() > give_up:
                raise


def _judge_light(judge: Judge, frame: Frame) -> None:
    grey = cv2.cvtColor(frame.colour, cv2.COLOR_RGB2GRAY)
    mean = float(grey.mean())
    lost = float(((grey <= 1) | (grey >= 254)).mean())
    advice = "more light, or a longer exposure" if mean < DARK else "less light, or a shorter exposure"
    judge.judge("brightness", f"{mean:.0f} of 255", DARK <= mean <= BRIGHT, advice)
    judge.judge(
        "contrast", f"{100.0 * lost:.1f} % of the pixels are completely black or white", lost <= BLOWN,
        "turn the lamp so that nothing glares, and set the exposure for the board",
    )  # fmt: skip
    sharpness = float(cv2.Laplacian(grey, cv2.CV_64F).var())
    judge.judge("sharpness", f"{sharpness:.0f}", sharpness >= SHARP, "clean the lens and set its focus on the board")


def _judge_depth(judge: Judge, frame: Frame) -> None:
    if frame.depth is None:
        judge.left_out("depth", "this camera has none: the game sees only colour")
        return
    measured = frame.depth[frame.depth > 0.0]
    share = measured.size / frame.depth.size
    middle = float(np.median(measured)) if measured.size else 0.0
    judge.judge(
        "depth", f"{100.0 * share:.0f} % of the pixels, {middle:.2f} m in the middle",
        share >= DEPTH_SHARE and NEAR <= middle <= FAR,
        "switch its emitter on, clean its three windows, and put it 0.3 to 1 m from the board",
    )  # fmt: skip
