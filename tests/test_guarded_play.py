"""A person who just moves, on the rig of a lab whose camera watches for hands: nothing is typed but the last word."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import chess
import pytest

from hardware.sim.clients.hand import SimHand
from hardware.sim.hand.actions import Move, Withdraw
from hardware.table import TableSettings, square_place
from tests.controllers import free_port
from tests.waiting import PATIENCE

TOUCHMOVE = [sys.executable, "-P", "-m", "app.cli"]
FEN = "7k/5Q1p/p6P/8/8/8/4P3/4K3 w - - 0 1"
"""Black has but moves of the pawn on a6."""
TABLE = TableSettings()


class Program:
    """One of ours, and what it says."""

    def __init__(self, *arguments: str) -> None:
        self.process = subprocess.Popen(
            [*TOUCHMOVE, *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
        )
        self.said = ""
        self._read = 0
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def _listen(self) -> None:
        assert self.process.stdout is not None
        while chunk := os.read(self.process.stdout.fileno(), 4096):
            self.said += chunk.decode("utf-8", "replace")

    def until(self, words: str) -> None:
        """Until it says this, after what was waited for before."""
        deadline = time.monotonic() + PATIENCE
        while (found := self.said.find(words, self._read)) < 0:
            assert self.process.poll() is None, self.said[-2000:]
            assert time.monotonic() < deadline, f"no {words!r} after {self.said[self._read :][-2000:]}"
            time.sleep(0.02)
        self._read = found + len(words)

    def say(self, line: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(f"{line}\n".encode())
        self.process.stdin.flush()

    def end(self) -> None:
        self.process.terminate()
        self.process.wait(PATIENCE)
        self._listener.join()
        for pipe in (self.process.stdin, self.process.stdout):
            assert pipe is not None
            pipe.close()


@pytest.fixture
def program() -> Iterator[Callable[..., Program]]:
    started: list[Program] = []

    def start(*arguments: str) -> Program:
        started.append(Program(*arguments))
        return started[-1]

    yield start
    for one in reversed(started):
        one.end()


def xy(square: str) -> tuple[float, float]:
    return TABLE.xy(square_place(chess.parse_square(square)))


@pytest.mark.slow
def test_a_move_is_seen_when_the_hand_has_gone_and_the_arm_waits_while_one_is_there(
    program: Callable[..., Program], tmp_path: Path
) -> None:
    port = free_port()
    rig = tmp_path / "rig.toml"
    rig.write_text(
        f'[controller]\nport = {port}\n[drives]\nbus = "sim"\n[world]\npace = "fast"\nperson = "white"\nfen = "{FEN}"\n'
    )
    program("controller", "--rig", str(rig)).until("ready: clients connect to")
    folder = tmp_path / "game"
    settings = tmp_path / "settings.toml"
    settings.write_text("[vision]\nguard = true\nguard_rate = 5.0\n[engine]\nnodes = 200\n")
    game = program("play", "--no-page", "--rig", str(rig), "--config", str(settings), "--out", str(folder), "--json")
    game.until("White to move")
    hand = SimHand(tmp_path / "run")
    try:
        hand.perform(Move(start=xy("e2"), to=xy("e4")), Withdraw())
        hand.wait()
        game.until("the board is clear: the arm may continue")  # and takes the pawn: long enough for another hand
        # not waiting for the arm to finish: the move answers the one that it is making
        hand.perform(Move(start=xy("e1"), to=xy("f2")), Withdraw())
        hand.wait()
        game.until("Kf2")
        game.until("I played")
        game.until("White to move")
        assert game.said.count("a hand is over the board: the arm holds") >= 2
        assert game.said.count("the board is clear: the arm may continue") >= 2
        # nobody looks while this one is made
        game.process.kill()
        hand.perform(Move(start=xy("f2"), to=xy("e3")), Withdraw())
        hand.wait()
        game = program("resume", "--no-page", str(folder), "--json")
        game.until("this looks like Ke3: was that your move?")
        game.say("yes")
        game.until("I played")
        game.until("White to move")
    finally:
        hand.close()
    game.say("resign")
    assert game.process.wait(PATIENCE) == 0, game.said[-2000:]
    report = json.loads((folder / "report.json").read_text())
    # nobody can judge a ply by where the pieces stand after the next one
    assert (report["plies"], report["physical_ok"], report["failures"]) == (6, None, [])
