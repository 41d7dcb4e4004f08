"""Scripted engines that speak UCI and misbehave as told."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from engine.stockfish import DEBIAN_PATH, Engine

SCRIPT = """#!{python} -IS
import os, signal, sys, time

def say(*words):
    print(*words, flush=True)

with open({starts!r}, "a") as file:
    file.write("x")
start = os.path.getsize({starts!r})
log = open({log!r}, "a")
{at_start}
for line in sys.stdin:
    line = line.strip()
    print(line, file=log, flush=True)
    if line == "uci":
{on_uci}
    elif line == "isready":
        say("readyok")
    elif line == "ucinewgame":
{on_new_game}
    elif line.startswith("go"):
{on_go}
    else:
{on_other}
"""

HELLO = """
say("id name Fake 1.0")
say("option name UCI_Elo type spin default 1500 min 1400 max 2000")
say("option name UCI_LimitStrength type check default false")
say("option name Threads type spin default 1 min 1 max 4")
say("option name Hash type spin default 16 min 1 max 1024")
say("option name MultiPV type spin default 1 min 1 max 100")
say("option name Ponder type check default false")
say("uciok")
"""


@dataclass(frozen=True)
class Fake:
    """A scripted engine: its path, and what it met."""

    path: str
    starts_file: Path
    log_file: Path

    @property
    def starts(self) -> int:
        """How often it was started."""
        return self.starts_file.stat().st_size if self.starts_file.exists() else 0

    @property
    def heard(self) -> list[str]:
        """Lines sent to it, over all starts."""
        return self.log_file.read_text().splitlines()


MakeFake = Callable[..., Fake]


def _indented(code: str) -> str:
    return "\n".join(" " * 8 + line for line in (code.strip() or "pass").splitlines())


@pytest.fixture
def fake(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> MakeFake:
    """Makes a fake engine from Python snippets; they see ``start`` (1, 2, ...), ``line`` and ``say``."""
    monkeypatch.setattr("engine.budget.MARGIN", 60.0)  # however busy the machine

    def make(
        on_go: str = 'say("bestmove e2e4")',
        on_uci: str = HELLO,
        on_new_game: str = "",
        at_start: str = "",
        on_other: str = "",
    ) -> Fake:
        made = Fake(str(tmp_path / "fake-engine"), tmp_path / "starts", tmp_path / "log")
        text = SCRIPT.format(
            python=sys.executable,
            starts=str(made.starts_file),
            log=str(made.log_file),
            at_start=at_start,
            on_uci=_indented(on_uci),
            on_new_game=_indented(on_new_game),
            on_go=_indented(on_go),
            on_other=_indented(on_other),
        )
        Path(made.path).write_text(text)
        Path(made.path).chmod(0o755)
        return made

    return make


@pytest.fixture(autouse=True)
def _without_pauses(monkeypatch: pytest.MonkeyPatch) -> None:
    """Attempts follow each other at once; an engine that is ready is waited for, however busy the machine."""
    monkeypatch.setattr("engine.stockfish.PAUSES", (0.0, 0.0, 0.0))
    monkeypatch.setattr("engine.stockfish.PULSE_DEADLINE", 60.0)


GiveUpSoon = Callable[[Engine], None]


@pytest.fixture
def give_up_soon(monkeypatch: pytest.MonkeyPatch) -> GiveUpSoon:
    """The process of an engine is given up after 2 s, as it hangs; those after it do not, and are waited for."""

    def shorten(engine: Engine) -> None:
        process = engine._supervised.process
        assert process is not None
        call = process.call
        monkeypatch.setattr(process, "call", lambda question, deadline: call(question, min(deadline, 2.0)))

    return shorten


@pytest.fixture(scope="session")
def stockfish() -> str:
    """Path of the real thing."""
    found = shutil.which("stockfish") or shutil.which(DEBIAN_PATH)
    if found is None:
        pytest.skip("Stockfish is not installed (sudo apt-get install stockfish)")
    return found
