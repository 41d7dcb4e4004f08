"""Who says something about a person's move once it is made: a coach, a puzzle, a repertoire."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, auto
from typing import Protocol

import chess


class TakingBack(Enum):
    """Whether a move is taken back."""

    NO = auto()
    OFFERED = auto()
    """If the person agrees."""
    NEEDED = auto()
    """In any case: the arm puts the pieces back."""


@dataclass(frozen=True, slots=True)
class Advice:
    """What is said, in one sentence without a full stop, and what becomes of the move."""

    sentence: str
    taking_back: TakingBack = TakingBack.NO


class Adviser(Protocol):
    """Judges a person's moves."""

    def judge(self, board: chess.Board, move: chess.Move) -> Advice | None:
        """What there is to say of a legal move in a position with its history, which is left as it is; None: nothing.

        Raises:
            EngineProblem: an engine that is asked fails.
        """


class Advisers:
    """Several as one: the first that has something to say."""

    def __init__(self, advisers: Sequence[Adviser]) -> None:
        self._advisers = tuple(advisers)

    def judge(self, board: chess.Board, move: chess.Move) -> Advice | None:
        """See ``Adviser``."""
        return next((said for one in self._advisers if (said := one.judge(board, move)) is not None), None)
