"""Varied but sound openings, chosen by seed.

Any of the moves that a short full-strength search holds nearly as good as the best may be played. The engine for it
is one of its own: MultiPV, a cleared hash and full strength then never mix with the settings of a player.
"""

import random

import chess

from engine.draws_and_resigning import MATE
from engine.errors import EngineRefused
from engine.stockfish import Candidate, Engine, EngineSettings

OPENING_PLIES = 8
"""Of a game of two engines that come from the seed, of both sides together."""
LINES = 6
"""Moves considered at each ply."""
NODES = 20_000
"""Positions searched at each ply: some 30 ms."""
TABLE_MB = 16
"""Of every opening engine [MiB], so that a player's settings do not change the opening of a seed."""
WINDOW = 30
"""A move is sound when it loses at most this much against the best [centipawns]."""


def opening_engine(settings: EngineSettings) -> Engine:
    """An engine for openings, not yet open: the player's binary and deadlines, but full strength on one thread."""
    return Engine(
        EngineSettings(
            path=settings.path, hash_mb=TABLE_MB, deadline=settings.deadline, start_deadline=settings.start_deadline
        )
    )


def varied_opening(engine: Engine, board: chess.Board, plies: int, rng: random.Random) -> tuple[chess.Move, ...]:
    """An opening line that depends on position, seed and engine binary only; shorter than asked for where the game
    ends.

    ``engine`` is open, at full strength on one thread (see ``opening_engine``); the board is left as it is; ``plies``
    are of both sides together, and ``rng`` draws once for each. Raises ``EngineRefused`` if the engine is limited in
    strength or has several threads, and ``EngineFailed`` if it failed twice at one position.
    """
    if engine.settings.elo is not None or engine.settings.threads != 1:
        raise EngineRefused(
            f"an opening needs full strength and one thread, not Elo {engine.settings.elo} "
            f"and {engine.settings.threads} thread(s): take opening_engine(settings)"
        )
    board = board.copy()
    line: list[chess.Move] = []
    while len(line) < plies and not board.is_game_over():
        move = rng.choice(sound_moves(engine.candidates(board, LINES, NODES)))
        board.push(move)
        line.append(move)
    return tuple(line)


def sound_moves(candidates: tuple[Candidate, ...]) -> tuple[chess.Move, ...]:
    """Those of the candidates (best first) within the window of the best; a mate is only exchanged for another one."""
    worth = [candidate.score.relative.score(mate_score=MATE) for candidate in candidates]
    return tuple(c.move for c, value in zip(candidates, worth, strict=True) if value >= max(worth) - WINDOW)
