"""Who chooses the moves."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
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


class Players:
    """Both sides. They are asked in a thread of its own, so that one can think while the arm still moves.

    A context manager: at its end nobody is waited for, and closing an engine ends what it thinks about.

    Args:
        white: player.
        black: player.
        ahead: whether anybody thinks ahead at all. Where plant time waits for a thought, as in pace fast, it would
            only slow the simulation down.
    """

    def __init__(self, white: Player, black: Player, *, ahead: bool = True) -> None:
        self._thinks_ahead = ahead
        self._players = {chess.WHITE: white, chess.BLACK: black}
        self._pool = ThreadPoolExecutor(1, "thinking")
        self._ahead: tuple[chess.Board, Future[Decision]] | None = None

    def __enter__(self) -> Players:
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.shutdown(wait=False, cancel_futures=True)

    def name(self, colour: chess.Color) -> str:
        """Of the player of a colour, for the record."""
        return self._players[colour].name

    def begin(self, board: chess.Board) -> None:
        """Let the side to move think about a position that will be on the board; asked twice, it goes on."""
        if self._thinks_ahead:
            self._ask(board)

    def hint(self, board: chess.Board) -> chess.Move | None:
        """What the player of the side to move would play.

        Raises:
            EngineProblem: as the player.
        """
        return self._players[board.turn].choose(board).move

    def _ask(self, board: chess.Board) -> None:
        if self._ahead is None or not _same(self._ahead[0], board):
            position = board.copy()
            self._ahead = position, self._pool.submit(self._players[board.turn].choose, position)

    def choose(self, board: chess.Board) -> Decision:
        """The move, as soon as the side to move knows it; what was thought about another position is dropped.

        Raises:
            EngineProblem: as the player.
        """
        self._ask(board)
        assert self._ahead is not None
        _, decision = self._ahead
        self._ahead = None
        return decision.result()


def _same(one: chess.Board, other: chess.Board) -> bool:
    """The same position with the same history."""
    return one == other and one.move_stack == other.move_stack
