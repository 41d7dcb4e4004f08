"""Asking for a hand where the arm cannot help itself."""

from __future__ import annotations

from typing import Final

from app import UserError
from app.players.person import Lines
from app.terminal.interface import Face

POLL: Final = 0.2
"""How long is waited for words at a time [s, wall]."""


class NeedsHand(UserError):
    """Something has to be put right by hand, and nobody is there to do it."""

    def __init__(self, sentence: str) -> None:
        super().__init__(f"{sentence}: put it right by hand, then go on with 'touchmove resume'")


class UnattendedAsker:
    """``Asker`` where nobody is there."""

    def mend(self, sentence: str, squares: tuple[str, ...]) -> None:
        """Nobody can be asked.

        Raises:
            NeedsHand: always.
        """
        raise NeedsHand(sentence)


class PersonAsker:
    """``Asker`` of the person who plays."""

    def __init__(self, lines: Lines, face: Face) -> None:
        self._lines, self._face = lines, face

    def mend(self, sentence: str, squares: tuple[str, ...]) -> None:
        """See ``Asker.mend``."""
        self._face.say(f"{sentence}. Put it right and say 'done'")
        self._face.prompt("done?")
        while True:
            line = self._lines.next(POLL)
            if line is None:
                continue
            if line.strip().lower() in ("done", "ok", "yes", "y", "go"):
                return
            self._face.say(f"'{line.strip()}' is no answer: put it right and say 'done', or leave with Ctrl-C")
            self._face.prompt("done?")
