"""Games through the real drivers of emulated drives, in pace real; faults at random moments, and going on after."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from pathlib import Path

import chess.pgn
import pytest
from typer.testing import CliRunner

from app.cli.commands import app
from hardware.interfaces import DriveTrouble
from tests.controllers import Controller, free_port, touchmove

pytestmark = pytest.mark.real_time

BUSES = ("moteus", "ethercat")
SECTIONS = {
    "moteus": """
forces = [{ gain = 40.0 }, { gain = 40.0 }]
[drives.moteus]
brakes = { id = 4, aux = 2, pin = 1 }
forces = [{ id = 4, aux = 1, pin = 1 }, { id = 4, aux = 1, pin = 2 }]
""",
    "ethercat": "forces = [{ gain = 4.0 }, { gain = 4.0 }]\n",
}
WORDS = {
    "too-hot": DriveTrouble.TOO_HOT,
    "under-voltage": DriveTrouble.UNDER_VOLTAGE,
    "silent": DriveTrouble.NO_REPLY,
}
"""What is planted, and what it is told as; what stays until it is mended, since nobody knows what the arm does then."""


def rig_file(folder: Path, bus: str, planted: list[str]) -> Path:
    folder.mkdir()
    path = folder / "rig.toml"
    path.write_text(
        f'[controller]\nport = {free_port()}\n[drives]\nbus = "{bus}"\nemulated = true\n{SECTIONS[bus]}'
        f"[world]\ncameras = false\nrealtime = true\nplanted = [{', '.join(planted)}]\n",
        encoding="utf-8",
    )
    return path


def game_of(folder: Path) -> chess.pgn.Game:
    with (folder / "game.pgn").open(encoding="utf-8") as file:
        game = chess.pgn.read_game(file)
    assert game is not None
    return game


@pytest.mark.slow
@pytest.mark.parametrize("bus", BUSES)
def test_a_game_goes_on_after_a_fault_and_the_controller_names_it(
    bus: str, by_hand: Callable[..., Controller], tmp_path: Path
) -> None:
    """However often the drives brake, as they also do where this machine is too busy for them: nothing is lost."""
    rng = random.Random(f"faults of {bus}")
    kind, device, moment = rng.choice(sorted(WORDS)), rng.randint(1, 3), rng.uniform(1.5, 3.5)  # of driving
    planted = f'{{ kind = "{kind}", device = {device}, at = {moment:.3f}, lasts = 2.0 }}'
    rig = rig_file(tmp_path / "lab", bus, [planted])
    controller = by_hand(rig)
    folder, moves = tmp_path / "game", "e4 d5 exd5"
    options, tried = ("--headless", "--json", "--no-page"), list[str]()
    for _ in range(60):
        if controller.process.poll() is not None:  # the whole bus was lost
            controller = by_hand(rig)
        if (folder / "events.jsonl").exists():
            code, _, err = touchmove("resume", str(folder), *options)
        else:
            code, _, err = touchmove("demo", "--rig", str(rig), "--out", str(folder), "--moves", moves, *options)
        if code == 0 or "is over after 3 plies" in err:
            break
        assert code in (1, 2), err  # 2: the fault is still there
        tried.append(err)
        touchmove("controller", "clear-fault", "--rig", str(rig))
        touchmove("controller", "resume", "--rig", str(rig))  # where something only gave way
    assert [node.san() for node in game_of(folder).mainline()] == moves.split(), tried[-5:]
    said = controller.said()
    cut = kind == "silent" and (bus, device) == ("ethercat", 1)  # whoever is first takes all others along
    told = "no EtherCAT frame has come back" if cut else f"servomotor {device} {WORDS[kind].words}"
    assert told in said, said


@pytest.mark.slow
@pytest.mark.parametrize("bus", BUSES)
def test_a_simulation_of_our_own_has_such_drives_too(bus: str, tmp_path: Path) -> None:
    folder = tmp_path / "game"
    code, out, err = touchmove(
        "demo", "--drives", bus, "--out", str(folder), "--moves", "e4", "--headless", "--json", "--no-page",
        "--no-cameras",
    )  # fmt: skip
    for _ in range(5):
        if code == 0:
            break
        code, out, err = touchmove("resume", str(folder), "--headless", "--json")
    assert code == 0, err
    assert json.loads(out)["physical_ok"] is True
    assert (folder / "run" / "world_end.json").exists()


def test_emulated_drives_keep_to_the_wall_clock() -> None:
    done = CliRunner().invoke(app, ["demo", "--drives", "moteus", "--pace", "fast", "--headless"])
    assert done.exit_code == 2
    assert done.stderr.strip().endswith("--drives moteus keeps to the wall clock like real drives: leave out --pace")
