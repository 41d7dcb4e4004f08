"""What follows from what was understood: a line as if it had been typed, or first a question."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from app.players.typed_commands import Word
from app.voice.phrases import NO, YES
from app.voice.spoken_moves import ENGLISH

AT_ONCE: Final = frozenset({Word.LOOK, Word.HINT, Word.PAUSE})
"""Change nothing on the board and nothing in the game, so that a mishearing costs nothing."""
PATIENCE: Final = 10.0
"""A question is forgotten after this time [s, wall]: a later 'yes' is meant for somebody else."""


@dataclass(frozen=True, slots=True)
class Reply:
    """What to do.

    Attributes:
        line: is taken as if it had been typed; None: nothing yet.
        sentence: for the person; None: nothing is to be said.
        waiting: the line that a 'yes' is for from now on.
    """

    line: str | None = None
    sentence: str | None = None
    waiting: str | None = None


def reply(understood: str | None, waiting: str | None) -> Reply:
    """What follows of a line that was understood; None: what was said could be several.

    ``waiting`` is the line that was asked about: moves are, and what changes the game.

    Letters that rhyme are misheard now and then, and a move that the arm has answered costs more than one word.
    """
    if understood is None:
        return Reply(sentence="that could be two moves: say from which square")
    if understood in (YES, NO):
        if waiting is None:
            return Reply(understood)
        return Reply(waiting) if understood == YES else Reply(sentence="then say it again, or type it")
    if understood in AT_ONCE:
        return Reply(understood, waiting=waiting)
    said = understood if understood.isalpha() else ENGLISH.spoken(understood)
    return Reply(sentence=f"I heard '{said}': yes or no?", waiting=understood)
