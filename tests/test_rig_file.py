"""A controller started by hand from a rig file, and games that only connect to it; also from another computer."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from app.cli.commands import app
from tests.controllers import Controller, free_port, status, touchmove
from tests.waiting import PATIENCE, until


def rig_file(folder: Path, host: str, port: int, **controller: object) -> Path:
    """A rig with a simulated world in pace fast, without cameras."""
    folder.mkdir(exist_ok=True)
    lines = [f'host = "{host}"', f"port = {port}", *(f"{name} = {value}" for name, value in controller.items())]
    path = folder / "rig.toml"
    text = "[controller]\n" + "\n".join(lines) + '\n[drives]\nbus = "sim"\n[world]\npace = "fast"\ncameras = false\n'
    path.write_text(text, encoding="utf-8")
    return path


def game(rig: Path, folder: Path, moves: str, *options: str, within: tuple[str, ...] = ()) -> dict[str, Any]:
    """A game on the rig; its report."""
    code, out, err = touchmove(
        "demo", "--rig", str(rig), "--out", str(folder), "--moves", moves, "--headless", "--json", "--no-video",
        *options, within=within,
    )  # fmt: skip
    assert code == 0, err
    return dict(json.loads(out))


def refusal(*arguments: str) -> str:
    """What a command says that is refused before anything is started; it need not be a program of its own for that."""
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 2, (arguments, done.output)
    return done.stderr


@pytest.mark.slow
def test_a_controller_outlives_games_parks_and_is_killed_and_ended(
    by_hand: Callable[..., Controller], tmp_path: Path
) -> None:
    rig = rig_file(tmp_path / "lab", "127.0.0.1", free_port(), linger=1.0)
    controller = by_hand(rig)
    assert "created the key" in controller.said()
    assert (rig.parent / "touchmove.key").stat().st_mode & 0o777 == 0o600

    report = game(rig, tmp_path / "one", "e4")
    assert report["physical_ok"] is True
    parked = until(lambda: one if (one := status(rig))["state"] == "BOOT" else None, "parking")
    assert "BRAKED" in parked["drive_status"]
    assert "no client was connected" in parked["why"]
    # the next game begins from where the first one left the pieces, and opens the brakes by itself
    report = game(rig, tmp_path / "two", "d5", "--fen", "rnbqkbnr/pppppppp/8/8/4P3/8/PPPP1PPP/RNBQKBNR b KQkq - 0 1")
    assert report["physical_ok"] is True

    err = refusal("controller", "clear", "--rig", str(rig))
    assert "choose run, status, press-stop, enable, hold, resume, stop, release, clear-fault, shutdown" in err

    # a restarted controller goes on with the world that its forerunner left
    controller.end(signal.SIGKILL)
    again = by_hand(rig)
    assert "a simulated world is already running" in again.said()
    assert touchmove("controller", "hold", "--rig", str(rig))[0] == 0
    code, _, err = touchmove("demo", "--rig", str(rig), "--out", str(tmp_path / "held"), "--moves", "e4", "--headless")
    assert code == 2
    assert "admits no motion" in err
    assert "touchmove controller resume" in err

    run = again.end()
    assert run == 0
    assert not (rig.parent / "run" / "world.sock").exists(), "the world ends with its controller"
    end = json.loads((rig.parent / "run" / "world_end.json").read_text())
    assert end["at_rest"]
    assert end["braked"]


@pytest.mark.slow
def test_a_rig_that_is_not_there_is_one_sentence(tmp_path: Path) -> None:
    rig = rig_file(tmp_path / "lab", "127.0.0.1", free_port())
    err = refusal("controller", "status", "--rig", str(rig))
    assert "touchmove.key cannot be read" in err
    (rig.parent / "touchmove.key").write_bytes(b"k" * 32)
    (rig.parent / "touchmove.key").chmod(0o600)
    for command in (("controller", "enable"), ("link-test",), ("demo", "--moves", "e4", "--out", str(tmp_path / "g"))):
        err = refusal(*command, "--rig", str(rig))
        assert "start the controller" in err
        assert len(err.strip().splitlines()) <= 2


@pytest.fixture
def two_computers() -> Iterator[tuple[str, tuple[str, ...], tuple[str, ...]]]:
    """Two network namespaces with a cable between them: the controller's address, and how to run in either."""
    if os.geteuid() != 0 or shutil.which("ip") is None:
        pytest.skip("network namespaces need root and iproute2")
    near, far = f"tm-app-{os.getpid()}", f"tm-rt-{os.getpid()}"

    def ip(*arguments: str) -> None:
        subprocess.run(["ip", *arguments], check=True, capture_output=True)

    try:
        ip("netns", "add", near)
    except subprocess.CalledProcessError as error:
        pytest.skip(f"no network namespaces here: {error.stderr.decode().strip()}")
    try:
        ip("netns", "add", far)
        ip("link", "add", "cable0", "netns", near, "type", "veth", "peer", "name", "cable1", "netns", far)
        for name, cable, address in ((near, "cable0", "10.77.0.1/24"), (far, "cable1", "10.77.0.2/24")):
            ip("-n", name, "addr", "add", address, "dev", cable)
            ip("-n", name, "link", "set", cable, "up")
            ip("-n", name, "link", "set", "lo", "up")
        yield "10.77.0.2", ("ip", "netns", "exec", near), ("ip", "netns", "exec", far)
    finally:
        for name in (near, far):
            subprocess.run(["ip", "netns", "delete", name], check=False, capture_output=True)


