"""What is said of a person's move once it is made, and how it is taken back."""

from __future__ import annotations

import chess

from app.execution.state import WRONG, GameEnd
from app.execution.table import Table
from app.game.person import ask
from app.game.timing import Timing
from app.players.advice import TakingBack
from app.players.person import Human
from app.terminal.interface import UserInterface


class Advising:
    """Lets a person's adviser speak; without one nothing happens."""

    def __init__(self, human: Human, table: Table, timing: Timing, ui: UserInterface) -> None:
        self._human, self._table, self._timing, self._ui = human, table, timing, ui

    def after(self, board: chess.Board, move: chess.Move) -> GameEnd | None:
        """A move was made in a position: whatever there is to say; the end of the game if the arm fails.

        Raises:
            GameLeft: the person leaves, instead of an answer.
            EngineProblem: an engine that is asked fails.
        """
        adviser = self._human.adviser
        advice = None if adviser is None else adviser.judge(board, move)
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
