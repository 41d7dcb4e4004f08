"""What is to be played: the terms of a seek or a challenge, and whether arm and server allow them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from app import UserError
from app.online.messages import Challenge
from app.settings.defaults import BOARD, OnlineUse, Settings
from app.settings.time_control import Extra, TimeControl, clock_text

MOVES: Final = 40
"""Of a side, in a game of usual length: Lichess tells speeds by as many."""
THOUGHT: Final = 1.0
"""The least that is left to think about a move [s]."""
ARM_SECONDS: Final = 2.0
"""Mean time of the arm for a ply, captures with the rest, from home to home (docs/results.md) [s]."""
HAND_SECONDS: Final = 2.0
"""A person's own hand and the look at it [s]."""
RAPID: Final = 8 * 60.0
"""Estimated duration of a side's game, from which on people may be sought by the Board API [s]."""
BLITZ: Final = 3 * 60.0
"""The same, from which on the Board API lets people play at all [s]."""
_LIMITS: Final = frozenset({15, 30, 45, 90, *range(60, 10_801, 60)})
"""Initial times that Lichess has [s]."""
_MOST_INCREMENT: Final = 60


@dataclass(frozen=True, slots=True)
class Terms:
    """What is played.

    Attributes:
        limit: initial time of each side [s]; None: by correspondence.
        increment: for each move [s].
        days: per move, by correspondence.
        rated: for rating points.
        colour: to ask for, in the server's words.
    """

    limit: int | None
    increment: int
    days: int | None
    rated: bool
    colour: str = "random"

    @property
    def estimate(self) -> float:
        """How long a side's game lasts, as Lichess tells speeds by [s]."""
        return float("inf") if self.limit is None else self.limit + MOVES * self.increment

    def for_challenge(self) -> dict[str, str]:
        """Fields of a challenge."""
        if self.limit is None:
            clock = {} if self.days is None else {"days": str(self.days)}
        else:
            clock = {"clock.limit": str(self.limit), "clock.increment": str(self.increment)}
        return {**clock, "rated": _yes(self.rated), "color": self.colour, "variant": "standard"}

    def for_seek(self) -> dict[str, str]:
        """Fields of a seek."""
        if self.limit is None:
            return {"days": str(self.days), "rated": _yes(self.rated), "variant": "standard"}
        clock = {"time": f"{self.limit / 60:g}", "increment": str(self.increment)}
        return {**clock, "rated": _yes(self.rated), "color": self.colour, "variant": "standard"}

    def __str__(self) -> str:
        if self.limit is None:
            time = "no clock" if self.days is None else f"{self.days} {'day' if self.days == 1 else 'days'} per move"
        else:
            time = f"{self.limit / 60:g}+{self.increment}"
        return f"{time}, {'rated' if self.rated else 'casual'}"


@dataclass(frozen=True, slots=True)
class TablePace:
    """How quickly this table plays.

    Attributes:
        arm: mean time of the arm for a ply [s].
        person: whether a person plays here, else an engine.
        latency: of the link, there and back [s].
    """

    arm: float
    person: bool
    latency: float = 0.0

    @property
    def per_move(self) -> float:
        """What each move costs of this side's own time, thinking left out [s].

        The arm makes their move while our clock runs, and before that it may still be busy with ours; a person makes
        the own move by hand instead.
        """
        return self.arm + (HAND_SECONDS if self.person and self.arm else self.arm) + self.latency

    def keeps(self, terms: Terms) -> bool:
        """Whether a game of usual length leaves time to think."""
        return terms.estimate >= MOVES * (self.per_move + THOUGHT * (self.arm > 0.0))

    def sentence(self, terms: Terms) -> str:
        """Why it does not, or what is left."""
        needs = MOVES * self.per_move
        return (
            f"{terms} gives each side {clock_text(terms.estimate)} for {MOVES} moves, of which the table needs "
            f"{clock_text(needs)}: {self.per_move:.1f} s a move for arm"
            f"{', hand' if self.person and self.arm else ''} and link"
        )


def terms_of(settings: Settings) -> Terms:
    """What the settings ask for.

    Raises:
        UserError: Lichess has no such games, or not for this use.
    """
    online, clock = settings.online, settings.clock.time
    colour = "random" if online.color is None else str(online.color)
    if online.days is not None:
        if clock is not None:
            raise UserError("--days is for correspondence, --clock for games at the board: leave one of them out")
        return Terms(None, 0, online.days, online.rated, colour)
    control = TimeControl.parse(clock or "15+10")
    limit, extra = control.periods[0].base, control.extra
    plain = len(control.periods) == 1 and control.periods[0].moves is None and control.kind is Extra.INCREMENT
    if not plain or limit not in _LIMITS or extra != int(extra) or extra > _MOST_INCREMENT:
        raise UserError(
            f"--clock is '{clock}', and Lichess has whole minutes up to 180 (or 0:15, 0:30, 0:45, 1:30) and whole "
            f"seconds up to {_MOST_INCREMENT} per move: write for instance 15+10"
        )
    terms = Terms(int(limit), int(extra), None, online.rated, colour)
    if online.use is OnlineUse.PERSON:
        _require_allowed(terms, named=online.opponent is not None or online.accept)
    return terms


def _require_allowed(terms: Terms, *, named: bool) -> None:
    """The Board API is for rapid, classical and correspondence; blitz by a challenge alone."""
    if terms.estimate < BLITZ:
        raise UserError(
            f"Lichess allows no game as fast as {terms} on a physical board: at least 3 minutes for {MOVES} moves"
        )
    if terms.estimate < RAPID and not named:
        raise UserError(
            f"{terms} is blitz, and Lichess pairs physical boards from rapid on (8 minutes for {MOVES} moves): "
            "challenge somebody with --opponent, or take more time"
        )


def pace_of(settings: Settings, latency: float) -> TablePace:
    """How quickly this table plays, by its rig and settings."""
    usual = 0.0 if settings.rig.name == BOARD else ARM_SECONDS
    arm = usual if settings.online.arm_seconds is None else settings.online.arm_seconds
    return TablePace(arm, settings.online.use is OnlineUse.PERSON, latency)


def require_kept(terms: Terms, pace: TablePace) -> None:
    """Refuse what the arm cannot keep.

    Raises:
        UserError: it says the figures.
    """
    if not pace.keeps(terms):
        raise UserError(f"{pace.sentence(terms)}; choose a longer --clock")


def of_challenge(challenge: Challenge) -> Terms:
    """What somebody else has proposed."""
    control = challenge.time_control
    if control.type == "clock" and control.limit is not None:
        return Terms(control.limit, control.increment or 0, None, challenge.rated)
    return Terms(None, 0, control.days, challenge.rated)


def _yes(value: bool) -> str:
    return "true" if value else "false"
