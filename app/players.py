"""Who chooses the moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import chess
import chess.engine

from engine.stockfish import Engine


@dataclass(frozen=True, slots=True)
class Decision:
    """A player's answer: a move, or None when it has no more; the score where there is one."""

    move: chess.Move | None
    score: chess.engine.PovScore | None = None


class Player(Protocol):
    """Chooses moves for one side."""

    @property
    def name(self) -> str:
        """For the record."""

    def choose(self, board: chess.Board) -> Decision:
        """The move in this position; the board is not changed."""


class EnginePlayer:
    """A UCI engine."""

    def __init__(self, engine: Engine, name: str) -> None:
        self._engine = engine
        self._name = name

    @property
    def name(self) -> str:
        """For the record."""
        return self._name

    def choose(self, board: chess.Board) -> Decision:
        """Ask the engine, within its deadline."""
        answer = self._engine.choose(board)
        return Decision(answer.move, answer.score)


class LinePlayer:
    """Follows a given line; afterwards another player goes on, or nobody."""

    def __init__(self, start: chess.Board, line: Sequence[chess.Move], then: Player | None = None, name: str = "line"):
        self._first_ply = start.ply()
        self._line = tuple(line)
        self._then = then
        self._name = then.name if then is not None else name

    @property
    def name(self) -> str:
        """For the record."""
        return self._name

    def choose(self, board: chess.Board) -> Decision:
        """The line's move at this ply."""
        index = board.ply() - self._first_ply
        if index < len(self._line):
            return Decision(self._line[index])
        return self._then.choose(board) if self._then is not None else Decision(None)
