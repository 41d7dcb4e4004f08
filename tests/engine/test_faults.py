"""Engines that fail at random, in games: the game goes on, with legal moves only."""

from __future__ import annotations

import logging
import os
import random
import shutil
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import chess
import chess.engine
import pytest

from engine.errors import EngineFailed, Hung
from engine.process import UciProcess
from engine.stockfish import Engine, EngineMove, EngineSettings
from tests.waiting import until

NONSENSE = Path(__file__).with_name("nonsense.py")
KINDS = ("word", "illegal", "null", "stale", "twice", "garbage", "late", "flood", "exit", "stop", "silent")
E2E4 = chess.Move.from_uci("e2e4")


def play(engine: Engine, plies: int, limit: chess.engine.Limit | None = None) -> list[EngineMove]:
    """A game of an engine against itself, pondering; where it failed for good it is asked again, as a game does."""
    board, chosen = chess.Board(), list[EngineMove]()
    while len(chosen) < plies and not board.is_game_over():
        with suppress(EngineFailed):
            answer = engine.choose(board, limit)
            assert answer.move in board.legal_moves
            board.push(answer.move)
            chosen.append(answer)
            if answer.ponder is not None:
                ahead = board.copy()
                ahead.push(answer.ponder)
                engine.ponder(ahead, limit)
    return chosen


def talking(tmp_path: Path, stockfish: str, seed: int, *kinds: str) -> str:
    """Path of a nonsense engine."""
    path = tmp_path / f"nonsense-{seed}"
    words = (sys.executable, "-IS", str(NONSENSE), stockfish, str(tmp_path / f"starts-{seed}"), str(seed), *kinds)
    path.write_text("#!/bin/sh\nexec " + " ".join(words) + "\n")
    path.chmod(0o755)
    return str(path)


@pytest.mark.slow
def test_a_game_goes_on_with_an_engine_that_talks_nonsense(tmp_path: Path, stockfish: str) -> None:
    path = talking(tmp_path, stockfish, 3, *KINDS)
    with Engine(EngineSettings(path=path, move_time=0.02, ponder=True, deadline=2.0, hash_mb=1)) as engine:
        chosen = play(engine, 24)
    assert len(chosen) == 24
    troubles = [trouble for answer in chosen for trouble in answer.troubles]
    assert len({trouble.split(":")[0] for trouble in troubles}) >= 3


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_of_nonsense_is_survived(tmp_path: Path, stockfish: str, kind: str) -> None:
    path = talking(tmp_path, stockfish, 1, kind)
    with Engine(EngineSettings(path=path, nodes=20, deadline=2.0, hash_mb=1)) as engine:
        assert len(play(engine, 6)) == 6


@contextmanager
def struck(engine: Engine, seed: int) -> Iterator[list[int]]:
    """While this lasts the engine is killed and stopped, thrice each, at random instants, once before all else; yields
    what was done.

    There is an end to it: on a slow machine an engine that is struck again and again gets nowhere.
    """
    rng, over, sent = random.Random(seed), threading.Event(), list[int]()

    def strike() -> None:
        for _ in range(3):
            for number in rng.sample((signal.SIGKILL, signal.SIGSTOP), 2):
                if over.wait(rng.uniform(0.05, 0.7)):
                    return
                if (pid := engine.pid) is not None:
                    with suppress(ProcessLookupError):
                        os.kill(pid, number)
                        sent.append(number)

    thread = threading.Thread(target=strike)
    thread.start()
    try:
        until(lambda: sent)
        yield sent
    finally:
        over.set()
        thread.join()


@pytest.mark.slow
def test_a_game_goes_on_with_a_stockfish_that_is_killed_and_stopped_at_random(stockfish: str) -> None:
    clock = chess.engine.Limit(white_clock=6.0, black_clock=6.0)
    settings = EngineSettings(path=stockfish, ponder=True, deadline=2.0, start_deadline=60.0, hash_mb=1)
    with Engine(settings) as engine, struck(engine, seed=1) as sent:
        chosen = play(engine, 10, clock)
    assert len(chosen) == 10
    assert sent
    assert any(answer.troubles for answer in chosen)
    assert all(answer.lost > 0.0 for answer in chosen if answer.troubles)


