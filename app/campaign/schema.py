"""What a campaign writes: one row a game and one a ply, version 1; the same in the ledger's lines and in Parquet.

A field that is null was not measured, or nobody can know it. Fields of ``MEASURED`` depend on the machine and on when
it was; all others are the same wherever and however often a seed is played.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Any, Final, Literal

from pydantic import Field, NonNegativeInt

from hardware.frozen import Frozen

SCHEMA_VERSION: Final = 1
"""Of the rows; a reader refuses what is newer."""
LEDGERS: Final = "results*.jsonl"
"""Names of ledgers in a campaign's folder: ``results.jsonl``, or of a shard ``results-2-of-8.jsonl``."""
GAMES_FILE: Final = "games.parquet"
PLIES_FILE: Final = "plies.parquet"
GAMES_FOLDER: Final = "games"
"""Folders of kept games lie there, each named by its seed."""
DRAWN: Final = "drawn."
"""What a column's name begins with that says what a range was drawn to."""
MEASURED: Final = frozenset({"wall_s", "speed", "host", "cpu", "attempts", "folder", "log"})
"""Columns of games that may differ from one time to the next."""

DrawnValue = float | str
"""What a range was drawn to: a number (truths are 0 and 1) or a word."""


class TaskKind(StrEnum):
    """What a seed plays."""

    GAME = "game"
    """Two engines play, or a random line is played."""
    SESSION = "session"
    """A scripted person errs at the board."""
    SETUP = "setup"
    """The arm makes one random position of another."""


class TaskOutcome(StrEnum):
    """How a game ended."""

    RIGHT = "right"
    """Done, the referee agrees, and nothing had to be mended."""
    MENDED = "mended"
    """Done, and the referee agrees; something was mended, or a person was asked."""
    UNMENDED = "unmended"
    """It ended early, and said so."""
    WRONG = "wrong"
    """The referee disagrees with what the program claims: silently wrong."""
    CRASHED = "crashed"
    """A traceback; or its processes, or the worker itself, died each time it was tried."""


class GameRow(Frozen):
    """A game, session or setting up."""

    schema_version: Literal[1] = SCHEMA_VERSION
    index: NonNegativeInt
    """In the campaign, from 0."""
    seed: NonNegativeInt
    kind: TaskKind
    outcome: TaskOutcome
    reason: str
    """Why it ended; of a failure, what failed."""
    said: str | None = None
    """The last sentence that a person at the board was told; null: none."""
    attempts: int = 1
    """So often it was begun: more, where a worker died."""
    plies: NonNegativeInt = 0
    """That were done and recorded; of a session, the person's and the robot's."""
    plies_asked_for: NonNegativeInt = 0
    """Of a game that ends by the rules: so many as it had then; of a session the acts that it was to have."""
    sim_s: float | None = None
    """Plant time from start to end [s]."""
    wall_s: float | None = None
    """Wall time of the whole task, with its start and end [s]."""
    speed: float | None = None
    """Plant time over wall time while ticks ran."""
    grips_lost: int | None = None
    """Pieces that slipped or were let go by a planted fault."""
    mishaps: NonNegativeInt = 0
    """Planted faults of hands, link and program that happened: knocks, hands over the board, kills; of a session, acts
    that were no legal move."""
    datagrams_lost: NonNegativeInt = 0
    """By a planted loss, both ways."""
    repairs: NonNegativeInt = 0
    """Troubles at the board that the arm or a person put right."""
    asked: NonNegativeInt = 0
    """So often a person was asked for something."""
    wrong_plies: NonNegativeInt = 0
    """Plies and tasks that the referee found otherwise than recorded."""
    placement_mean_mm: float | None = None
    """Of all pieces that plies of the arm moved; a hand's are left out: they say nothing of the robot."""
    placement_max_mm: float | None = None
    peak_torque_Nm: float | None = None  # noqa: N815  # the column, with its unit
    peak_force_N: float | None = None  # noqa: N815  # the column, with its unit
    missed_ticks: int | None = None
    """Of the controller; pace fast misses none by its nature."""
    repeatable: bool = True
    """Whether the world's last state is the same to the last bit each time; lost datagrams and killed programs are
    met by wall time."""
    world_state: str | None = None
    """SHA-256 of the world's last state; null: it left none."""
    environment: str
    """Digest of sources, packages and engine that it was played with."""
    host: str | None
    """Machine and processor that played it; null: its worker died with it each time, and nobody knows where."""
    cpu: str | None
    folder: str | None = None
    """Where its folder was kept, relative to the campaign's; null: it was not."""
    log: str | None = None
    """Of a crash: its traceback, or the last words of its processes."""
    drawn: dict[str, DrawnValue] = Field(default_factory=dict)
    """What each range was drawn to, by its name; in tables a column ``drawn.<name>`` each."""

    def columns(self) -> dict[str, Any]:
        """As a row of a table."""
        row = self.model_dump(mode="json", exclude={"drawn"})
        return row | {f"{DRAWN}{name}": value for name, value in self.drawn.items()}

    @property
    def failed(self) -> bool:
        """Whether it is one of the campaign's failures."""
        return self.outcome not in (TaskOutcome.RIGHT, TaskOutcome.MENDED)


class PlyRow(Frozen):
    """A ply that was done."""

    schema_version: Literal[1] = SCHEMA_VERSION
    index: NonNegativeInt
    seed: NonNegativeInt
    ply: NonNegativeInt
    """From 1."""
    san: str
    uci: str
    kind: str
    """quiet, capture, castling, en_passant or promotion."""
    by: str
    """arm or hand."""
    piece: str
    """Symbol of the piece that moved, a capital for White's."""
    planned_s: float | None
    """From home to home, as ``real_s``; null: it was not done from home to home in one go, or by a hand."""
    real_s: float | None
    error_mm: float | None
    """The largest distance of a moved piece from the centre of its place."""
    peak_torque_Nm: float | None  # noqa: N815  # the column, with its unit
    peak_force_N: float | None  # noqa: N815  # the column, with its unit
    physical_ok: bool | None
    transfers: NonNegativeInt
    """Pieces carried."""
    repairs: NonNegativeInt
    """Troubles put right before the next ply began."""

    def columns(self) -> dict[str, Any]:
        """As a row of a table."""
        return self.model_dump(mode="json")


class TaskResult(Frozen):
    """What came of one seed: a line of the ledger."""

    game: GameRow
    plies: tuple[PlyRow, ...] = ()
