"""How one engine plays, as far as it can be said before the engine is known."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Final, Self

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    NonNegativeInt,
    PositiveFloat,
    PositiveInt,
    StrictBool,
    StrictInt,
    model_validator,
)

if TYPE_CHECKING:
    import chess.engine

THREADS: Final = 1
HASH_MB: Final = 16
"""Of a player that says nothing else [MiB]: enough for some seconds of search on one thread."""
BOOK_PLIES: Final = 20
"""So far a game may follow an opening book, if nothing else is said [plies]."""


def _option_value(value: object) -> object:
    if not isinstance(value, (bool, int, str)):
        raise ValueError("it should be true, false, a whole number or a text")
    return value


OptionValue = Annotated[StrictBool | StrictInt | str, BeforeValidator(_option_value)]
"""Of a UCI option; True presses a button."""


class EngineSettings(BaseModel):
    """How one engine plays."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    path: str | None = None
    """The binary; None looks for ``stockfish`` on PATH, then where Debian puts it."""
    elo: int | None = None
    """Playing strength by UCI_LimitStrength, below the engine's own limits by ``levels``; None is full strength."""
    seed: NonNegativeInt = 0
    """Of a level below the engine's own: draws its moves."""
    skill: NonNegativeInt | None = None
    """Playing strength by the option Skill Level, within the engine's own limits; None is full strength."""
    threads: PositiveInt = THREADS
    hash_mb: PositiveInt = HASH_MB
    """Size of the hash table [MiB]."""
    options: dict[str, OptionValue] = Field(default_factory=dict)
    """Further UCI options by name, as the engine offers them."""
    move_time: PositiveFloat | None = None
    """Thinking time of a move [s]; with a chess clock the longest one."""
    nodes: PositiveInt | None = None
    """Positions searched for a move; a chess clock is then not told."""
    ponder: bool = False
    """Whether it may think while others move. Not with ``nodes``: what it thought would change the game."""
    deadline: PositiveFloat = 30.0
    """Wall time [s] in all where no limit names a time; where one does, at most this is granted beyond it."""
    start_deadline: PositiveFloat = 10.0
    """Wall time [s] for each step of starting: process and handshake, options."""

    @model_validator(mode="after")
    def _one_strength(self) -> Self:
        if self.elo is not None and self.skill is not None:
            raise ValueError("elo and skill both set the strength: leave one of them out")
        return self

    @property
    def limit(self) -> chess.engine.Limit:
        """Limit of a move by these settings; empty when neither time nor nodes are set."""
        import chess.engine  # settings are read by processes that play no chess

        return chess.engine.Limit(time=self.move_time, nodes=self.nodes)

    def limit_by(self, clock: chess.engine.Limit | None) -> chess.engine.Limit:
        """Limit of a move by these settings and what a chess clock leaves; None: played without one."""
        if clock is None or self.nodes is not None:
            return self.limit
        import chess.engine

        return chess.engine.Limit(
            time=self.move_time, white_clock=clock.white_clock, black_clock=clock.black_clock,
            white_inc=clock.white_inc, black_inc=clock.black_inc, remaining_moves=clock.remaining_moves,
        )  # fmt: skip

    @property
    def ponders(self) -> bool:
        """Whether it thinks while others move."""
        return self.ponder and self.nodes is None

    @property
    def limited(self) -> bool:
        """Whether it plays below its strength."""
        return self.elo is not None or self.skill is not None
