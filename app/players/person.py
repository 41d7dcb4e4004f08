"""A person who plays: what they say, and how their pieces are moved."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import chess

from app import UserError
from app.pieces.inventory import Inventory, Ply
from app.players.advice import Adviser
from app.players.typed_commands import MoveHand, NewGame


class PersonGone(UserError):
    """Nobody types any more; ``remedy``: what could have been done about it."""

    def __init__(self, remedy: str | None = None) -> None:
        super().__init__("there is no input at the terminal any more" + ("" if remedy is None else f": {remedy}"))


class Lines(Protocol):
    """Where a person's words come from."""

    def next(self, timeout: float) -> str | None:
        """The next line; None: none came within the timeout [s, wall].

        Raises:
            PersonGone: no more will come.
        """

    def forget(self, word: str) -> None:
        """A word that was said, and was not taken yet, does not count: it was said before what is asked now."""

    @property
    def accompanied(self) -> bool:
        """Whether somebody is there who goes on watching when a game is over, as at a page."""


class Hands(Protocol):
    """A person's hands, where somebody has to be told: those of a simulated world."""

    def play(self, ply: Ply, inventory: Inventory) -> None:
        """Make a move, before which the inventory says what stands where; returns when the hand is drawn back.

        Raises:
            HandRefused: it cannot be done; the sentence says why.
        """

    def do(self, command: MoveHand, inventory: Inventory) -> None:
        """Do something else; returns when the hand is drawn back. Raises as ``play``."""

    def withdraw(self) -> None:
        """Draw a hand back that could not do what it was told; nothing happens where it is back."""


@dataclass(frozen=True, slots=True)
class Human:
    """The person at the board.

    Attributes:
        colour: that they play at the start.
        lines: what they type.
        hands: theirs, in a simulated world; None: they move pieces by themselves, or there are no pieces to move.
        adviser: says something of each of their moves; None: nobody does.
        both: two people share the board: both sides are played by hand.
        require: raises a UserError or an EngineProblem where there cannot be such a game as they wish for.
        refusal: why what they have said cannot be had in this game, a sentence; None: it can.
    """

    colour: chess.Color
    lines: Lines
    hands: Hands | None
    require: Callable[[NewGame], None] = lambda _: None
    adviser: Adviser | None = None
    both: bool = False
    refusal: Callable[[str], str | None] = lambda _: None
