"""The clock of a game against somebody elsewhere: theirs counts, and is shown here as any game's."""

from __future__ import annotations

import time
from collections.abc import Callable

import chess
import chess.engine

from app.game.clock import HORIZON, LEAST_SHARE, OVERHEAD
from app.game.timing import Timing
from app.players.remote import RemoteOpponent
from app.terminal.shown import ClockShown


class RemoteTiming(Timing):
    """``Timing`` that starts and stops nothing here, and lets no flag fall: who keeps the clock says so.

    Args:
        opponent: knows the clock that counts.
        plant_time: of the rig [s].
        wall_time: monotonic [s].
        show: told whenever the clock was heard of.
    """

    def __init__(
        self, opponent: RemoteOpponent, plant_time: Callable[[], float],
        wall_time: Callable[[], float] = time.monotonic, show: Callable[[ClockShown | None], None] = lambda _: None,
    ) -> None:  # fmt: skip
        super().__init__(None, plant_time, wall_time, show)
        self._opponent, self._wall, self._tell = opponent, wall_time, show

    def show(self) -> None:
        """See ``Timing.show``."""
        left, clock = self.left(), self._opponent.clock()
        self._tell(None if left is None or clock is None else ClockShown(left, clock.running))

    def left(self) -> dict[chess.Color, float] | None:
        """See ``Timing.left``."""
        clock = self._opponent.clock()
        if clock is None:
            return None
        now = self._wall()
        return {colour: clock.left(colour, now) for colour in chess.COLORS}

    def limit(self, colour: chess.Color) -> chess.engine.Limit | None:
        """See ``Timing.limit``: the arm makes the opponent's next moves while the clock of this side runs."""
        clock, left = self._opponent.clock(), self.left()
        if clock is None or left is None:
            return None
        lost = clock.latency + OVERHEAD
        net = clock.increment - self._motion - lost
        told = left[colour] - lost + min(0.0, net) * (HORIZON - 1)
        clocks = {colour: max(told, LEAST_SHARE * left[colour]), not colour: left[not colour]}
        return chess.engine.Limit(
            white_clock=max(0.001, clocks[chess.WHITE]), black_clock=max(0.001, clocks[chess.BLACK]),
            white_inc=max(0.0, net) if colour else clock.increment,
            black_inc=clock.increment if colour else max(0.0, net),
        )  # fmt: skip
