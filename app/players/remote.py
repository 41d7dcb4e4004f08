"""An opponent who sits somewhere else, behind a server or at another robot: what is told to them, and what they tell.

The pieces of both sides are moved on the table here: by the arm, or by a person. What the opponent does arrives as
events, in order, each once, whatever became of the connection meanwhile; they are asked for and never call back.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final, Protocol

import chess

from app.players.game_end import GameEnd

ABORTABLE: Final = 2
"""A game may be aborted while it has fewer plies: until both sides have moved."""


@dataclass(frozen=True, slots=True)
class RemoteMove:
    """They have moved; or the game has a move of ours that was never made on the table here.

    Attributes:
        ply: its number from the game's first one, from 0; so that none is made twice, or left out.
        move: legal in the position before it.
    """

    ply: int
    move: chess.Move


class Offer(StrEnum):
    """What one side may propose, and the other accept or decline."""

    DRAW = "draw"
    TAKE_BACK = "take back"
    REMATCH = "rematch"


@dataclass(frozen=True, slots=True)
class Offered:
    """They propose something; it stands until it is answered, or they withdraw it."""

    what: Offer
    plies: int = 0
    """For a take-back: so many plies."""


@dataclass(frozen=True, slots=True)
class OfferAnswered:
    """They have answered what was proposed to them, or withdrawn what they had proposed."""

    what: Offer
    accepted: bool
    withdrawn: bool = False
    """It was theirs, and stands no more."""


@dataclass(frozen=True, slots=True)
class TakenBack:
    """The game stands after so many plies now: by agreement."""

    plies: int


@dataclass(frozen=True, slots=True)
class GameOver:
    """The game is over, or goes no further, for whichever reason; it is also said where the rules have ended it.

    Attributes:
        end: how.
        plies: the game has so many: what stands here beyond them came too late, and is taken back; None: as many as
            stand here.
    """

    end: GameEnd
    plies: int | None = None


@dataclass(frozen=True, slots=True)
class Notice:
    """Something that people should know: the connection is lost or back, the opponent is gone or back."""

    sentence: str


RemoteEvent = RemoteMove | Offered | OfferAnswered | TakenBack | GameOver | Notice


@dataclass(frozen=True, slots=True)
class OpponentClock:
    """The clock that counts, as far as it is known here.

    Attributes:
        white_left: at the instant ``at`` [s].
        black_left: the same [s].
        running: whose time runs; None: nobody's.
        at: monotonic wall time [s].
        increment: added to a side's time with each of its moves [s].
        latency: until a move is known where the clock is kept [s].
    """

    white_left: float
    black_left: float
    running: chess.Color | None
    at: float
    increment: float = 0.0
    latency: float = 0.0

    def left(self, colour: chess.Color, now: float) -> float:
        """What a side has at a monotonic instant, never below 0 [s]."""
        has = self.white_left if colour else self.black_left
        return max(0.0, has - (max(0.0, now - self.at) if self.running is colour else 0.0))


@dataclass(frozen=True, slots=True)
class RemoteListing:
    """What the record says of the game, besides the opponent.

    Attributes:
        here: name of who plays at this table; None: as of a game that is played here alone.
        site: where it is played, as PGN's tag.
        time_control: as in PGN; None: without a clock.
    """

    here: str | None = None
    site: str = "?"
    time_control: str | None = None


class RemoteOpponent(Protocol):
    """The opponent of a game that is played here and somewhere else. Calls return at once, but for ``next``.

    What is told while the connection is cut is sent when it is back; what the other end refuses arrives as ``GameOver``
    or a ``Notice``.
    """

    @property
    def name(self) -> str:
        """For the record."""

    @property
    def colour(self) -> chess.Color:
        """Theirs."""

    @property
    def listing(self) -> RemoteListing:
        """For the record."""

    def next(self, timeout: float) -> RemoteEvent | None:
        """The next event, waiting for it at most so long [s, wall]; None: there was none."""

    def play(self, ply: int, move: chess.Move, *, offers_draw: bool = False) -> None:
        """Our move of a ply was made, or decided on: as early as it cannot be changed any more."""

    @property
    def unsaid(self) -> bool:
        """Whether a move of ours is not known to have come there yet."""

    def stands(self, board: chess.Board) -> None:
        """Know what stands on the table here: told at the beginning, and after each ply or take-back carried out."""

    def offer(self, what: Offer) -> None:
        """Propose something; or accept it, where they have proposed the same."""

    def decline(self, what: Offer) -> None:
        """Decline what they have proposed."""

    def resign(self) -> None:
        """Give up; the end arrives as an event."""

    def abort(self) -> None:
        """End the game without a result, where the rules allow it; otherwise they say so."""

    def claim(self) -> None:
        """Claim the game that they have left, where the rules allow it; otherwise they say so."""

    @property
    def claimable(self) -> bool:
        """Whether they have left, for as long as the rules want it before the game may be claimed."""

    def mending(self, busy: bool) -> None:
        """The table here must be put right, or has been: the clocks should stand meanwhile, where that can be."""

    def clock(self) -> OpponentClock | None:
        """The clock that counts; None: the game is played without."""
