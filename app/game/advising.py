"""What is said of a person's move once it is made, and how it is taken back."""

from __future__ import annotations

from app.execution.state import WRONG
from app.execution.table import Table
from app.game.person import ask
from app.game.timing import Timing
from app.players.advice import TakingBack
from app.players.game_end import GameEnd
from app.players.person import Human
from app.terminal.game_display import UserInterface


class Advising:
    """Lets a person's adviser speak; without one nothing happens."""

    def __init__(self, human: Human, table: Table, timing: Timing, ui: UserInterface) -> None:
        self._human, self._table, self._timing, self._ui = human, table, timing, ui

    def after_move(self) -> GameEnd | None:
        """The person's move stands on the board: whatever there is to say; the end of the game if the arm fails.

        Raises:
            GameLeft: the person leaves, instead of an answer.
            EngineProblem: an engine that is asked fails.
        """
        if (adviser := self._human.adviser) is None:
            return None
        board = self._table.board.copy()
        move = board.pop()
        advice = adviser.judge(board, move)
        if advice is None:
            return None
        self._ui.say(advice.sentence)
        if advice.taking_back is TakingBack.NO or (advice.taking_back is TakingBack.OFFERED and not self._agrees()):
            return None
        self._timing.pause()
        with self._timing.motion():
            well = self._table.take_back(1)
        self._timing.take_back(1)  # not before: it may be refused
        self._timing.start(board.turn)
        return None if well else WRONG

    def _agrees(self) -> bool:
        self._timing.pause()
        question = "take the move back? (yes or no)"
        return ask(self._human, self._ui, question, ("yes", "no", "y", "n"), lambda _: False).startswith("y")
