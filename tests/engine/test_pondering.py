"""Thinking while others move: a hit goes on, a miss is stopped, and whatever goes wrong in it is mended by the move."""

from __future__ import annotations

import os
import re
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import chess
import chess.engine
import pytest

from engine.errors import EngineFailed, EngineRefused
from engine.stockfish import Engine, EngineSettings

Limit = chess.engine.Limit
CLOCK = Limit(white_clock=60.0, black_clock=60.0)
PONDER = 'if "ponder" in line: say("info depth 9 nodes 5 score cp 33 pv e2e4 e7e5")\nelse: say("bestmove e2e4")'
"""Searches on when told to ponder, and answers any other search at once."""
HIT = 'if line == "ponderhit": say("bestmove d2d4 ponder d7d5")\nelif line == "stop": say("bestmove a2a3")'


def pondering(made: Any, **changes: object) -> Engine:
    settings = {"path": made.path, "ponder": True, "deadline": 60.0, "move_time": 0.5, **changes}
    return Engine(EngineSettings.model_validate(settings))


def said(made: Any) -> list[str]:
    """What it was told of searches; clocks in whole tens of seconds, as they run while this process is held up."""
    heard = [re.sub(r"(?<=[wb]time )\d+", lambda ms: f"{-(-int(ms[0]) // 10_000)}0000", line) for line in made.heard]
    return [line for line in heard if line.split()[0] in ("go", "stop", "ponderhit", "position")]


def test_a_hit_goes_on_with_the_search_and_keeps_what_was_said_before(fake: Callable[..., Any]) -> None:
    made = fake(on_go=PONDER, on_other=HIT)
    board = chess.Board()
    with pondering(made) as engine:
        assert engine.ponder(board, CLOCK)
        assert engine.ponder(board, CLOCK)  # it does already
        chosen = engine.choose(board, CLOCK)
    assert chosen.move == chess.Move.from_uci("d2d4")
    assert chosen.ponder == chess.Move.from_uci("d7d5")
    assert (chosen.depth, chosen.nodes) == (9, 5)
    assert chosen.score == chess.engine.PovScore(chess.engine.Cp(33), chess.WHITE)
    assert said(made) == ["position startpos", "go ponder wtime 60000 btime 60000", "ponderhit"]
    assert board == chess.Board()


def test_an_engine_is_told_by_its_options_when_it_ponders_and_that_it_plays(fake: Callable[..., Any]) -> None:
    modes = "".join(f'say("option name {name} type check default false"); ' for name in ("UCI_AnalyseMode", "Ponder"))
    made = fake(on_uci=modes + 'say("uciok")', on_go=PONDER, on_other=HIT)
    with pondering(made) as engine:
        engine.ponder(chess.Board(), CLOCK)
        engine.choose(chess.Board(), CLOCK)
        engine.ponder(chess.Board(), CLOCK)
        engine.hint(chess.Board())
    told = [line for line in made.heard if line.split()[0] in ("setoption", "go", "ponderhit")]
    assert told == [
        "setoption name Ponder value true", "go ponder wtime 60000 btime 60000", "ponderhit",
        "go ponder wtime 60000 btime 60000", "setoption name Ponder value false", "go movetime 1000",
    ]  # fmt: skip


def test_a_miss_is_stopped_and_its_answer_is_not_the_next_ones(fake: Callable[..., Any]) -> None:
    made = fake(on_go=PONDER, on_other=HIT)
    other = chess.Board()
    for uci in ("g1f3", "g8f6", "f3g1", "f6g8"):  # the same position, with another history
        other.push_uci(uci)
    with pondering(made) as engine:
        engine.ponder(chess.Board(), CLOCK)
        assert engine.choose(other, CLOCK).move == chess.Move.from_uci("e2e4")
        assert engine.choose(chess.Board(), CLOCK).move == chess.Move.from_uci("e2e4")  # what was pondered is gone
    assert made.starts == 1
    assert [line for line in said(made) if not line.startswith("position")] == [
        "go ponder wtime 60000 btime 60000", "stop", "go wtime 60000 btime 60000", "go wtime 60000 btime 60000",
    ]  # fmt: skip