def test_a_stopped_engine_that_listened_before_is_known_by_its_pulse(
    stockfish: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("engine.protocol.PULSE", 0.1)
    monkeypatch.setattr("engine.protocol.PULSE_DEADLINE", 60.0)  # it is busy, or its machine, unless it is stopped

    def stop(process: UciProcess) -> None:
        """It has listened in the search: from now on it does not, nor is it waited for until another is there."""
        until(lambda: process.uci._listens and process.uci._searches)
        os.kill(process.pid, signal.SIGSTOP)
        monkeypatch.setattr("engine.protocol.PULSE_DEADLINE", 2.0)
        until(lambda: engine._supervised.process is not process)
        monkeypatch.setattr("engine.protocol.PULSE_DEADLINE", 60.0)

    with Engine(EngineSettings(path=stockfish, hash_mb=1)) as engine:
        engine.choose(chess.Board(), chess.engine.Limit(nodes=1))
        thread = threading.Thread(target=stop, args=(engine._supervised.process,))
        thread.start()
        chosen = engine.choose(chess.Board(), chess.engine.Limit(white_clock=600.0, time=4.0))
        thread.join()
    assert chosen.troubles == ("it has not listened for 2 s in the middle of a search",)
    assert 2.0 < chosen.lost < 60.0  # far from the half of its clock that it may take


def test_an_engine_that_does_not_listen_while_it_searches_is_left_alone(
    fake: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("engine.protocol.PULSE", 0.05)
    monkeypatch.setattr("engine.protocol.PULSE_DEADLINE", 0.1)
    made = fake(on_go='time.sleep(0.6)\nsay("bestmove e2e4")')
    with Engine(EngineSettings(path=made.path, nodes=9)) as engine:
        for _ in range(2):
            assert engine.choose(chess.Board()).troubles == ()


def test_an_engine_that_heeds_no_time_is_stopped_and_its_answer_taken(
    fake: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("engine.budget.SHARE", 0.02)  # of a clock so long that a machine may be held up
    made = fake(on_go="pass", on_other='if line == "stop": say("bestmove e2e4")')
    with Engine(EngineSettings(path=made.path)) as engine:
        assert 1.0 < engine.choose(chess.Board(), chess.engine.Limit(white_clock=60.0)).wall < 60.0
        assert engine.choose(chess.Board(), chess.engine.Limit(white_clock=600.0, time=0.3)).wall < 60.0
    assert made.starts == 1


def test_an_answer_that_comes_late_is_not_the_next_questions(fake: Callable[..., Any]) -> None:
    made = fake(on_go='say("bestmove e2e4")\ntime.sleep(0.1)\nsay("bestmove a2a3")')
    with Engine(EngineSettings(path=made.path, nodes=9)) as engine:
        assert [engine.choose(chess.Board()).move for _ in range(3)] == [E2E4] * 3
    assert made.starts == 1


@pytest.mark.parametrize(
    ("flood", "reason"),
    [
        ('while True: os.write(1, b"x" * 65535 + b"\\n")', "it wrote more than 8 MiB within a second"),
        ('while True: os.write(2, b"x" * 65535 + b"\\n")', "it wrote more than 8 MiB within a second"),
        ('while True: os.write(1, b"x" * 65536); time.sleep(0.01)', "it wrote a line of more than 1 MiB"),
    ],
    ids=["output", "errors", "no end of line"],
)
def test_a_flood_is_cut_off(
    fake: Callable[..., Any], flood: str, reason: str, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.CRITICAL, "chess.engine")  # else each line of it is kept for the report of the test
    made = fake(on_go=f'if start == 1:\n    {flood}\nelse: say("bestmove e2e4")')
    with Engine(EngineSettings(path=made.path, nodes=9)) as engine:
        chosen = engine.choose(chess.Board())
    assert (chosen.move, chosen.troubles) == (E2E4, (reason,))


def test_the_clock_that_is_told_is_what_failures_have_left(fake: Callable[..., Any]) -> None:
    made = fake(on_go='if start == 1: time.sleep(0.5); os._exit(1)\nelse: say("bestmove e2e4")')
    with Engine(EngineSettings(path=made.path)) as engine:
        engine.choose(chess.Board(), chess.engine.Limit(white_clock=10.0))
    first, second = (int(line.split()[2]) for line in made.heard if line.startswith("go"))
    assert 5000 < first <= 10_000  # the clock runs while this process is held up
    assert 1000 <= second <= first - 500


def test_an_engine_that_is_mended_goes_on_with_the_game(tmp_path: Path, stockfish: str) -> None:
    path = tmp_path / "engine"
    shutil.copy(stockfish, path)
    with Engine(EngineSettings(path=str(path), nodes=50, hash_mb=1)) as engine:
        board = chess.Board()
        board.push(engine.choose(board).move)
        assert engine.pid is not None
        path.rename(tmp_path / "away")
        os.kill(engine.pid, signal.SIGKILL)
        for _ in range(2):
            with pytest.raises(EngineFailed, match=r"4 times in a row .*it could not be started: No such file"):
                engine.choose(board)
        (tmp_path / "away").rename(path)
        assert engine.choose(board).move in board.legal_moves


def test_pauses_lie_between_attempts(fake: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("engine.stockfish.PAUSES", (0.0, 0.5))
    made = fake(on_go="os._exit(1)")
    with Engine(EngineSettings(path=made.path, nodes=9)) as engine:
        began = time.monotonic()
        with pytest.raises(EngineFailed, match="3 times in a row"):
            engine.choose(chess.Board())
    assert time.monotonic() - began >= 0.5


def test_an_engine_that_stops_reading_is_told_by_its_deadline_alone(
    fake: Callable[..., Any], caplog: pytest.LogCaptureFixture
) -> None:
    """asyncio logs each line to a closed pipe from the fifth on, and Python's last resort would show that."""
    made = fake(on_go="os.close(0)\ntime.sleep(60)")
    process = UciProcess(made.path, 60.0)
    try:
        with pytest.raises(Hung, match=r"^it gave no answer within 0\.5 s$"):
            process.call(lambda uci: uci.watched(uci.play(chess.Board(), chess.engine.Limit(nodes=1)), 0.1), 0.5)
        for _ in range(20):
            process.tell("stop")
            time.sleep(0.005)
    finally:
        process.kill()
    assert [record.getMessage() for record in caplog.records if record.name == "asyncio"] == []


def test_a_line_to_an_engine_that_is_gone_is_harmless(fake: Callable[..., Any]) -> None:
    process = UciProcess(fake().path, 60.0)
    process.tell("stop")
    os.kill(process.pid, signal.SIGKILL)
    process.tell("stop")
    process.kill()
    process.tell("stop")
