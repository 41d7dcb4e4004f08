"""Benches ``people`` and ``knocks``: games against a scripted person who errs, and how many of them end as they should.

From a random position on, the person moves by hand and says 'look'; or plays what is not allowed, knocks a piece over,
moves two at once, exchanges two, leaves one between squares, takes a move back by hand, and says 'look' or 'fix'.
Light, camera and how the pieces stand are drawn anew for each game. Asked for something, they do it; but what lies they
leave to the arm. Whether the board is right in the end is the referee's word. In ``knocks`` they do nothing but knock.
"""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

import chess
import numpy as np

from app import UserError
from app.execution.state import EXPECTED_FAILURES
from app.measure.bench.report import BenchReport, Progress, row
from app.measure.bench.scripted_person import OFTEN, Act, ScriptedPerson
from app.measure.bench.vision.games import random_game
from app.play.launch import run_games
from app.settings.tree import PlayerKind, Settings
from engine.errors import EngineProblem

SEED: Final = 9001  # of the first game
GAMES: Final = {True: 3, False: 300}  # by ``quick``
KNOCKS: Final = {True: 4, False: 500}  # by ``quick``
KNOCKS_SEED: Final = 12001
OPENING: Final = (0, 60)
"""So many random plies are played before."""
WORLD: Final = """
light_brightness = 0.3
light_colour = 0.15
light_direction = 3.1
light_radius = 0.1
exposure = 0.15
white_balance = 0.08
camera_shift = 0.01
camera_turn = 0.03
placement_sigma = 0.0015
placement_limit = 0.004
"""
"""How worlds differ: a `Randomisation`."""


def random_position(seed: int) -> chess.Board:
    """White to move, and not in check."""
    rng = np.random.default_rng([seed, 5])
    while True:
        board = chess.Board()
        for move in random_game(int(rng.integers(1 << 31)), int(rng.integers(*OPENING))):
            board.push(move)
        if board.turn is chess.WHITE and not board.is_check() and not board.is_game_over():
            return chess.Board(board.fen())


def play_one(
    seed: int, often: Mapping[Act, float] = OFTEN, changes: Callable[[Settings], Settings] = lambda one: one
) -> ScriptedPerson:
    """Play one game; ``often`` as of ``ScriptedPerson``, ``changes`` of its settings are made last."""
    with tempfile.TemporaryDirectory(prefix="touchmove-") as name:
        folder, board = Path(name), random_position(seed)
        world = folder / "world.toml"
        world.write_text(WORLD, encoding="utf-8")
        settings = Settings().with_changes(
            {
                "rig.pace": "fast", "rig.seed": seed, "rig.video": False, "rig.randomise": world, "rig.linger": 2.0,
                "white.player": PlayerKind.HUMAN, "black.player": PlayerKind.ENGINE, "engine.nodes": 300,
                "game.fen": board.fen(), "out": folder / "game",
            }
        )  # fmt: skip
        person = ScriptedPerson(folder / "game" / "run", seed, board, often)
        try:
            result = run_games(changes(settings), person, person.typed)
        except (*EXPECTED_FAILURES, EngineProblem) as error:
            person.failed(str(error))
            return person
        for failure in result.report.failures:
            person.failed(failure.reason)
        return person


def people_bench(quick: bool, progress: Progress) -> BenchReport:
    """Play games and count those that went right.

    Raises:
        UserError: no game could be played.
    """
    games = GAMES[quick]
    counted, acts, right = Counter[str](), Counter[Act](), 0
    for number in range(games):
        person = play_one(SEED + number)
        acts += person.acts
        right += not person.mishaps
        counted.update({mishap.what for mishap in person.mishaps})
        for mishap in person.mishaps:
            progress(f"game {SEED + number}: {mishap.what} after {mishap.act}: {mishap.story}")
        progress(f"{number + 1} of {games} games, {right} went right")
    if not acts:
        raise UserError("in no game anything was done")
    rows = {
        "right": row([right / games], "1", 0.98, "least", n=games),
        "wrong": row([counted["wrong"] + counted["unnoticed"]], "games", 0.0, "max", n=games),
        "stuck": row([counted["stuck"]], "games", 0.0, "max", n=games),
        "failed": row([counted["failed"]], "games", n=games),
        "asked": row([counted["asked"]], "games", n=games),
        "acts": row([acts.total()], "1"),
    }
    return BenchReport.of("people", SEED, rows)


def knocks_bench(quick: bool, progress: Progress) -> BenchReport:
    """Knock pieces over, any of them in any direction, in random middle games, until it was done so often.

    Raises:
        UserError: a game could not be played.
    """
    done, flawed, games, counted = 0, 0, 0, Counter[str]()
    while done < KNOCKS[quick]:
        person = play_one(KNOCKS_SEED + games, {Act.KNOCK: 1.0})
        for mishap in person.mishaps:
            progress(f"game {KNOCKS_SEED + games}: {mishap.what}: {mishap.story}")
        if not person.acts:
            raise UserError(f"in game {KNOCKS_SEED + games} nothing was done: see what was said")
        games += 1
        done += person.acts.total()
        flawed += len(person.flawed)
        counted.update({mishap.what for mishap in person.mishaps})
        progress(f"{done} knocks in {games} games, {done - flawed} put right unaided")
    rows = {
        "unaided": row([1.0 - flawed / done], "1", 0.98, "least", n=done),
        "taken_for_a_move": row([counted["wrong"]], "games", 0.0, "max", n=games),
        "unnoticed": row([counted["unnoticed"]], "games", 0.0, "max", n=games),
        "knocks": row([done], "1"),
    }
    return BenchReport.of("knocks", KNOCKS_SEED, rows)
