"""Life and death: the engine never outlives us, and the terminal's Ctrl-C is ours alone."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import chess
import pytest

from engine.errors import EngineProblem, EngineRefused
from engine.stockfish import Engine, EngineSettings
from tests.waiting import PATIENCE, until

ROOT = Path(__file__).parents[2]

PARENT = """
import signal, sys, chess
signal.signal(signal.SIGINT, signal.default_int_handler)  # whatever started the tests may ignore it
from engine.errors import EngineProblem, EngineRefused
from engine.stockfish import Engine, EngineSettings
engine = Engine(EngineSettings(path=sys.argv[1], nodes=10**12, deadline=60.0)).open()
print(engine.pid, flush=True)
"""
THINK = "engine.choose(chess.Board())"
THINK_WITHIN = """
with engine:
    engine.choose(chess.Board())
"""
DEAF = """
for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGPIPE):
    signal.signal(number, signal.SIG_IGN)
"""
DEAF_AND_BUSY = "while True: time.sleep(1)"


def running(pid: int) -> bool:
    """Whether a process still runs; one that is dead but not yet reaped does not."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False
    return stat.rpartition(")")[2].split()[0] not in "ZX"


@contextmanager
def parent_of(path: str, then: str) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """A Python process in a group of its own that opens an engine and then does something; and the engine's pid."""
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT + then, path],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
        text=True,
    )
    assert parent.stdout is not None
    pid = int(parent.stdout.readline())
    try:
        yield parent, pid
    finally:  # a failing test leaves nothing behind either
        parent.kill()
        parent.communicate()
        if running(pid):
            os.kill(pid, signal.SIGKILL)


def test_stockfish_is_gone_after_our_kill_9(stockfish: str) -> None:
    with parent_of(stockfish, THINK) as (parent, pid):
        time.sleep(0.2)
        assert running(pid)
        parent.kill()
        until(lambda: not running(pid))


def test_an_engine_deaf_to_everything_but_the_kernel_ends_with_us(fake: Callable[..., Any]) -> None:
    with parent_of(fake(at_start=DEAF, on_go=DEAF_AND_BUSY).path, THINK) as (parent, pid):
        time.sleep(0.2)
        assert running(pid)
        parent.kill()
        until(lambda: not running(pid))


def test_leaving_without_closing_leaves_nothing_running(fake: Callable[..., Any]) -> None:
    with parent_of(fake(at_start=DEAF).path, "") as (parent, pid):
        assert parent.wait(timeout=PATIENCE) == 0
        until(lambda: not running(pid))


def test_ctrl_c_in_mid_search_ends_both(stockfish: str) -> None:
    with parent_of(stockfish, THINK_WITHIN) as (parent, pid):
        time.sleep(0.2)
        assert (os.getsid(pid), os.getpgid(pid)) == (pid, pid)
        os.killpg(parent.pid, signal.SIGINT)
        assert parent.wait(timeout=PATIENCE) in (1, -signal.SIGINT)  # KeyboardInterrupt went through
        until(lambda: not running(pid))


def test_an_engine_survives_the_thread_that_opened_it(stockfish: str) -> None:
    engine = Engine(EngineSettings(path=stockfish, nodes=100))
    thread = threading.Thread(target=engine.open)
    thread.start()
    thread.join()
    pid = engine.pid
    assert pid is not None
    time.sleep(0.1)
    with_answer = engine.choose(chess.Board())
    assert with_answer.move in chess.Board().legal_moves
    assert engine.pid == pid
    engine.close()
    assert not running(pid)


def test_close_ends_process_and_thread_at_once_and_twice_is_harmless(fake: Callable[..., Any]) -> None:
    threads = threading.active_count()
    engine = Engine(EngineSettings(path=fake(at_start=DEAF).path, nodes=100)).open()
    pid = engine.pid
    assert pid is not None
    engine.close()
    engine.close()
    assert engine.pid is None
    assert not Path(f"/proc/{pid}").exists()  # reaped as well
    until(lambda: threading.active_count() <= threads)


def test_an_engine_closed_while_another_thread_asks_ends_at_once_and_starts_no_other(fake: Callable[..., Any]) -> None:
    made = fake(on_go="time.sleep(3600)")
    engine = Engine(EngineSettings(path=made.path, nodes=100, deadline=3600.0)).open()
    pid, answers = engine.pid, list[BaseException]()

    def ask() -> None:
        try:
            engine.choose(chess.Board())
        except EngineProblem as error:
            answers.append(error)

    thread = threading.Thread(target=ask)
    thread.start()
    until(lambda: any(line.startswith("go") for line in made.heard))
    engine.close()
    thread.join(PATIENCE)
    assert not thread.is_alive()
    assert [type(answer) for answer in answers] == [EngineRefused]
    assert made.starts == 1
    assert not Path(f"/proc/{pid}").exists()


def test_a_restart_leaves_no_first_process_behind(
    fake: Callable[..., Any], give_up_soon: Callable[[Engine], None]
) -> None:
    engine_file = fake(at_start=DEAF, on_go='if start == 1: time.sleep(60)\nelse: say("bestmove e2e4")')
    with Engine(EngineSettings(path=engine_file.path, nodes=1, deadline=60.0)) as engine:
        first = engine.pid
        assert first is not None
        give_up_soon(engine)
        engine.choose(chess.Board())
        assert not Path(f"/proc/{first}").exists()


@pytest.mark.filterwarnings("error")
def test_a_game_leaves_no_warnings(stockfish: str) -> None:
    with Engine(EngineSettings(path=stockfish, nodes=100)) as engine:
        engine.choose(chess.Board())
        engine.candidates(chess.Board(), lines=2, nodes=100)
