"""``touchmove bench clock``: two engines play by the clock with an arm that takes time, and the clock is checked.

Two games, one for each answer to who pays for the arm's motion. What the clock charges is held against two measures
that do not know of it: of each ply, the engine's own time from question to answer; of the whole game, a second clock of
the system's less the motion as measured.
"""

from __future__ import annotations

import random
import time
from typing import NamedTuple

import chess

from app.game.clock import ChessClock
from app.measure.bench.report import BenchReport, Progress, Row, row
from app.players.players import EnginePlayer, Players
from app.settings.time_control import ArmTime, TimeControl
from engine.openings import opening_engine, varied_opening
from engine.stockfish import Engine, EngineSettings

SEED = 1
PLIES = 40
CONTROL = TimeControl.parse("5+0")
QUICK_CONTROL = TimeControl.parse("0:10+0")
ARM = 2.0
"""Motion of the arm for each ply [s]; quick, a twentieth."""
LIMIT_MS = 50.0  # greatest error of a ply, and of the sum by plies [ms]


class Played(NamedTuple):
    """What a game came to."""

    clock: ChessClock
    errors: list[float]  # of each ply: what was charged for the thought, less what the engine took [s]
    total_error: float  # of the sum of all charges, by ply [s]
    flag: str | None  # whose flag fell, and when


def clock_bench(quick: bool, progress: Progress) -> BenchReport:
    """Play both games; ``quick``: with ten seconds on the clock and a quick arm."""
    control, arm = (QUICK_CONTROL, ARM / 20.0) if quick else (CONTROL, ARM)
    rows, flags = dict[str, Row](), list[float]()
    for paid in ArmTime:
        progress(f"{PLIES} plies by {control}, the arm's {arm:g} s a ply paid by {paid}")
        game = play(control, arm, paid, PLIES)
        rows[f"ply, {paid}"] = row([1e3 * abs(error) for error in game.errors], "ms", LIMIT_MS, "max")
        rows[f"sum, {paid}"] = row([1e3 * abs(game.total_error)], "ms", LIMIT_MS, "max")
        rows[f"thought, {paid}"] = row([move.thought for move in game.clock.moves], "s")
        rows[f"left, {paid}"] = row([game.clock.left(colour) for colour in chess.COLORS], "s")
        flags.append(float(game.flag is not None))
        if game.flag is not None:
            progress(game.flag)
    rows["flags fallen"] = row(flags, "1", 0.0, "max")
    return BenchReport.of("clock", SEED, rows, "real")


def play(control: TimeControl, arm: float, paid: ArmTime, plies: int) -> Played:
    """Stockfish plays itself from an opening of the seed, as in a game loop; the arm is but a pause [s]."""
    settings = EngineSettings()
    board = chess.Board()
    with opening_engine(settings) as full:
        for move in varied_opening(full, board, 4, random.Random(SEED)):
            board.push(move)
    with Engine(settings) as white, Engine(settings) as black:
        engines = (EnginePlayer(white, "white"), EnginePlayer(black, "black"))
        with Players(*engines, ponders=False) as players:
            return _played(board, players, ChessClock.new(control, arm_time=paid), arm, plies)


def _played(board: chess.Board, players: Players, clock: ChessClock, arm: float, plies: int) -> Played:
    errors, moved, flag = list[float](), 0.0, None
    began = _independent()
    for _ in range(plies):
        if board.is_game_over():
            break
        colour = board.turn
        clock = clock.start(colour, time.monotonic())
        decision = players.choose(board, clock.limit(colour, time.monotonic(), arm))
        now = time.monotonic()
        flag = flag or _fallen(clock, board, now, "in thought")
        clock = clock.decided(now)
        since = _independent()
        time.sleep(arm)
        moved += _independent() - since
        now = time.monotonic()
        flag = flag or _fallen(clock, board, now, "by the arm")
        clock = clock.arm_clear(now)
        errors.append(clock.moves[-1].thought - decision.thought)
        assert decision.move is not None, "an engine has one while the game lasts"
        board.push(decision.move)
    wall = _independent() - began
    charged = sum(move.thought + move.arm for move in clock.moves)
    expected = wall - (0.0 if clock.arm_time is ArmTime.OWN else moved)
    return Played(clock, errors, (charged - expected) / len(errors), flag)


def _fallen(clock: ChessClock, board: chess.Board, now: float, when: str) -> str | None:
    fall = clock.fallen(board, now)
    return None if fall is None else f"{fall.reason} at ply {board.ply() + 1}, {when}"


def _independent() -> float:
    """The system's raw clock, which nothing else here reads [s]."""
    return time.clock_gettime(time.CLOCK_MONOTONIC_RAW)
