"""The game loop: whoever is to move moves, by the arm or by hand, until the game is over."""

from __future__ import annotations

import time
from collections.abc import Callable

import chess

from app import UserError
from app.faces import Face
from app.game.human import Human
from app.game.human_turn import HumanTurn
from app.game.state import WRONG, GameEnd
from app.game.table import Remark, Table
from app.players import Players
from app.records.events import Result
from app.recovery import FELT


class Game:
    """One game at one table.

    Args:
        table: where it is played.
        players: who choose the moves that the arm makes.
        face: shown what happens.
        human: who plays one side by hand; None: the arm makes all moves.
    """

    def __init__(self, table: Table, players: Players, face: Face, human: Human | None = None) -> None:
        self._table, self._players, self._face = table, players, face
        self._human = None if human is None else HumanTurn(human, table, players, face)
        self._most = 0
        self.thinking = 0.0
        """Wall time that the arm rested because a player thought [s]."""

    def play(self, plies: int) -> GameEnd:
        """Play until the game is over, a player has no more moves, or so many plies are done.

        A ply that fails physically ends the game; what went wrong is in the record.
        """
        board = self._table.board
        self._face.position(board)
        self._most = plies
        if not self._table.finish():
            return WRONG
        while True:
            end = self._over(plies)
            end = end or self._turn()
            if end is not None:
                return end

    def _over(self, plies: int) -> GameEnd | None:
        board = self._table.board
        outcome = board.outcome(claim_draw=self._human is None)
        if outcome is not None:
            return GameEnd(result_of(outcome), outcome.termination.name.lower().replace("_", " "), True)
        if len(board.move_stack) >= plies:
            return GameEnd("*", f"{plies} plies played", True)
        return None

    def _turn(self) -> GameEnd | None:
        """One ply, or something else in its place."""
        if self._human is not None and self._human.plays(self._table.board.turn):
            return self._human.take()
        move = self._choose()
        if move is None:
            return GameEnd("*", "end of the given line", True)
        return None if self._table.arm_ply(move[0], self._thinking_ahead(move[0]), move[1]) else WRONG

    def _choose(self) -> tuple[chess.Move, Remark] | None:
        board = self._table.board
        self._face.phase(f"{'White' if board.turn else 'Black'} thinks ({self._players.name(board.turn)})")
        since = time.perf_counter()
        decision = self._players.choose(board)
        self.thinking += time.perf_counter() - since
        return None if decision.move is None else (decision.move, Remark(decision.score))

    def _thinking_ahead(self, move: chess.Move) -> Callable[[], None]:
        """While the arm lets go of the last piece and goes home, the next player thinks already."""

        def begin() -> None:
            board = self._table.board.copy()
            board.push(move)
            by_hand = self._human is not None and self._human.plays(board.turn)
            if not by_hand and len(board.move_stack) < self._most and board.outcome(claim_draw=True) is None:
                self._players.begin(board)

        return begin


def require_empty_fingers(felt: float) -> None:
    """Before a game begins.

    Args:
        felt: by both pads [N].

    Raises:
        UserError: something is between them.
    """
    if felt >= FELT:
        raise UserError(
            "something is between the fingers: take it out by hand, or go on with its game by 'touchmove resume'"
        )


def result_of(outcome: chess.Outcome) -> Result:
    """In PGN's words."""
    if outcome.winner is None:
        return "1/2-1/2"
    return "1-0" if outcome.winner else "0-1"