@pytest.mark.slow
def test_game_and_controller_on_two_computers(
    by_hand: Callable[..., Controller],
    two_computers: tuple[str, tuple[str, ...], tuple[str, ...]],
    tmp_path: Path,
) -> None:
    host, app, real_time = two_computers
    rig = rig_file(tmp_path / "lab", host, 47100)
    controller = by_hand(rig, real_time)
    report = game(rig, tmp_path / "game", "e4 d5 exd5", within=app)
    assert report["plies"] == 3
    assert report["physical_ok"] is True
    code, out, err = touchmove("link-test", "--rig", str(rig), "--duration", "2", "--json", within=app)
    assert code in (0, 1), err
    assert json.loads(out)["checks"]["pings_lost"]["value"] < 50.0  # how many of them are late, the machine decides
    # from this machine's own network there is no way to it
    assert touchmove("controller", "status", "--rig", str(rig))[0] == 2
    assert touchmove("controller", "shutdown", "--rig", str(rig), within=app)[0] == 0
    assert controller.process.wait(PATIENCE) == 0


def test_a_driver_that_is_not_installed_is_named_with_those_that_are(tmp_path: Path) -> None:
    rig = rig_file(tmp_path / "lab", "127.0.0.1", free_port())
    rig.write_text('[controller]\nport = 47100\n[drives]\nbus = "mitsubishi"\n')
    err = refusal("controller", "--rig", str(rig))
    assert "drives.bus is 'mitsubishi', installed here are: sim" in err
    assert "touchmove.drives" in err


DRIVER = '''
"""A lab's driver: an arm that stands on its brakes."""
import time
from hardware.interfaces import DriveStatus, Measurement

class Bus:
    lockstep, period = False, 0.00088

    def __init__(self, parameters):
        self.tick = 0

    def exchange(self, command):
        time.sleep(self.period)
        self.tick += 1
        status = DriveStatus.ENABLED if command.enable else DriveStatus.OK
        return Measurement(self.tick, (0.3, 0.3, 0.3), (0.0, 0.0, 0.0), 0.01, (0.0, 0.0), status)

    def close(self):
        pass
'''


@pytest.mark.slow
def test_a_labs_own_driver_is_found_by_its_entry_point(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "site"
    (package / "lab_drives-1.0.dist-info").mkdir(parents=True)
    (package / "lab_drives.py").write_text(DRIVER)
    (package / "lab_drives-1.0.dist-info" / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: lab-drives\nVersion: 1.0\n"
    )
    (package / "lab_drives-1.0.dist-info" / "entry_points.txt").write_text("[touchmove.drives]\nlab = lab_drives:Bus\n")
    monkeypatch.setenv("PYTHONPATH", str(package))
    rig = rig_file(tmp_path / "lab", "127.0.0.1", free_port())
    rig.write_text(rig.read_text().split("[drives]")[0] + '[drives]\nbus = "lab"\n')
    controller = Controller(rig)
    try:
        assert status(rig)["state"] == "HOLD"
        assert touchmove("controller", "stop", "--rig", str(rig))[0] == 0
    finally:
        assert controller.end() == 0
