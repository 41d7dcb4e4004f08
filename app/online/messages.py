"""What Lichess says, as far as it is used: each message is checked before anything believes it.

What is not named here is left out unread; what is named and is not as the specification says is a ``MessageError``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from app import UserError
from hardware.piece_set import Colour

LONGEST_GAME: Final = 12_000
"""No game has more plies by the 75-move rule [plies]."""
CHAT_SHOWN: Final = 140
"""So much of a message in the game's chat is shown [characters]."""

_Milliseconds = Annotated[int, Field(ge=0, le=1 << 40)]
_Name = Annotated[str, Field(min_length=1, max_length=64, pattern=r"^[\w. +-]+$")]
_Id = Annotated[str, Field(min_length=4, max_length=16, pattern=r"^[A-Za-z0-9]+$")]


class MessageError(UserError):
    """The server has said something that is not as specified."""


class _Message(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore", populate_by_name=True)


_M = TypeVar("_M", bound=_Message)


class Variant(_Message):
    """Which chess is played."""

    key: Annotated[str, Field(max_length=32)]


class Account(_Message):
    """Who the token belongs to."""

    id: _Name
    username: _Name
    title: Annotated[str, Field(max_length=8)] | None = None

    @property
    def is_bot(self) -> bool:
        """Whether it can only play as a bot."""
        return self.title == "BOT"


class User(_Message):
    """A player of a game or a challenge; of the server's own engine only the level."""

    id: _Name | None = None
    name: _Name | None = None
    title: Annotated[str, Field(max_length=8)] | None = None
    rating: int | None = None
    ai_level: int | None = Field(default=None, alias="aiLevel")

    @property
    def shown(self) -> str:
        """Name for people and for the record."""
        if self.name is None:
            return "an anonymous player" if self.ai_level is None else f"Lichess level {self.ai_level}"
        return f"{self.title} {self.name}" if self.title else self.name


class GameClock(_Message):
    """Of a real-time game."""

    initial: _Milliseconds
    increment: _Milliseconds


class GameState(_Message):
    """Where a game stands."""

    type: Literal["gameState"]
    moves: Annotated[str, Field(max_length=6 * LONGEST_GAME, pattern=r"^[a-h1-8qrbn ]*$")]
    wtime: _Milliseconds
    btime: _Milliseconds
    winc: _Milliseconds
    binc: _Milliseconds
    status: Annotated[str, Field(max_length=32)]
    winner: Colour | None = None
    wdraw: bool = False
    bdraw: bool = False
    wtakeback: bool = False
    btakeback: bool = False

    @property
    def over(self) -> bool:
        """Whether nobody can move any more."""
        return self.status not in ("created", "started")


class GameFull(_Message):
    """All of a game; the first line of its stream."""

    type: Literal["gameFull"]
    id: _Id
    variant: Variant
    clock: GameClock | None = None
    speed: Annotated[str, Field(max_length=32)]
    rated: bool = False
    white: User
    black: User
    initial_fen: Annotated[str, Field(max_length=128)] = Field(default="startpos", alias="initialFen")
    state: GameState
    days: int | None = Field(default=None, alias="daysPerTurn")

    @property
    def usual(self) -> bool:
        """Whether it is chess from the usual position."""
        return self.variant.key == "standard" and self.initial_fen == "startpos"

    @property
    def time_control(self) -> str | None:
        """As in PGN; None: without a clock."""
        if self.clock is not None:
            return f"{self.clock.initial / 1000:g}+{self.clock.increment / 1000:g}"
        return None if self.days is None else f"1/{86_400 * self.days}"


class OpponentGone(_Message):
    """The opponent has left, or is back."""

    type: Literal["opponentGone"]
    gone: bool
    claim_after: Annotated[int, Field(ge=0, le=86_400)] | None = Field(default=None, alias="claimWinInSeconds")


class ChatLine(_Message):
    """Somebody has said something in the game's chat."""

    type: Literal["chatLine"]
    room: Annotated[str, Field(max_length=16)]
    username: Annotated[str, Field(max_length=64)]
    text: Annotated[str, Field(max_length=1000)]

    @property
    def shown(self) -> str:
        """The part of it that a person is shown: no more than ``CHAT_SHOWN`` characters, none that moves the cursor."""
        return "".join(char for char in self.text[:CHAT_SHOWN] if char.isprintable())


class StartedGame(_Message):
    """A game of this account, as the event stream names it."""

    game_id: _Id = Field(alias="gameId")


class GameStart(_Message):
    """A game has begun, or goes on."""

    type: Literal["gameStart"]
    game: StartedGame


class TimeControlSaid(_Message):
    """Of a challenge."""

    type: Annotated[str, Field(max_length=32)]
    limit: Annotated[int, Field(ge=0, le=10_800)] | None = None
    increment: Annotated[int, Field(ge=0, le=180)] | None = None
    days: int | None = Field(default=None, alias="daysPerTurn")


class Challenge(_Message):
    """Somebody wants to play this account, or it them."""

    id: _Id
    challenger: User
    variant: Variant
    rated: bool
    speed: Annotated[str, Field(max_length=32)]
    time_control: TimeControlSaid = Field(alias="timeControl")
    initial_fen: Annotated[str, Field(max_length=128)] | None = Field(default=None, alias="initialFen")
    rematch_of: _Id | None = Field(default=None, alias="rematchOf")


class Challenged(_Message):
    """A challenge was made."""

    type: Literal["challenge"]
    challenge: Challenge


class ChallengeId(_Message):
    """Of a challenge that is gone."""

    id: _Id


class ChallengeGone(_Message):
    """A challenge was taken back, or declined."""

    type: Literal["challengeCanceled", "challengeDeclined"]
    challenge: ChallengeId


class _Playing(_Message):
    now_playing: Annotated[list[StartedGame], Field(alias="nowPlaying", max_length=1000)]


GameLine = GameFull | GameState | OpponentGone | ChatLine
EventLine = GameStart | Challenged | ChallengeGone
_GAME_LINES: Final[dict[str, type[GameLine]]] = {
    "gameFull": GameFull, "gameState": GameState, "opponentGone": OpponentGone, "chatLine": ChatLine,
}  # fmt: skip
_EVENT_LINES: Final[dict[str, type[EventLine]]] = {
    "gameStart": GameStart, "challenge": Challenged,
    "challengeCanceled": ChallengeGone, "challengeDeclined": ChallengeGone,
}  # fmt: skip


def game_line(said: Mapping[str, Any]) -> GameLine | None:
    """A line of a game's stream; None: it is of a kind that is not used. Raises ``MessageError``."""
    kind = _GAME_LINES.get(str(said.get("type")))
    return None if kind is None else _checked(kind, said)


def event_line(said: Mapping[str, Any]) -> EventLine | None:
    """A line of the account's stream; None: it is of a kind that is not used. Raises ``MessageError``."""
    kind = _EVENT_LINES.get(str(said.get("type")))
    return None if kind is None else _checked(kind, said)


def account_of(said: object) -> Account:
    """Whose token it is. Raises ``MessageError``."""
    return _checked(Account, said)


def games_of(said: object) -> frozenset[str]:
    """Ids of the games that the account plays now. Raises ``MessageError``."""
    return frozenset(game.game_id for game in _checked(_Playing, said).now_playing)


def id_of(said: object) -> str:
    """Of a challenge that was made. Raises ``MessageError``."""
    return _checked(ChallengeId, said).id


def _checked(kind: type[_M], said: object) -> _M:
    try:
        return kind.model_validate(said)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise MessageError(
            f"the server has said something unexpected ({kind.__name__}.{where}: {first['msg']}): is --server Lichess, "
            "and is this program up to date?"
        ) from error
