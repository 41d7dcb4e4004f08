"""Who watches engines play, and may interrupt them: at a page, or wherever lines come from."""

from __future__ import annotations

import chess

from app.game.person import PersonAttendant, end_of
from app.game.timing import Timing
from app.players.game_end import GameEnd
from app.players.person import Lines, PersonGone
from app.players.typed_commands import Word, word_of
from app.terminal.game_display import UserInterface

_LEAVES = (Word.QUIT, Word.NEW)
_HOW = "two engines play: say 'pause' and 'go', 'new' for another game, or 'quit'"


class Bystander:
    """Between two moves, heeds what was said since.

    Args:
        lines: what they say.
        ui: answers them.
        timing: the clocks, which a pause stops.
    """

    def __init__(self, lines: Lines, ui: UserInterface, timing: Timing) -> None:
        self._lines, self._ui, self._timing = lines, ui, timing

    def heed(self) -> GameEnd | None:
        """Do what was said; how the game ends, if that was asked for.

        Raises:
            GameLeft: it was, at a pause.
        """
        while (line := self._said()) is not None:
            word = word_of(line)
            if word is Word.PAUSE:
                self._timing.pause()
                PersonAttendant(self._lines, self._ui, _LEAVES).wait("the game is paused")
            elif word is not None and word in _LEAVES:
                return end_of(word, None, chess.WHITE)
            elif word is not Word.GO:
                self._ui.say(_HOW)
        return None

    def _said(self) -> str | None:
        try:
            return self._lines.next(0.0)
        except PersonGone:
            return None
