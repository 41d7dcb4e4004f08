"""Life and death of the processes: whatever ends, nothing is left running and the arm is at rest."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import time

import pytest
from typer.testing import CliRunner

from app.cli.commands import app
from tests.waiting import until

GAME = ("--pace", "fast", "--no-video", "--plies", "200", "--movetime", "0.02")
UNSEEN = ("--no-cameras",)
"""Where what draws makes no difference: it takes a third of a start."""
SEPARATE = ("--processes", "separate")
NAMES = {"world": "the simulated world", "controller": "the controller"}
VICTIMS = [
    ("world", UNSEEN, "the simulation"), ("world", (*SEPARATE, *UNSEEN), NAMES["world"]),
    ("controller", SEPARATE, NAMES["controller"]),
]  # fmt: skip
"""A process, how a game has it, and what people are told it is."""


def in_mid_game(run):
    run.until(lambda: run.plies() >= 1, "the first ply")
    time.sleep(0.15)  # into the next ply


@pytest.mark.slow
@pytest.mark.parametrize(("number", "more"), [(signal.SIGINT, ()), (signal.SIGTERM, UNSEEN)])
def test_an_interrupt_ends_everything_long_before_a_killed_program_would(demo, number, more):
    run = demo(*GAME, *more, "--linger", "600")  # nobody waits so long for it to end
    in_mid_game(run)
    run.signal(number)
    status, _, err = run.wait()
    assert status == 130
    assert err.strip() == (
        "touchmove: interrupted; the arm is at rest, and nothing that this program started is still running; "
        f"'touchmove resume {run.folder}' continues it"
    )
    assert not run.helpers()
    end = run.world_end()
    assert end["at_rest"]
    assert end["arm_speed"] < 1e-3
    report = json.loads((run.folder / "report.json").read_text())
    assert (report["exit_reason"], report["plies"]) == ("interrupted", run.plies())


@pytest.mark.slow
def test_an_interrupt_while_starting_leaves_nothing(demo):
    run = demo(*GAME)
    run.until(lambda: "world" in run.helpers(), "the world")
    run.signal(signal.SIGINT)
    assert run.wait()[0] == 130
    until(lambda: not run.helpers(), "the end of what had just been started")


@pytest.mark.slow
def test_kill_9_of_the_app_stops_the_arm_and_ends_everything(demo):
    run = demo(*GAME, "--linger", "5")
    in_mid_game(run)
    assert {"world", "stockfish"} <= run.helpers().keys()
    killed = time.time()
    run.signal(signal.SIGKILL)
    run.process.wait()
    until(lambda: "stockfish" not in run.helpers(), "the engine's end")
    until(lambda: not run.helpers())
    end = run.world_end()
    ended = (run.folder / "run" / "world_end.json").stat().st_mtime
    assert ended - killed > 4.5, "the arm is held while it waits for another client"
    assert end["at_rest"]
    assert end["arm_speed"] < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize(("victim", "processes", "named"), VICTIMS)
def test_kill_9_of_a_process_ends_the_game_with_a_sentence(demo, victim, processes, named):
    run = demo(*GAME, *processes)  # the app tells the world not to linger
    in_mid_game(run)
    os.kill(run.helpers()[victim], signal.SIGKILL)
    status, out, err = run.wait()
    assert status == 1
    assert f"failed: {named} has ended: it was killed (SIGKILL)" in err
    assert f"touchmove resume {run.folder}" in err, "a killed world is found as it stood"
    assert "Traceback" not in err
    report = json.loads(out)
    assert report["exit_reason"] == "failed"
    assert report["plies"] == run.plies() >= 1
    assert not run.helpers()
    assert len(report["failures"]) == 1
    if victim == "controller":
        assert run.world_end()["at_rest"], "the drives' own watchdog brakes"
        assert not {"world.sock", "world.mjb", "frame-0.bin", "key"} & {p.name for p in (run.folder / "run").iterdir()}


@pytest.mark.slow
def test_kill_9_of_what_can_be_started_again_goes_unnoticed(demo):
    run = demo(*GAME, "--verify")  # much longer than this test, however busy the machine is
    in_mid_game(run)
    running = run.helpers()
    for victim in ("drawing", "stockfish"):
        os.kill(running[victim], signal.SIGKILL)
    before = run.plies()
    run.until(lambda: run.plies() > before + 2, "plies of both sides without them")
    run.signal(signal.SIGINT)
    assert run.wait()[0] == 130
    report = json.loads((run.folder / "report.json").read_text())
    assert (report["exit_reason"], report["failures"]) == ("interrupted", [])
    assert not run.helpers()


@pytest.mark.slow
@pytest.mark.parametrize(("victim", "processes", "named"), VICTIMS)
def test_kill_9_of_a_process_that_is_starting_is_named(demo, victim, processes, named, tmp_path):
    # it starts for as long as it takes to find and kill it
    (tmp_path / "sitecustomize.py").write_text(
        f"import sys, time\nif sys.orig_argv[4:5] == [{victim!r}]: time.sleep(600.0)\n"
    )
    path = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
    run = demo(*GAME, *processes, *UNSEEN, environment={"PYTHONPATH": path})
    run.until(lambda: victim in run.helpers(), f"the {victim}")
    os.kill(run.helpers()[victim], signal.SIGKILL)
    status, _, err = run.wait()
    assert status == 2
    assert err.strip() == f"touchmove: {named} could not start: it was killed (SIGKILL)"


@pytest.fixture
def small_disk(tmp_path):
    """A file system of 20 MiB, where this user may mount one."""
    folder = tmp_path / "disk"
    folder.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=20m", "tmpfs", folder], check=False).returncode:
        pytest.skip("mounting a file system takes privileges")
    yield folder
    subprocess.run(["umount", "--lazy", folder], check=True)


@pytest.mark.slow
@pytest.mark.parametrize("left", [0, 1 << 16, 1 << 20, 1 << 23])
def test_a_disk_that_is_full_when_the_world_starts_is_named(demo, small_disk, left):
    used = os.statvfs(small_disk).f_bavail * os.statvfs(small_disk).f_frsize - left
    with (small_disk / "other.bin").open("wb") as other:
        os.posix_fallocate(other.fileno(), 0, used)
    sentence = refused(demo("--moves", "e4", "--pace", "fast", name="disk/game"))
    assert f"the disk at {small_disk}" in sentence
    assert f"{small_disk}/game" in sentence
    assert "free some space or choose another folder with --out" in sentence


def refused(run):
    status, out, err = run.wait()
    assert status == 2
    assert out == ""
    assert "Traceback" not in err
    assert not run.helpers()
    (sentence,) = err.strip().splitlines()
    return sentence


def test_a_missing_stockfish_is_named_with_the_remedy(demo):
    sentence = refused(demo("--engine", "/nonexistent/stockfish"))
    assert "/nonexistent/stockfish" in sentence
    assert "apt-get install stockfish" in sentence


@pytest.mark.slow
def test_no_opengl_is_named_with_the_remedy(demo):
    # a driver list that does not exist is how a machine without Mesa looks to the loader
    sentence = refused(
        demo("--moves", "e4", "--pace", "fast", environment={"__EGL_VENDOR_LIBRARY_FILENAMES": "/nonexistent.json"})
    )
    assert "pictures need OpenGL" in sentence
    assert "apt-get install libegl1 libgl1-mesa-dri" in sentence


@pytest.mark.slow
def test_a_port_in_use_is_named_with_the_remedy(demo):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        sentence = refused(demo("--moves", "e4", "--pace", "fast", *UNSEEN, "--port", str(port)))
    assert str(port) in sentence
    assert "in use" in sentence


def test_a_full_disk_is_named_with_the_remedy(demo, tmp_path):
    folder = tmp_path / "full"
    folder.mkdir()
    (folder / "events.jsonl").symlink_to("/dev/full")
    sentence = refused(demo("--moves", "e4", name="full"))
    assert "no space left" in sentence
    assert "--out" in sentence


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--pace", "slow"), ["'slow'", "real or fast"]),
        (("--fen", "8/8/8/8/8/8/8/8 w - - 0 1"), ["not a legal position", "king"]),
        (("--fen", "nonsense"), ["--fen", "nonsense"]),
        (("--moves", "e4 e5 Ke3"), ["Ke3", "3"]),
        (("--nodes", "100", "--white-elo", "1500"), ["--nodes", "strength in Elo"]),
        (("--white-elo", "100"), ["100", "2850"]),
        (("--fen", "QQQQQ3/8/8/8/8/8/8/K4k2 w - - 0 1"), ["queen", "white"]),
    ],
)
def test_bad_options_get_one_sentence(tmp_path, arguments, words):
    done = CliRunner().invoke(app, ["demo", "--out", str(tmp_path / "game"), "--headless", "--json", *arguments])
    assert (done.exit_code, done.stdout) == (2, "")
    (sentence,) = done.stderr.splitlines()
    for word in words:
        assert word in sentence
