"""The game: the loop, the table it is played at, who plays, and what is done when something goes wrong."""

from __future__ import annotations

from app.execution.state import EXPECTED_FAILURES, WRONG, Devices, Position
from app.game.game import Game
from app.players.game_end import GameEnd

__all__ = ["EXPECTED_FAILURES", "WRONG", "Devices", "Game", "GameEnd", "Position"]
