"""How a game has ended."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from app.players.typed_commands import NewGame

Result = Literal["1-0", "0-1", "1/2-1/2", "*"]


def plies_in_words(count: int) -> str:
    """How many half-moves, in words."""
    return "1 ply" if count == 1 else f"{count} plies"


@dataclass(frozen=True, slots=True)
class GameEnd:
    """Why the loop ended: PGN result, phrase, whether all that was asked was done, whether another game is wanted, like
    what, and whether that begins with what stands on the board.
    """

    result: Result
    reason: str
    complete: bool
    again: bool = False
    kept: bool = False
    wish: NewGame | None = None
