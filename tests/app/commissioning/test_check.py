"""``touchmove check``: what is wrong with a device is named, with what to do; what is right is said to be."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from app.cli.commands import app
from app.commissioning.check_drives import check_bus
from app.commissioning.check_report import CheckReport, CheckState, Finding
from app.commissioning.check_rig import check_camera
from hardware.interfaces import BusLost, Command, DriveStatus, Frame, HardwareError, Intrinsics, Measurement
from hardware.parameters import load_parameters
from hardware.sim.bodies.scene import build_model
from hardware.sim.plant.plant import Plant
from hardware.table import TableSettings

PARAMETERS, TABLE = load_parameters(), TableSettings()
WATCHDOG = PARAMETERS.drive.watchdog_ticks * PARAMETERS.drive.tick
Change = Callable[[Measurement], Measurement]


class Wall:
    """The wall clock of a machine that does nothing else: time passes by exchanging and by sleeping alone."""

    def __init__(self) -> None:
        self.now = 0.0

    def perf_counter(self) -> float:
        return self.now

    def sleep(self, duration: float) -> None:
        self.now += duration


WALL = Wall()


class Bus:
    """The simulated plant as a bus in real time; what it says can be falsified."""

    lockstep = False
    period = PARAMETERS.drive.tick

    def __init__(self, change: Change = lambda said: said, pace: float = 1.0, watchdog: bool = True) -> None:
        home = np.array([0.0, 0.075, 0.325])
        self._plant = Plant(build_model(PARAMETERS, TABLE, (), home, looks=False), PARAMETERS, ())
        self._change, self._pace, self._watchdog = change, pace, watchdog
        self._heard = WALL.now
        self.commands: list[Command] = []

    def exchange(self, command: Command) -> Measurement:
        if self._watchdog and WALL.now - self._heard > WATCHDOG:
            self._plant.trip_watchdog()
        self.commands.append(command)
        self._plant.apply(command)
        self._plant.step()
        WALL.sleep(self._pace * self.period)
        self._heard = WALL.now
        return self._change(self._plant.measure(standing=False))

    def close(self) -> None:
        pass


def by_name(findings: list[Finding]) -> dict[str, Finding]:
    return {finding.what: finding for finding in findings}


@pytest.fixture(autouse=True)
def _short(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    monkeypatch.setattr("app.commissioning.check_drives.DURATION", 0.15)
    if "slow" not in request.keywords:  # the simulated rig has a process and a time of its own
        monkeypatch.setattr("app.commissioning.check_drives.time", WALL)


def test_good_drives_are_good_and_nothing_moves() -> None:
    bus = Bus()
    found = by_name(check_bus(bus, PARAMETERS, TABLE))
    assert {one.state for one in found.values()} == {CheckState.GOOD}, found
    assert "145 mm above the board, at (0, -75) mm" in found["pose"].found
    assert all(command.brake and command.torque == (0.0, 0.0, 0.0) for command in bus.commands)
    assert not bus.commands[-1].enable


def turned(by: float) -> Change:
    return lambda said: said._replace(angle=(said.angle[0] + by, said.angle[1], said.angle[2]))


def lowered(said: Measurement) -> Measurement:
    a, b, c = (angle + 0.95 for angle in said.angle)
    return said._replace(angle=(a, b, c))


def shaking(said: Measurement) -> Measurement:
    noise = 1e-5 * (said.tick % 3 - 1)
    a, b, c = (angle + noise for angle in said.angle)
    return said._replace(angle=(a, b, c))


WRONG: list[tuple[str, Change, str]] = [
    ("pose", lowered, "zero"),
    ("pose", lowered, "centre_in_base"),
    ("encoders", shaking, "shield"),
    ("encoders", turned(float("nan")), "cables"),
    ("brakes", lambda said: said._replace(velocity=(0.0, 0.1, 0.0)), "the brakes do not hold"),
    ("status", lambda said: said._replace(status=DriveStatus.BRAKED | DriveStatus.FAULT), "displays"),
    ("status", lambda said: said._replace(status=DriveStatus.OK), "brakes"),
    ("fingers", lambda said: said._replace(finger_position=0.05), "zero"),
    ("right pad", lambda said: said._replace(tactile=(2.0, 0.0)), "zero"),
    ("left pad", lambda said: said._replace(tactile=(0.0, 1.0 * (said.tick % 2) - 0.5)), "noisy"),
]


@pytest.mark.parametrize(("what", "change", "advice"), WRONG)
def test_each_fault_is_named_with_what_to_do(what: str, change: Change, advice: str) -> None:
    finding = by_name(check_bus(Bus(change), PARAMETERS, TABLE))[what]
    assert finding.state is CheckState.WRONG
    assert advice in finding.advice


def test_fingers_that_hold_something_are_not_called_wrong() -> None:
    found = by_name(check_bus(Bus(lambda said: said._replace(tactile=(4.0, 4.1))), PARAMETERS, TABLE))
    assert found["right pad"].state is found["left pad"].state is CheckState.LEFT_OUT


def test_a_wrong_period_and_a_deaf_watchdog_are_found() -> None:
    found = by_name(check_bus(Bus(pace=3.0, watchdog=False), PARAMETERS, TABLE))
    assert found["tick"].state is CheckState.WRONG
    assert "0.880 ms stated" in found["tick"].found
    assert found["watchdog"].state is CheckState.WRONG
    assert "44 ms" in found["watchdog"].advice


def test_drives_that_go_silent_are_lost() -> None:
    def lose(said: Measurement) -> Measurement:
        if said.tick > 200:
            raise BusLost("nobody answers")
        return said

    found = check_bus(Bus(lose), PARAMETERS, TABLE)
    assert found[-1].state is CheckState.WRONG
    assert found[-1].found == "nobody answers"


# ------------------------------------------------------------------------------------------------------------- cameras


class StillCamera:
    """Always the same picture."""

    def __init__(self, colour: Any, depth: Any) -> None:
        self._frame = (colour, depth)
        self._stamp = 0.0

    def read(self, max_age: float) -> Frame:
        self._stamp += 0.03
        return Frame(*self._frame, Intrinsics(64, 48, 60.0, 60.0, 31.5, 23.5), self._stamp)

    def close(self) -> None:
        pass


class DeadCamera(StillCamera):
    def read(self, max_age: float) -> Frame:
        raise HardwareError("camera 1234 was unplugged")


def board(low: int = 60, high: int = 200) -> Any:
    picture = np.where((np.indices((48, 64)).sum(axis=0) // 8) % 2, high, low).astype(np.uint8)
    return np.repeat(picture[..., None], 3, axis=2)


DEPTH = np.full((48, 64), 0.6, np.float32)


def test_a_good_camera_is_good() -> None:
    found = by_name(check_camera(StillCamera(board(), DEPTH)))
    assert set(found) == {"pictures", "brightness", "contrast", "sharpness", "depth"}
    assert {one.state for one in found.values()} == {CheckState.GOOD}


@pytest.mark.parametrize(
    ("colour", "depth", "what", "advice"),
    [
        (board(5, 30), DEPTH, "brightness", "more light"),
        (board(225, 250), DEPTH, "brightness", "less light"),
        (board(0, 255), DEPTH, "contrast", "lamp"),
        (np.full((48, 64, 3), 120, np.uint8), DEPTH, "sharpness", "focus"),
        (board(), np.zeros_like(DEPTH), "depth", "emitter"),
        (board(), 5.0 * DEPTH, "depth", "0.3 to 1 m"),
    ],
)
def test_a_picture_in_which_little_can_be_seen_is_named(colour: Any, depth: Any, what: str, advice: str) -> None:
    finding = by_name(check_camera(StillCamera(colour, depth)))[what]
    assert finding.state is CheckState.WRONG
    assert advice in finding.advice


def test_a_camera_without_depth_is_no_fault_and_a_dead_one_is() -> None:
    assert by_name(check_camera(StillCamera(board(), None)))["depth"].state is CheckState.LEFT_OUT
    dead = check_camera(DeadCamera(board(), DEPTH))
    assert [(one.what, one.state, one.found) for one in dead] == [
        ("pictures", CheckState.WRONG, "camera 1234 was unplugged")
    ]


# --------------------------------------------------------------------------------------------------------- the command


def test_a_lab_without_its_driver_is_told_so(tmp_path: Path) -> None:
    rig = tmp_path / "lab.toml"
    rig.write_text('[controller]\nport = 47101\n[drives]\nbus = "nobodys"\n[camera]\nkind = "folder"\npath = "gone"\n')
    result = CliRunner().invoke(app, ["check", "--rig", str(rig), "--json"])
    assert result.exit_code == 1
    report = CheckReport.model_validate(json.loads(result.stdout))
    found = {(one.device, one.what): one for one in report.findings}
    assert "nobodys" in found["drives", "connection"].found
    assert "gone" in found["camera", "connection"].found
    assert found["key", "touchmove.key"].state is CheckState.LEFT_OUT
    assert found["robot", "reach"].state is found["engine", "Stockfish"].state is CheckState.GOOD


def test_a_rig_that_is_not_there_is_no_finding(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["check", "--rig", str(tmp_path / "no.toml")])
    assert result.exit_code == 2
    assert "cannot be read" in result.stderr


@pytest.mark.slow
def test_the_simulated_rig_is_checked_and_nothing_is_left_running() -> None:
    result = CliRunner().invoke(app, ["check", "--json"])
    report = CheckReport.model_validate(json.loads(result.stdout))
    states = {(one.device, one.what): one.state for one in report.findings}
    # how punctual it is depends on what else this machine does; what it is does not
    for what in (("drives", "status"), ("drives", "brakes"), ("drives", "pose"), ("gripper", "fingers")):
        assert states[what] is CheckState.GOOD, report
    assert {device for device, _ in states} == {"robot", "drives", "gripper", "camera", "engine"}
