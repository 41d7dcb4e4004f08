"""Questions in a person's turn: what the pawn has become, whether that was the move, whether to go on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import chess

from app.game.clock import side_name
from app.game.person import ask
from app.players.person import Human
from app.players.typed_commands import Command, CommandError, parse_command
from app.terminal.game_display import UserInterface

_PROMOTIONS: Final = {"q": chess.QUEEN, "r": chess.ROOK, "b": chess.BISHOP, "n": chess.KNIGHT}


class Interjected(Exception):
    """The person gave a command where they were asked a question."""

    def __init__(self, command: Command) -> None:
        super().__init__(command)
        self.command = command


class TurnQuestions:
    """Asks the person whose turn it is; ``Interjected`` is raised where they would rather do something else."""

    def __init__(self, human: Human, ui: UserInterface) -> None:
        self._human, self._ui = human, ui

    def promotion(self, board: chess.Board) -> chess.PieceType:
        """What a pawn has become, as the camera could not tell."""
        return _PROMOTIONS[self.answer("what has the pawn become? q, r, b or n", tuple(_PROMOTIONS), board)]

    def yes(self, question: str, board: chess.Board, squares: Sequence[str]) -> bool:
        """Whether it is so; the squares are lit."""
        return self.answer(f"{question} (yes or no)", ("yes", "no", "y", "n"), board, squares).startswith("y")

    def agrees(self, board: chess.Board) -> bool:
        """Whether the other one of two people takes the draw that the side to move offers."""
        return self.yes(f"{side_name(board.turn)} offers a draw: does {side_name(not board.turn)} agree?", board, ())

    def answer(self, question: str, valid: tuple[str, ...], board: chess.Board, squares: Sequence[str] = ()) -> str:
        """One of these words; any other command on this board is done instead of what the question was about."""

        def other(line: str) -> bool:
            try:
                raise Interjected(parse_command(line, board))
            except CommandError:
                return False

        return ask(self._human, self._ui, question, valid, other, squares=squares)
