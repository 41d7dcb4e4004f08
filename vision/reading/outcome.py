"""What a look at the board comes to, in words."""

from __future__ import annotations

from enum import StrEnum
from typing import Final

LOOKS: Final = 3
"""So many looks before anybody is asked: noise differs from frame to frame."""


class ReadingOutcome(StrEnum):
    """What a look came to."""

    MOVE = "move"
    """A move was made, or several where that was asked for."""
    NOTHING = "nothing"
    """The position is as it was."""
    DOUBT = "doubt"
    """Nothing explains the look well enough."""


class Situation(StrEnum):
    """What is the matter."""

    NOTHING = "nothing"
    LEGAL = "legal"
    """It looks like a legal move, but not clearly enough."""
    UNFINISHED = "unfinished"
    """A legal move, half made: castling, en passant, a capture."""
    ILLEGAL = "illegal"
    """A piece went where it must not."""
    WRONG_SIDE = "wrong side"
    """A piece of the other side was moved."""
    TWO_MOVES = "two moves"
    TAKEN_BACK = "taken back"
    MISSING = "missing"
    EXTRA = "extra"
    RECOLOURED = "recoloured"
    """A piece of the other colour stands where one stood."""
    WRONG_BOARD = "wrong board"