def test_a_search_that_thinks_it_has_more_time_than_is_left_is_begun_anew(fake: Callable[..., Any]) -> None:
    made = fake(on_go=PONDER, on_other=HIT)
    with pondering(made) as engine:
        engine.ponder(chess.Board(), CLOCK)
        engine.choose(chess.Board(), Limit(white_clock=20.0, black_clock=60.0))
        engine.ponder(chess.Board(), CLOCK)
        engine.choose(chess.Board(), Limit(white_clock=90.0, black_clock=60.0))
    assert [line for line in said(made) if not line.startswith("position")] == [
        "go ponder wtime 60000 btime 60000", "stop", "go wtime 20000 btime 60000",
        "go ponder wtime 60000 btime 60000", "ponderhit",
    ]  # fmt: skip


def test_another_position_is_pondered_instead(fake: Callable[..., Any]) -> None:
    made = fake(on_go=PONDER, on_other=HIT)
    after = chess.Board()
    after.push_uci("e2e4")
    with pondering(made) as engine:
        engine.ponder(after, CLOCK)
        engine.ponder(chess.Board(), CLOCK)
        assert engine.choose(chess.Board(), CLOCK).move == chess.Move.from_uci("d2d4")
    assert [line.split()[0] for line in said(made)] == ["position", "go", "stop", "position", "go", "ponderhit"]


def test_an_engine_that_answers_before_the_hit_is_taken_at_its_word(fake: Callable[..., Any]) -> None:
    made = fake(on_go='say("bestmove d2d4" if "ponder" in line else "bestmove e2e4")')
    with pondering(made) as engine:
        engine.ponder(chess.Board(), CLOCK)
        time.sleep(0.1)
        assert engine.choose(chess.Board(), CLOCK).move == chess.Move.from_uci("d2d4")
    assert made.starts == 1


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        ('say("bestmove e2e5")', "it broke the protocol: illegal uci: 'e2e5'"),
        ("os._exit(4)", "it died with exit code 4"),
        ("os.kill(os.getpid(), signal.SIGSTOP)", "it gave no answer within"),
        ("pass", "it gave no answer within"),
    ],
    ids=["illegal", "dies", "stopped", "silent"],
)
def test_what_goes_wrong_at_the_hit_is_asked_again(
    fake: Callable[..., Any], give_up_soon: Callable[[Engine], None], answer: str, reason: str
) -> None:
    made = fake(on_go=PONDER, on_other=f'if line == "ponderhit": {answer}')
    with pondering(made, move_time=0.1) as engine:
        engine.ponder(chess.Board())
        if "no answer" in reason:
            give_up_soon(engine)
        chosen = engine.choose(chess.Board())
    assert chosen.move == chess.Move.from_uci("e2e4")
    assert len(chosen.troubles) == 1
    assert chosen.troubles[0].startswith(reason)
    assert 0.0 < chosen.lost <= chosen.wall
    assert made.starts == 2


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_an_engine_that_is_killed_or_stopped_while_it_ponders(
    fake: Callable[..., Any], give_up_soon: Callable[[Engine], None], number: int
) -> None:
    made = fake(on_go=PONDER, on_other=HIT)
    other = chess.Board()
    other.push_uci("a2a3")
    other.push_uci("a7a6")
    for board in (chess.Board(), other):  # a hit and a miss
        with pondering(made, move_time=0.1) as engine:
            assert engine.ponder(chess.Board())
            assert engine.pid is not None
            if number == signal.SIGSTOP:
                give_up_soon(engine)
            os.kill(engine.pid, number)
            time.sleep(0.05)
            chosen = engine.choose(board)
        assert chosen.move == chess.Move.from_uci("e2e4")
        assert len(chosen.troubles) == 1


