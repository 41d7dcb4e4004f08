"""A person plays in a terminal: on the rig without devices, and against the camera of the simulated one."""

from __future__ import annotations

import io
import json
import os
import pty
import re
import select
import subprocess
import sys
import time
from pathlib import Path

import chess.pgn
import pytest
from typer.testing import CliRunner

from app.cli.commands import app
from tests.waiting import PATIENCE

TOUCHMOVE = (sys.executable, "-P", "-m", "app.cli")


AT_A_TERMINAL = """
import fcntl, os, signal, sys, termios
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # nohup's tests have it ignored
os.execv(sys.argv[1], sys.argv[1:])
"""
"""The terminal is the program's own: it is told of the terminal's end."""


class PseudoTerminal:
    """A command that believes to be at a terminal."""

    def __init__(self, *arguments: str) -> None:
        ours, theirs = pty.openpty()
        self.process = subprocess.Popen(
            [sys.executable, "-c", AT_A_TERMINAL, *TOUCHMOVE, *arguments], stdin=theirs, stdout=theirs, stderr=theirs,
            start_new_session=True,
        )  # fmt: skip
        os.close(theirs)
        self._fd = ours
        self.shown = ""
        self._read = 0

    def until(self, pattern: str, timeout: float = PATIENCE) -> re.Match[str]:
        """The next that is shown and matches."""
        deadline = time.monotonic() + timeout
        while True:
            if found := re.compile(pattern).search(self.shown, self._read):
                self._read = found.end()
                return found
            if time.monotonic() > deadline:
                pytest.fail(f"no {pattern!r} within {timeout:.0f} s after {self.shown[self._read :][-800:]!r}")
            if select.select([self._fd], [], [], 0.1)[0]:
                try:
                    self.shown += os.read(self._fd, 65536).decode("utf-8", "replace")
                except OSError:  # the other end is closed: there is no more
                    if not re.compile(pattern).search(self.shown, self._read):
                        pytest.fail(f"it ended before {pattern!r}: {self.shown[self._read :][-800:]!r}")

    def type(self, line: str) -> None:
        os.write(self._fd, f"{line}\n".encode())

    def end(self, *, gone: bool = False) -> int:
        """The exit status; ``gone``: the terminal goes first."""
        if gone:
            os.close(self._fd)
        status = self.process.wait(PATIENCE)
        if not gone:
            os.close(self._fd)
        return status


@pytest.mark.slow
def test_a_game_whose_terminal_goes_ends_in_good_order(tmp_path: Path) -> None:
    """As when its window is closed: the arm is brought to rest though nobody can be told so."""
    game = tmp_path / "game"
    terminal = PseudoTerminal(
        "demo",
        "--pace",
        "fast",
        "--no-cameras",
        "--no-video",
        "--movetime",
        "0.02",
        "--plies",
        "200",
        "--out",
        str(game),
    )
    terminal.until(r"quiet|capture")
    assert terminal.end(gone=True) == 130
    assert '"reason":"interrupted"' in (game / "events.jsonl").read_text().splitlines()[-1]
    assert json.loads((game / "run" / "world_end.json").read_text())["at_rest"] is True


def test_a_game_in_a_terminal_from_its_start_to_mate(tmp_path: Path) -> None:
    terminal = PseudoTerminal(
        "play", "--no-page", "--rig", "board", "--fen", "8/8/8/4k3/8/8/3QK3/8 w - - 0 1", "--nodes", "3000", "--out",
        str(tmp_path / "game"),
    )  # fmt: skip
    for _ in range(40):
        terminal.until("your move > ")
        terminal.type("hint")
        move = terminal.until(r"I would play (\S+?)[\s\r]")[1]
        terminal.until("your move > ")
        terminal.type(move)
        if terminal.until(r"your move|result \S+")[0].startswith("result"):
            break
        terminal._read -= len("your move")  # the prompt that was just seen is the next one's
    assert terminal.end() == 0
    report = json.loads((tmp_path / "game" / "report.json").read_text())
    assert (report["result"], report["exit_reason"]) == ("1-0", "checkmate")
    assert report["plies"] % 2 == 1


ENGINE = """\
import sys, chess
replies, board = {replies!r}.split(), chess.Board()
for line in sys.stdin:
    words = line.split()
    if words[:1] == ["uci"]:
        print("id name Book\\nuciok", flush=True)
    elif words[:1] == ["isready"]:
        print("readyok", flush=True)
    elif words[:1] == ["position"]:
        given = words[1] == "fen"
        board = chess.Board(" ".join(words[2:8])) if given else chess.Board()
        for move in words[9 if given else 3:]:
            board.push_uci(move)
    elif words[:1] == ["go"]:
        print("bestmove", board.parse_san(replies[len(board.move_stack) // 2]).uci(), flush=True)
    elif words[:1] == ["quit"]:
        break
"""
"""Plays given moves from wherever it is told to begin, so that a person's moves can be written down beforehand."""


def test_a_game_begins_from_whatever_stands_on_the_board_and_goes_on_without_its_record(tmp_path: Path) -> None:
    """Nobody says which position it is; afterwards the record is gone, and what stands there is all that is known."""
    folder = tmp_path / "game"
    standing = "8/8/4k3/8/8/3Q4/8/4K2R w - - 0 1"
    terminal = PseudoTerminal(
        "play", "--no-page", "--from-board", "--standing", standing, "--pace", "fast", "--no-guard",
        "--nodes", "500", "--out", str(folder),
    )  # fmt: skip
    terminal.until(r"who moves next.* > ")
    terminal.type("hand move d3 c3")
    terminal.until(r"who moves next.* > ")
    terminal.type("white")
    terminal.until(r"may White still castle.* > ")
    terminal.type("short")
    terminal.until("your move > ")
    terminal.type("O-O")
    terminal.until("your move > ")
    terminal.type("quit")
    assert terminal.end() == 0
    game = chess.pgn.read_game(io.StringIO((folder / "game.pgn").read_text()))
    assert game is not None
    assert game.headers["FEN"] == "8/8/4k3/8/8/2Q5/8/4K2R w K - 0 1"
    board = game.end().board()
    assert len(board.move_stack) == 2
    (folder / "events.jsonl").write_text("nonsense\n")
    terminal = PseudoTerminal("resume", "--no-page", "--from-board", str(folder))
    terminal.until(r"who moves next.* > ")
    terminal.type("white")
    terminal.until("your move > ")
    terminal.type("hand move c3 f4")
    terminal.until("your move > ")
    terminal.type("keep")  # whatever became of the game: what stands there begins another one
    terminal.until(r"who moves next.* > ")
    terminal.type("white")
    terminal.until("your move > ")
    terminal.type("quit")
    assert terminal.end() == 0
    games = [chess.pgn.read_game(io.StringIO((folder / f"game-{k}" / "game.pgn").read_text())) for k in (2, 3)]
    assert games[0] is not None
    assert games[1] is not None
    assert games[0].board().board_fen() == board.board_fen()
    board.set_piece_at(chess.F4, board.remove_piece_at(chess.C3))
    assert games[1].board().board_fen() == board.board_fen()


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--rig", "board"), "needs a camera, and this rig has none"),
        (("--fen", chess.STARTING_FEN), "--fen has no effect here"),
    ],
)
def test_positions_from_the_board_take_a_camera_and_nothing_else(arguments: tuple[str, ...], sentence: str) -> None:
    done = CliRunner().invoke(app, ["play", "--no-page", "--from-board", *arguments])
    assert done.exit_code == 2
    assert sentence in " ".join(done.stderr.split())
