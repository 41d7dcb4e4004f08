"""Whom to ask for a hand, and what came of putting the board right."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from app.pieces.inventory import Inventory


class Asker(Protocol):
    """A person who can put the board right by hand."""

    def mend(self, sentence: str, squares: tuple[str, ...], stands: Inventory) -> None:
        """Ask for it; returns when they say that it is done.

        Args:
            sentence: what has to be done.
            squares: where.
            stands: what should stand where now, as far as is known.

        Raises:
            UserError: nobody is there.
        """


@dataclass(frozen=True, slots=True)
class RecoveryResult:
    """What mending came to.

    Attributes:
        inventory: what stands where now.
        jobs: rounds in which something had to be moved, by the arm or by a person.
        duration: of what the arm did [s].
        answered: a person has made the next move already, or has begun to; the newest frame shows it.
    """

    inventory: Inventory
    jobs: int
    duration: float
    answered: bool = False
