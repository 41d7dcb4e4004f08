"""A chess clock as a value: every transition takes the game's time and gives a new clock; nothing here reads a clock.

A move goes through these instants::

    start(colour)   the side to move may think: the other's move stands on the board and the arm is clear
    press           a person's hand has left the board: the move is made, nobody's clock runs
    decided         the robot knows its move: its arm moves now, and by ``arm_time`` that costs nothing, or its own time
    arm_clear       the robot's move stands on the board

then ``start`` of the other side. ``pause`` interrupts at any instant at nobody's cost, and ``start`` goes on.
"""

from __future__ import annotations

from typing import Final, NamedTuple, Self

import chess
import chess.engine
from pydantic import FiniteFloat, NonNegativeFloat

from app.players.game_end import Result
from app.settings.time_control import ArmTime, Extra, TimeControl
from hardware.frozen import FrozenFinite

ARM_LEAVES: Final = 5.0
"""The arm's motion never takes the last of a side's time: this much, or what there was, is left [s]."""
OVERHEAD: Final = 0.05
"""From the engine's answer to the instant at which the game knows of it [s]; an engine is told so much less."""
HORIZON: Final = 30
"""Moves that the rest of a game is taken to last where the arm's motion must be paid out of the time left."""
LEAST_SHARE: Final = 0.1
"""An engine is told at least this share of what its side has, however much the arm will need."""


class ClockError(Exception):
    """A transition that makes no sense in this state: a bug in the caller."""


class ClockMove(FrozenFinite):
    """A move that was made: who made it, and what it did to the time of that side; all [s]."""

    white: bool
    before: float
    """Left when the move began."""
    thought: NonNegativeFloat
    """From the start of the clock to the decision, less pauses and what was given back; for a person, to the end of the
    move.
    """
    arm: NonNegativeFloat
    """The arm's motion that was paid for."""
    after: float
    """Left with all that the move adds: PGN's ``%clk``."""


class FlagFall(NamedTuple):
    """A side's time ran out: which, PGN's result, and a phrase."""

    colour: chess.Color
    result: Result
    reason: str


