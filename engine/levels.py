"""Playing strength below an engine's own lowest Elo.

A strong engine limited by ``UCI_Elo`` still plays like a club player: Stockfish 15.1 offers nothing below 1350. A
weaker player is made here from a very short search: every legal move gets a score, and one of them is drawn with
probability proportional to exp(score / temperature). At a low temperature the best move is nearly always drawn; at a
high one good and bad moves are drawn almost alike. The draw depends on seed and position alone, so that a game that is
resumed meets the same move.

The temperature of each Elo was measured in games against other levels and against Stockfish's own; docs/practice.md
has the method and the figures.
"""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import chess

from engine.answers import Candidate
from engine.draws_and_resigning import MATE

NODES: Final = 1000
"""Positions searched for a move: every legal move is seen once or twice, in some 15 ms."""
LINES: Final = 256
"""Moves that get a score: all of them; chess knows no position with more than 218."""
WORST: Final = 1500
"""A score beyond this counts as this much [centipawns]: what is lost anyway is not lost more."""
TEMPERATURES: Final = (
    (400, 254.0), (600, 167.0), (800, 110.0), (1000, 72.0), (1200, 45.0), (1400, 23.6), (1500, 17.0),
)  # fmt: skip
"""Elo and its temperature [centipawns]."""
WEAKEST: Final = TEMPERATURES[0][0]
"""The lowest Elo that can be asked for."""
STRONGEST: Final = TEMPERATURES[-1][0]
"""The highest Elo that is made this way; above it an engine must limit itself."""


def temperature_of(elo: int) -> float:
    """Of a level from ``WEAKEST`` to ``STRONGEST`` [centipawns], its logarithm interpolated between those measured."""
    for (low, warm), (high, cool) in pairwise(TEMPERATURES):
        if low <= elo <= high:
            share = (elo - low) / (high - low)
            return math.exp((1.0 - share) * math.log(warm) + share * math.log(cool))
    raise ValueError(f"Elo {elo} is outside {WEAKEST} to {STRONGEST}")


def drawn_move(candidates: Sequence[Candidate], temperature: float, draw: random.Random) -> Candidate:
    """One of the moves of a position (at least one), the likelier the better its score.

    ``temperature`` [centipawns]: a move that is worth this much less is drawn 2.7 times more rarely.
    """
    worth = [max(-WORST, min(WORST, one.score.relative.score(mate_score=MATE))) for one in candidates]
    weights = [math.exp((value - max(worth)) / temperature) for value in worth]
    return draw.choices(candidates, weights)[0]


def draw_of(seed: int, board: chess.Board) -> random.Random:
    """Randomness that depends on a seed and a position with its move number only."""
    return random.Random(f"{seed} {board.fen()}")
