"""At every prompt a person may quit, resign or go away; each ends in a record that 'resume' takes."""

from __future__ import annotations

import json
import os
import pty
import subprocess
import sys
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from app.cli.commands import app
from tests.waiting import PATIENCE, until

TOUCHMOVE = (sys.executable, "-P", "-m", "app.cli")
WITHOUT_SIGHT = (
    sys.executable, "-P", "-c",
    "import runpy; from app.execution.observation import GameObserver; GameObserver.whereabouts = lambda *_: None; "
    "runpy.run_module('app.cli', run_name='__main__', alter_sys=True)",
)  # fmt: skip
"""The same, as if what stands beside the board, or elsewhere than it should, could not be seen to stand there."""
BOARD = ("--rig", "board", "--nodes", "500")
SIMULATED = ("--pace", "fast", "--no-guard", "--nodes", "500")


def run_program(
    folder: Path, lines: tuple[str, ...], *command: str, program: tuple[str, ...] = TOUCHMOVE
) -> tuple[int, dict[str, Any], str]:
    """Exit status, report and everything said of a game in which these lines are typed; then the input ends."""
    typed = "".join(f"{line}\n" for line in lines)
    done = subprocess.run([*program, *command, "--json"], input=typed, capture_output=True, text=True, check=False)
    assert "Traceback" not in done.stderr, done.stderr
    report = folder / "report.json"
    return done.returncode, json.loads(report.read_text()) if report.exists() else {}, done.stderr


def run_here(folder: Path, lines: tuple[str, ...], *command: str) -> tuple[int, dict[str, Any], str]:
    """The same in this process, which need not be started and load everything."""
    typed = "".join(f"{line}\n" for line in lines)
    done = CliRunner().invoke(app, [*command, "--json"], input=typed)
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exc_info
    report = folder / "report.json"
    return done.exit_code, json.loads(report.read_text()) if report.exists() else {}, done.stderr


@pytest.mark.parametrize("before", [(), ("e4",), ("pause",), ("e4", "pause")], ids=["start", "move", "pause", "both"])
@pytest.mark.parametrize("leave", ["quit", "resign", None])
def test_a_game_without_devices_is_left_and_taken_up(
    tmp_path: Path, before: tuple[str, ...], leave: str | None
) -> None:
    game = tmp_path / "game"
    lines = before if leave is None else (*before, leave)
    # whole programs after all that may come before, where the end is not typed
    run = run_program if len(before) > 1 and leave is None else run_here
    status, report, said = run(game, lines, "play", "--no-page", *BOARD, "--out", str(game))
    plies = 2 * before.count("e4")
    assert report["plies"] == plies
    if leave == "resign":
        assert (status, report["result"]) == (0, "0-1")
        status, _, said = run(game, (), "resume", "--no-page", str(game))
        assert status == 2
        assert f"is over after {plies} plies: start a new one" in said
        return
    assert f"'touchmove resume {game}' continues it" in said
    assert status == (0 if leave == "quit" else 1)
    status, report, _ = run(game, ("d4" if not plies else "Nf3", "resign"), "resume", "--no-page", str(game))
    assert (status, report["result"], report["plies"]) == (0, "0-1", plies + 2)


@pytest.mark.parametrize("closed", [False, True], ids=["ctrl-d", "window closed"])
def test_a_terminal_that_ends_is_told_in_two_sentences(tmp_path: Path, closed: bool) -> None:
    game, said = tmp_path / "game", tmp_path / "said"
    ours, theirs = pty.openpty()
    with said.open("wb") as out:
        command = [*TOUCHMOVE, "play", "--no-page", *BOARD, "--out", str(game)]
        process = subprocess.Popen(command, stdin=theirs, stdout=out, stderr=out, start_new_session=True)
    os.close(theirs)
    until(lambda: b"your move" in said.read_bytes())
    if closed:
        os.close(ours)
    else:
        os.write(ours, b"\x04")
    assert process.wait(PATIENCE) == 1
    if not closed:
        os.close(ours)
    after = [line.strip() for line in said.read_text().split("your move >")[1].split("\n") if line.strip()]
    ended, onward = after[-2:]
    assert ended.startswith("failed: there is no input at the terminal any more")
    assert onward == f"'touchmove resume {game}' continues it"
    assert len(after) == 4, "and besides that the arm is coming to rest, and what came of the game"


def test_what_is_no_text_is_answered_like_other_nonsense(tmp_path: Path) -> None:
    command = [*TOUCHMOVE, "play", "--no-page", *BOARD, "--out", str(tmp_path / "game"), "--json"]
    done = subprocess.run(command, input=b"\xff\xfe\nquit\n", capture_output=True, check=False)
    assert done.returncode == 0
    assert "is neither SAN nor UCI" in done.stderr.decode()


@pytest.mark.slow
def test_a_game_that_waits_for_a_piece_is_left_and_taken_up(tmp_path: Path) -> None:
    """The knight lies in a tray where nobody looks for it: the person is asked, goes away, and puts it back.

    Every word that leaves at this prompt is said to it in the tests of what a person is asked.
    """
    game = tmp_path / "game"
    play = partial(run_program, game, program=WITHOUT_SIGHT)
    asked = "put the white knight on b1"
    status, report, said = play(("hand move b1 L3", "fix"), "play", "--no-page", *SIMULATED, "--out", str(game))
    assert (status, report["result"]) == (1, "*")
    assert asked in said
    lines = ("nonsense", "hand move L3 b1", "done", "resign")
    status, report, said = play(lines, "resume", "--no-page", str(game))
    assert asked in said
    assert "'nonsense' is not an answer" in said
    assert (status, report["result"], report["plies"]) == (0, "0-1", 0), said[-2000:]