def test_an_engine_that_fails_as_it_begins_to_ponder_loses_nothing(fake: Callable[..., Any]) -> None:
    made = fake(on_new_game="if start == 1: os._exit(5)")
    with pondering(made) as engine:
        assert not engine.ponder(chess.Board(), CLOCK)
        assert engine.pid is None
        assert engine.choose(chess.Board(), CLOCK).move == chess.Move.from_uci("e2e4")
    assert made.starts == 2


def test_who_ponders_not(fake: Callable[..., Any]) -> None:
    made = fake(on_go=PONDER, on_other=HIT)
    mated = chess.Board("rnb1kbnr/pppp1ppp/8/4p3/6Pq/5P2/PPPPP2P/RNBQKBNR w KQkq - 1 3")
    for changes in ({"ponder": False}, {"nodes": 10, "move_time": None}):
        with pondering(made, **changes) as engine:
            assert not engine.ponder(chess.Board(), CLOCK)
    with pondering(made) as engine:
        assert not engine.ponder(mated, CLOCK)
    with pytest.raises(EngineRefused, match=r"^the engine is not open"):
        engine.ponder(chess.Board(), CLOCK)
    assert not said(made)
    bare = fake(on_uci='say("uciok")')
    with pondering(bare) as engine:
        assert not engine.ponder(chess.Board(), CLOCK)
        assert engine.choose(chess.Board(), CLOCK).move == chess.Move.from_uci("e2e4")


def test_a_hint_ends_pondering_and_does_no_harm(fake: Callable[..., Any]) -> None:
    made = fake(on_go=PONDER, on_other=HIT)
    with pondering(made) as engine:
        engine.ponder(chess.Board(), CLOCK)
        assert engine.hint(chess.Board()).move == chess.Move.from_uci("e2e4")
        assert engine.choose(chess.Board(), CLOCK).move == chess.Move.from_uci("e2e4")
    assert "ponderhit" not in made.heard


def test_stockfish_answers_a_hit_at_once_that_it_has_thought_about(stockfish: str) -> None:
    board = chess.Board("r1bqkbnr/pppp1ppp/2n5/4p3/2B1P3/5Q2/PPPP1PPP/RNB1K1NR w KQkq - 4 4")
    limit = Limit(time=1.5)
    with Engine(EngineSettings(path=stockfish, ponder=True, hash_mb=16)) as engine:
        engine.choose(chess.Board(), Limit(nodes=1))
        assert engine.ponder(board, limit)
        time.sleep(1.7)
        chosen = engine.choose(board, limit)
    assert chosen.move in board.legal_moves
    assert chosen.wall < 1.5, "what it has pondered counts"
    assert chosen.score is not None
    assert chosen.pv[0] == chosen.move
    assert chosen.troubles == ()


def test_pondering_leaves_a_game_by_nodes_as_it_was(stockfish: str, tmp_path: Path) -> None:
    def line(ponder: bool) -> list[chess.Move]:
        board = chess.Board()
        with Engine(EngineSettings(path=stockfish, nodes=2000, ponder=ponder)) as engine:
            for _ in range(10):
                board.push(engine.choose(board).move)
                engine.ponder(board)
        return board.move_stack

    assert line(True) == line(False)


def test_a_search_may_be_hurried(stockfish: str) -> None:
    with Engine(EngineSettings(path=stockfish, hash_mb=16)) as engine:
        engine.choose(chess.Board(), Limit(nodes=1))
        engine.move_now()  # nothing to hurry
        over = threading.Event()

        def hurry() -> None:
            while not over.wait(0.3):
                engine.move_now()

        thread = threading.Thread(target=hurry)
        thread.start()
        chosen = engine.choose(chess.Board(), Limit(time=3600.0))
        over.set()
        thread.join()
    assert chosen.depth is not None


def test_a_hung_hit_twice_is_told(fake: Callable[..., Any]) -> None:
    made = fake(on_go="pass")
    with pondering(made, deadline=0.3, move_time=0.1) as engine:
        engine.ponder(chess.Board())
        with pytest.raises(EngineFailed, match="2 times in a row in choosing a move"):
            engine.choose(chess.Board())