class ChessClock(FrozenFinite):
    """Both sides' time at one instant. Frozen, and JSON by pydantic, so that a resumed game goes on with it."""

    white: TimeControl
    black: TimeControl
    arm_time: ArmTime = ArmTime.NOBODY
    white_left: float
    """At the beginning of the side's present move [s]."""
    black_left: float
    moves: tuple[ClockMove, ...] = ()
    """Made so far, both sides' in order: one for each ply played by the clock."""
    mover: bool | None = None
    """Whose move is under way, as python-chess has colours; None between moves."""
    used: NonNegativeFloat = 0.0
    """Of that move, booked: the thought [s]."""
    arm: NonNegativeFloat = 0.0
    """Of that move, booked: the arm's motion [s]."""
    is_decided: bool = False
    """The move is known, and the arm moves."""
    since: FiniteFloat | None = None
    """Game time up to which all is booked [s]; None while nothing runs."""

    @classmethod
    def new(cls, white: TimeControl, black: TimeControl | None = None, arm_time: ArmTime = ArmTime.NOBODY) -> Self:
        """The clock before the game; ``black`` None: the same as White."""
        black = black or white
        white_left, black_left = white.periods[0].base, black.periods[0].base
        return cls(white=white, black=black, arm_time=arm_time, white_left=white_left, black_left=black_left)

    # ---------------------------------------------------------------------------------------------------- transitions

    def start(self, colour: chess.Color, now: float) -> Self:
        """The side's time runs from now on: its move begins, or goes on after a pause.

        Raises:
            ClockError: it runs already, or the other side's move is under way.
        """
        if self.since is not None or self.mover not in (None, colour):
            raise ClockError(
                f"{side_name(colour)} cannot start: {self._doing()}; press, clear the arm or take back first"
            )
        return self.model_copy(update={"mover": colour, "since": now})

    def at(self, now: float) -> Self:
        """The same clock with everything booked up to now, such as to be saved; time never goes back."""
        if self.since is None:
            return self
        passed, now = max(0.0, now - self.since), max(now, self.since)
        booked = {"arm": self.arm + passed} if self.is_decided else {"used": self.used + passed}
        return self.model_copy(update={"since": now, **booked})

    def pause(self, now: float) -> Self:
        """Nothing runs from now on, at nobody's cost; ``start`` of the same side goes on. Harmless when paused."""
        return self.at(now).model_copy(update={"since": None})

    def loaded(self) -> Self:
        """The clock of a program that is gone, to be started anew: what ran unsaved is at nobody's cost."""
        return self.model_copy(update={"since": None})

    def press(self, now: float) -> Self:
        """The move was made by hand, at this instant; nobody's clock runs. An instant before the start costs nothing.

        Raises:
            ClockError: no move is under way.
        """
        self._under_way("press")
        return self.at(now)._made()

    def decided(self, now: float) -> Self:
        """The robot's move is known: from now on its arm moves. Said again, nothing changes.

        Raises:
            ClockError: no move is under way.
        """
        self._under_way("decide")
        return self if self.is_decided else self.at(now).model_copy(update={"is_decided": True})

    def arm_clear(self, now: float) -> Self:
        """The robot's move stands on the board: the move is made; nobody's clock runs.

        Raises:
            ClockError: no move was decided.
        """
        if not self.is_decided:
            raise ClockError(f"the arm cannot have moved: {self._doing()}; decide first")
        return self.at(now)._made()

    def give_back(self, seconds: float, now: float) -> Self:
        """So much of the move under way was no thought, as a fault of the machine took it; at most all of it [s].

        Raises:
            ClockError: no move is under way.
        """
        self._under_way("be given time back")
        clock = self.at(now)
        # not added to what is left: it would count as thought for a delay and Bronstein's, and outlive a take-back
        return clock.model_copy(update={"used": max(0.0, clock.used - seconds)})

    def take_back(self, plies: int = 1) -> Self:
        """Undo the last moves, and the one under way: both sides have what they had before; nothing runs.

        Raises:
            ClockError: so many were not made.
        """
        if not 0 <= plies <= len(self.moves):
            raise ClockError(f"{plies} plies cannot be taken back: this clock has only {len(self.moves)}")
        kept, gone = self.moves[: len(self.moves) - plies], self.moves[len(self.moves) - plies :]
        left = {("white_left" if move.white else "black_left"): move.before for move in reversed(gone)}
        idle = {"mover": None, "used": 0.0, "arm": 0.0, "is_decided": False, "since": None}
        return self.model_copy(update={"moves": kept, **left, **idle})

    # ------------------------------------------------------------------------------------------------------ questions

    def left(self, colour: chess.Color, now: float | None = None) -> float:
        """What a side has at an instant of the game, below zero when its flag is down; None: as booked [s]."""
        base = self.white_left if colour else self.black_left
        if self.mover is None or self.mover != colour:
            return base
        clock = self if now is None else self.at(now)
        control = self.control(colour)
        free = control.extra if control.kind is Extra.DELAY else 0.0
        at_decision = base - max(0.0, clock.used - free)
        return _after_arm(at_decision, clock.arm if self.arm_time is ArmTime.OWN else 0.0)

    def free(self, now: float) -> float:
        """How long the time of the side that thinks still stands: what is left of a delay [s]."""
        if self.mover is None or self.is_decided:
            return 0.0
        control = self.control(self.mover)
        return max(0.0, control.extra - self.at(now).used) if control.kind is Extra.DELAY else 0.0

    def flag(self, now: float) -> chess.Color | None:
        """Whose flag is down at this instant; None: nobody's.

        A person's move is seen after it was made: ask for instants only up to which the board has been seen.
        """
        if self.mover is None or self.left(self.mover, now) > 0.0:
            return None
        return self.mover

    def fallen(self, board: chess.Board, now: float) -> FlagFall | None:
        """How the game ends by time, if a flag is down: lost, or drawn where the other side could not mate anyway."""
        colour = self.flag(now)
        if colour is None:
            return None
        reason = f"{side_name(colour)}'s time has run out"
        if board.has_insufficient_material(not colour):
            return FlagFall(colour, "1/2-1/2", f"{reason}, and {side_name(not colour)} has too little material to mate")
        return FlagFall(colour, "0-1" if colour == chess.WHITE else "1-0", reason)

    def limit(self, colour: chess.Color, now: float, arm: float = 0.0) -> chess.engine.Limit:
        """What to tell an engine that is to move, or will be: time, increment and moves to go of both sides.

        Args:
            colour: of the engine.
            now: game time [s].
            arm: how long its arm will move for one move, as expected [s]. Where its side pays for it, the engine is
                told what is left for thought.
        """
        other = self.left(not colour, now)
        own, extra = self._for_thought(colour, self.left(colour, now), arm)
        clocks, extras = {colour: own, not colour: other}, {colour: extra, not colour: self.control(not colour).extra}
        _, to_go = self.control(colour).period_of(self.made(colour))
        return chess.engine.Limit(
            white_clock=max(0.001, clocks[chess.WHITE]), black_clock=max(0.001, clocks[chess.BLACK]),
            white_inc=extras[chess.WHITE], black_inc=extras[chess.BLACK], remaining_moves=to_go,
        )  # fmt: skip

    def control(self, colour: chess.Color) -> TimeControl:
        """Of a side."""
        return self.white if colour else self.black

    def made(self, colour: chess.Color) -> int:
        """Moves that a side has made by this clock."""
        return sum(move.white == colour for move in self.moves)

    # ----------------------------------------------------------------------------------------------------------- parts

    def _made(self) -> Self:
        """Book the move under way as made."""
        colour, control = self._under_way("end the move"), self.control(self.mover is True)
        before, after = self.white_left if colour else self.black_left, self.left(colour)
        if control.kind is Extra.INCREMENT:
            after += control.extra
        elif control.kind is Extra.BRONSTEIN:
            after += min(control.extra, before - after)
        if (period := control.begins_period(self.made(colour) + 1)) is not None:
            after += period.base
        arm = self.arm if self.arm_time is ArmTime.OWN else 0.0
        move = ClockMove(white=colour, before=before, thought=self.used, arm=arm, after=after)
        idle = {"mover": None, "used": 0.0, "arm": 0.0, "is_decided": False, "since": None}
        left = {"white_left" if colour else "black_left": after}
        return self.model_copy(update={"moves": (*self.moves, move), **left, **idle})

    def _for_thought(self, colour: chess.Color, left: float, arm: float) -> tuple[float, float]:
        """Time and increment of a side less what its arm will take of them [s]."""
        control = self.control(colour)
        paid = arm if self.arm_time is ArmTime.OWN else 0.0
        net = control.extra - paid - OVERHEAD
        _, to_go = control.period_of(self.made(colour))
        ahead = min(HORIZON, to_go or HORIZON) - 1
        told = left - paid - OVERHEAD + min(0.0, net) * ahead
        return max(told, LEAST_SHARE * left), max(0.0, net)

    def _under_way(self, doing: str) -> chess.Color:
        if self.mover is None:
            raise ClockError(f"nobody can {doing}: {self._doing()}; start a side first")
        return self.mover

    def _doing(self) -> str:
        if self.mover is None:
            return "no move is under way"
        return f"{side_name(self.mover)}'s move is {'paused' if self.since is None else 'under way'}"


def _after_arm(left: float, arm: float) -> float:
    """What the arm's motion leaves of a side's time: no flag falls by it."""
    return max(left - arm, min(left, ARM_LEAVES))


def side_name(colour: chess.Color) -> str:
    """White or Black."""
    return "White" if colour else "Black"
