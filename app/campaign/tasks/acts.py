"""What a scripted person does at the board in their turns, and how often."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from types import MappingProxyType
from typing import Final


class Act(StrEnum):
    """What a person does in one of their turns."""

    MOVE = "a legal move"
    ILLEGAL = "an illegal move"
    KNOCK = "a knock"
    TWO = "two illegal moves"
    SWAP = "an exchange"
    HALF = "half on a square"
    UNDONE = "a move made and undone"
    TAKE_BACK = "a take-back"


OFTEN: Final[Mapping[Act, float]] = MappingProxyType({
    Act.MOVE: 0.28, Act.ILLEGAL: 0.24, Act.KNOCK: 0.18, Act.TWO: 0.07, Act.SWAP: 0.06, Act.HALF: 0.05,
    Act.UNDONE: 0.05, Act.TAKE_BACK: 0.07,
})  # fmt: skip
"""Of a hundred acts, what share is which."""
LEGAL: Final = (Act.MOVE, Act.UNDONE, Act.TAKE_BACK)
"""Acts after which nothing has to be put right."""
