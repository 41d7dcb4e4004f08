"""What a player is, and what it answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import chess
import chess.engine


@dataclass(frozen=True, slots=True)
class Decision:
    """A player's answer: a move, or None when it has no more; and what it said of it, where it said anything."""

    move: chess.Move | None
    score: chess.engine.PovScore | None = None
    pv: tuple[chess.Move, ...] = ()
    """How the player thinks the game goes on, from its move on."""
    ponder: chess.Move | None = None
    """Reply that it expects."""
    depth: int | None = None
    """Search depth [plies]."""
    thought: float = 0.0
    """Wall time from question to answer [s]; what was thought ahead is not in it."""
    lost: float = 0.0
    """Of that: what failures of the engine took, to be given back by the clock [s]."""
    troubles: tuple[str, ...] = ()
    """What went wrong on the way and was mended, a phrase each."""
    from_book: bool = False
    """The move is an opening book's."""
    resigns: bool = False
    """It gives up instead of making the move."""
    offers_draw: bool = False
    """It offers a draw with the move."""
    claims_draw: bool = False
    """It claims the draw that the rules grant before the move."""


class Player(Protocol):
    """Chooses moves for one side."""

    @property
    def name(self) -> str:
        """For the record."""

    def choose(self, board: chess.Board, clock: chess.engine.Limit | None = None) -> Decision:
        """The move in a position with its history; the board is not changed.

        ``clock`` is what the chess clock leaves (``ChessClock.limit``); None, or not given, where there is none.
        """


@runtime_checkable
class Thinker(Protocol):
    """A player that can also think while others move, be hurried and be asked."""

    def ponder(self, board: chess.Board, clock: chess.engine.Limit | None, *, certain: bool) -> None:
        """Begin to think, returning soon: about this position when it is certain to come with its side to move, else
        about the expected reply of the other side, which is to move.
        """

    def move_now(self) -> None:
        """End the search for a move; from any thread."""

    def hint(self, board: chess.Board) -> Decision:
        """What it would play at its best."""

    def accepts_draw(self, board: chess.Board) -> bool:
        """Whether it agrees to a draw in this position, whichever side is to move."""
