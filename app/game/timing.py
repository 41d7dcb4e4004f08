"""The chess clock of a running game.

The game's time is the wall's, but for what the arm or a simulated hand does: that takes as long as plant time says,
however quick or slow the machine simulates it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import chess
import chess.engine

from app.game.clock import ChessClock, ClockMove
from app.players.game_end import GameEnd
from app.records import PlyEvent
from app.settings.time_control import ArmTime
from app.terminal.shown import ClockShown
from hardware.piece_set import Colour

EXPECTED_MOTION = 2.0
"""How long the arm will move for a ply, before it has moved [s]: what a mean ply takes."""


class Timing:
    """Clocks of one game, or none.

    Args:
        clock: as it stands when nobody's time runs; None: the game is played without.
        plant_time: of the rig [s].
        wall_time: monotonic [s].
        show: told whenever somebody's time begins or ceases to run.
    """

    def __init__(
        self, clock: ChessClock | None, plant_time: Callable[[], float],
        wall_time: Callable[[], float] = time.monotonic, show: Callable[[ClockShown | None], None] = lambda _: None,
    ) -> None:  # fmt: skip
        self._stands, self._plant_time, self._wall_time, self._show = clock, plant_time, wall_time, show
        self._shift = 0.0
        self._moving: tuple[float, float] | None = None
        self._motion = EXPECTED_MOTION

    @property
    def clock(self) -> ChessClock | None:
        """As it stands."""
        return self._stands

    @property
    def _clock(self) -> ChessClock | None:
        return self._stands

    @_clock.setter
    def _clock(self, clock: ChessClock | None) -> None:
        self._stands = clock
        self.show()

    def show(self) -> None:
        """Tell what the clocks show."""
        left, clock = self.left(), self._stands
        stands = clock is None or clock.since is None or (clock.is_decided and clock.arm_time is not ArmTime.OWN)
        running = None if clock is None or stands else clock.mover
        free = 0.0 if clock is None or running is None else clock.free(self.now())
        self._show(None if left is None else ClockShown(left, running, free))

    def now(self) -> float:
        """The game's time [s]."""
        if self._moving is not None:
            then, plant = self._moving
            return then + self._plant_time() - plant
        return self._wall_time() + self._shift

    def at(self, plant: float) -> float:
        """The game's time at an instant of plant time that is past [s]."""
        return self.now() - max(0.0, self._plant_time() - plant)

    def start(self, colour: chess.Color) -> None:
        """The side's time runs."""
        if self._clock is not None and self._clock.since is None:
            self._clock = self._clock.start(colour, self.now())

    def limit(self, colour: chess.Color) -> chess.engine.Limit | None:
        """What an engine that is to move is told."""
        return None if self._clock is None else self._clock.limit(colour, self.now(), self._motion)

    def give_back(self, lost: float) -> None:
        """What failures of its engine have taken of the move under way, the side gets back [s]."""
        if self._clock is not None and lost:
            self._clock = self._clock.give_back(lost, self.now())

    def decided(self) -> None:
        """The robot knows its move."""
        if self._clock is not None:
            self._clock = self._clock.decided(self.now())

    def arm_clear(self) -> None:
        """The robot's move stands on the board."""
        if self._clock is not None and self._clock.is_decided:
            self._clock = self._clock.arm_clear(self.now())

    def press(self, then: float | None = None) -> None:
        """A person's move was made, at an instant of the game's time; None: now."""
        if self._clock is not None and self._clock.mover is not None:
            self._clock = self._clock.press(self.now() if then is None else then)

    def pause(self) -> None:
        """Nobody's time runs."""
        if self._clock is not None:
            self._clock = self._clock.pause(self.now())

    def forget(self) -> None:
        """An engine has failed: its side gets back what it has used for the move under way, and nobody's time runs."""
        if self._clock is not None:
            now = self.now()
            self._clock = self._clock.give_back(math.inf, now).pause(now)

    def take_back(self, plies: int) -> None:
        """Both sides have what they had before so many plies, as far as they were played by this clock."""
        if self._clock is not None:
            self._clock = self._clock.take_back(min(plies, len(self._clock.moves)))

    def fallen(self, board: chess.Board, then: float | None = None) -> GameEnd | None:
        """How the game has ended by time, if it has, at an instant of the game's time; None: now."""
        fallen = None if self._clock is None else self._clock.fallen(board, self.now() if then is None else then)
        return None if fallen is None else GameEnd(fallen.result, fallen.reason, True)

    def left(self) -> dict[chess.Color, float] | None:
        """What both sides have [s]."""
        if self._clock is None:
            return None
        now = self.now()
        return {colour: max(0.0, self._clock.left(colour, now)) for colour in chess.COLORS}

    @contextmanager
    def motion(self, *, of_arm: bool = True) -> Iterator[None]:
        """What happens within takes as long as plant time says; the arm's next ply is expected to take as long."""
        since, plant = self.now(), self._plant_time()
        self._moving = since, plant
        try:
            yield
        finally:
            until, self._moving = self.now(), None
            self._shift = until - self._wall_time()
            if of_arm:
                self._motion = until - since


def clock_of(clock: ChessClock | None, plies: Sequence[PlyEvent]) -> ChessClock | None:
    """The clock of a game that goes on: as it was at the beginning, with the plies that were played and count."""
    if clock is None:
        return None
    left = {Colour.WHITE: clock.white_left, Colour.BLACK: clock.black_left}
    moves: list[ClockMove] = []
    for ply in plies:
        before = left[ply.side]
        after = before if ply.clock_s is None else ply.clock_s[ply.side]  # of a ply that was finished by resuming
        moves.append(
            ClockMove(
                white=ply.side is Colour.WHITE, before=before, thought=max(0.0, before - after), arm=0.0, after=after
            )
        )
        left[ply.side] = after
    return clock.model_copy(
        update={"moves": tuple(moves), "white_left": left[Colour.WHITE], "black_left": left[Colour.BLACK]}
    )
