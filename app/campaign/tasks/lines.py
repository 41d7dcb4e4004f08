"""Random games and positions: the seed decides which."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import chess
import numpy as np

OPENING: Final = (0, 60)
"""A random position comes after so many random plies."""


def random_game(seed: int, plies: int) -> Iterator[chess.Move]:
    """Moves of a game that captures, castles and promotes more often than people do."""
    rng, board = np.random.default_rng([seed, 6]), chess.Board()
    for _ in range(plies):
        moves = [move for move in board.legal_moves if move.promotion in (None, chess.QUEEN)]
        if not moves or board.is_insufficient_material():
            return
        rare = [board.is_capture(move) or board.is_castling(move) or bool(move.promotion) for move in moves]
        weight = np.where(rare, 3.0, 1.0)
        move = moves[rng.choice(len(moves), p=weight / weight.sum())]
        board.push(move)
        yield move


def random_position(seed: int, plies: int | None = None) -> chess.Board:
    """White to move, and not in check; after so many random plies, if odd one more; None: the seed decides."""
    rng = np.random.default_rng([seed, 5])
    while True:
        board, game = chess.Board(), int(rng.integers(1 << 31))
        count = int(rng.integers(*OPENING)) if plies is None else plies + plies % 2
        for move in random_game(game, count):
            board.push(move)
        if board.turn is chess.WHITE and not board.is_check() and not board.is_game_over():
            return chess.Board(board.fen())
