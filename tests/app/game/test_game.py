"""The game loop where an engine fails and is started again: what that took is not the engine's."""

from __future__ import annotations

from collections.abc import Callable

import chess
import chess.engine
import pytest

from app.execution.state import Remark
from app.game.clock import ChessClock
from app.game.game import Game
from app.game.timing import Timing
from app.players.decision import Decision
from app.settings.time_control import TimeControl
from app.terminal.game_display import UserInterface


class Wall:
    """Time that a test moves on [s]."""

    def __init__(self) -> None:
        self.time = 0.0

    def __call__(self) -> float:
        return self.time


class QuickTable:
    """Whatever is to be moved stands there at once."""

    def __init__(self) -> None:
        self.board = chess.Board()
        self.clocks: list[dict[chess.Color, float] | None] = []

    def begin(self, by_hand: frozenset[chess.Color]) -> bool:
        return True

    def subscribe(self, think_ahead: Callable[[str], None]) -> None:
        """Nobody thinks ahead."""

    def arm_ply(self, move: chess.Move, remark: Remark, answers: bool) -> bool:
        self.board.push(move)
        self.clocks.append(remark.clocks())
        return True


class Hanging:
    """Players whose engine hangs, is started again, and thinks for 0.3 s."""

    def __init__(self, wall: Wall, lost: float) -> None:
        self._wall, self._lost = wall, lost

    def name(self, colour: chess.Color) -> str:
        return "Engine"

    def adjudicated(self, board: chess.Board) -> None:
        """Nothing is known of the end."""

    def choose(self, board: chess.Board, clock: chess.engine.Limit | None) -> Decision:
        self._wall.time += self._lost + 0.3
        return Decision(next(iter(board.legal_moves)), lost=self._lost, troubles=("it gave no answer within 4 s",))


@pytest.mark.parametrize("lost", [0.0, 4.1])
def test_no_flag_falls_by_time_that_is_given_back(lost: float) -> None:
    wall, table = Wall(), QuickTable()
    timing = Timing(ChessClock.new(TimeControl.parse("0:04")), lambda: 0.0, wall)
    end = Game(table, Hanging(wall, lost), UserInterface(), timing=timing).play(2)  # type: ignore[arg-type]
    assert (end.result, end.reason) == ("*", "2 plies played")
    white, black = chess.WHITE, chess.BLACK
    assert table.clocks == [pytest.approx({white: 3.7, black: 4.0}), pytest.approx({white: 3.7, black: 3.7})]
