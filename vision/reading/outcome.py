"""What a look at the board comes to, in words."""

from __future__ import annotations

from enum import StrEnum
from typing import Final

LOOKS: Final = 3  # so many looks before anybody is asked: noise differs from frame to frame


class ReadingOutcome(StrEnum):
    """What a look came to."""

    MOVE = "move"  # a move was made, or several where that was asked for
    NOTHING = "nothing"  # the position is as it was
    DOUBT = "doubt"  # nothing explains the look well enough


class Situation(StrEnum):
    """What is the matter."""

    NOTHING = "nothing"
    LEGAL = "legal"  # it looks like a legal move, but not clearly enough
    UNFINISHED = "unfinished"  # a legal move, half made: castling, en passant, a capture
    ILLEGAL = "illegal"  # a piece went where it must not
    WRONG_SIDE = "wrong side"  # a piece of the other side was moved
    TWO_MOVES = "two moves"
    TAKEN_BACK = "taken back"
    MISSING = "missing"
    EXTRA = "extra"
    RECOLOURED = "recoloured"  # a piece of the other colour stands where one stood
    WRONG_BOARD = "wrong board"
