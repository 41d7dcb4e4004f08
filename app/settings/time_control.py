"""How much time a player has: periods, and what each move adds or does not cost. Read from ``5+3`` and the like."""

from __future__ import annotations

import re
from enum import StrEnum
from typing import Final, Self

from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt, model_validator

from app import UserError
from hardware.frozen import FrozenFinite


class Extra(StrEnum):
    """What the seconds that belong to each move do."""

    INCREMENT = "increment"
    """Added after the move (Fischer)."""
    DELAY = "delay"
    """The move's first seconds cost nothing (simple or US delay)."""
    BRONSTEIN = "bronstein"
    """What the move took of them is given back after it."""


class ArmTime(StrEnum):
    """Who pays for the motion of the arm."""

    NOBODY = "nobody"
    OWN = "own"
    """The side for which it moves."""


_SIGNS: Final = {"+": Extra.INCREMENT, "d": Extra.DELAY, "b": Extra.BRONSTEIN}

_PERIOD: Final = re.compile(
    r"(?:(?P<moves>\d{1,3})/)?"
    r"(?:(?:(?P<hours>\d{1,2}):)?(?P<whole>\d{1,3}):(?P<seconds>[0-5]?\d)|(?P<minutes>\d{1,3}(?:\.\d{1,3})?))"
    r"(?:(?P<sign>[+db])(?P<extra>\d{1,4}(?:\.\d{1,3})?))?"
)


class Period(FrozenFinite):
    """A number of moves and the time for them; without a number, the rest of the game."""

    base: PositiveFloat
    """Time [s]."""
    moves: PositiveInt | None = None


class TimeControl(FrozenFinite):
    """Of one player. The last period repeats when it has a number of moves."""

    periods: tuple[Period, ...] = Field(min_length=1)
    extra: NonNegativeFloat = 0.0
    """For each move [s]."""
    kind: Extra = Extra.INCREMENT

    @model_validator(mode="after")
    def _only_the_last_is_the_rest(self) -> Self:
        if any(period.moves is None for period in self.periods[:-1]):
            raise ValueError("each period except the last must state its number of moves, such as 40/90")
        return self

    @classmethod
    def parse(cls, text: str) -> TimeControl:
        """Read a time control.

        Args:
            text: minutes and increment in seconds, such as ``5+3``, ``90+30``, ``0.5+1`` or ``10``; ``0:30+1`` and
                ``1:30:00`` with seconds; ``5d3`` with simple delay, ``5b3`` with Bronstein's; ``40/90,30+30`` in
                periods, where what is said of each move may stand at any of them and holds for all.

        Raises:
            UserError: it is none of these; says how to write one.
        """
        matches = [_PERIOD.fullmatch(part) for part in re.sub(r"\s", "", text.lower()).split(",")]
        found = [match for match in matches if match is not None]
        extras = {(one["sign"], float(one["extra"])) for one in found if one["sign"]}
        if len(found) < len(matches) or len(extras) > 1:
            raise _no_time_control(text)
        sign, extra = next(iter(extras), ("+", 0.0))
        try:
            periods = tuple(
                Period(base=_seconds(one), moves=int(one["moves"]) if one["moves"] else None) for one in found
            )
            return cls(periods=periods, extra=extra, kind=_SIGNS[sign])
        except ValueError as error:  # no time at all, or no number of moves before the last period
            raise _no_time_control(text) from error

    def period_of(self, moves: int) -> tuple[Period, int | None]:
        """The period after so many moves, and how many moves are to go in it; None: it is the rest of the game."""
        for period in self.periods:
            if period.moves is None:
                return period, None
            if moves < period.moves:
                return period, period.moves - moves
            moves -= period.moves
        last = self.periods[-1]
        assert last.moves is not None, "else it was returned above"
        return last, last.moves - moves % last.moves

    def begins_period(self, moves: int) -> Period | None:
        """The period whose time is added when so many moves are done; None in the midst of one."""
        period, to_go = self.period_of(moves)
        if moves == 0 or (to_go is None and self.period_of(moves - 1)[1] is None):
            return None
        return period if to_go is None or to_go == period.moves else None

    def __str__(self) -> str:
        """As ``parse`` reads it."""
        periods = ",".join(("" if p.moves is None else f"{p.moves}/") + _minutes(p.base) for p in self.periods)
        sign = next(sign for sign, kind in _SIGNS.items() if kind is self.kind)
        return periods + (f"{sign}{self.extra:g}" if self.extra else "")

    @property
    def pgn(self) -> str:
        """The value of PGN's tag TimeControl, in seconds; it knows increments only, a delay is left out."""
        added = f"+{self.extra:g}" if self.extra and self.kind is Extra.INCREMENT else ""
        parts = [("" if p.moves is None else f"{p.moves}/") + f"{p.base:g}" + added for p in self.periods]
        return ":".join(parts)


def clock_text(seconds: float) -> str:
    """Time left as chess clocks show it: ``1:02:03``, ``4:05``, below 20 s with tenths ``0:09.4``; never below zero.

    It is rounded down, so that what is shown is there.
    """
    tenths = max(0, int(10.0 * seconds + 1e-6))
    whole = tenths // 10
    hours, minutes, rest = whole // 3600, whole // 60 % 60, whole % 60
    if hours:
        return f"{hours}:{minutes:02}:{rest:02}"
    return f"{minutes}:{rest:02}" + (f".{tenths % 10}" if whole < 20 else "")


def _seconds(one: re.Match[str]) -> float:
    if one["minutes"] is not None:
        return 60.0 * float(one["minutes"])
    return 3600.0 * int(one["hours"] or 0) + 60.0 * int(one["whole"]) + int(one["seconds"])


def _minutes(seconds: float) -> str:
    """As ``parse`` reads it: minutes, or with seconds where these would not come out even."""
    if seconds % 1.0:
        return f"{round(seconds / 60.0, 3):g}"
    minutes, rest = divmod(int(seconds), 60)
    if minutes > 999:
        return f"{minutes // 60}:{minutes % 60:02}:{rest:02}"
    return f"{minutes}:{rest:02}" if rest else f"{minutes}"


def _no_time_control(text: str) -> UserError:
    return UserError(
        f"'{text}' is not a time control: write minutes, at most 999, and seconds per move such as 5+3, 0:30+1, 5d3 "
        "(delay) or 40/90,30+30 (90 minutes for 40 moves, then 30)"
    )
