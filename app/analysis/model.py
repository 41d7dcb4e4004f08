"""The analysis of a game as it is written: ``analysis.json``, and what report and page show."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from app.analysis.judgement import Judgement
from app.players.game_end import Result
from app.records.events import Record
from hardware.piece_set import Colour

Percent = Annotated[float, Field(ge=0.0, le=100.0, allow_inf_nan=False)]


class AnalysedLine(Record):
    """One of the best lines of a position."""

    score: str
    """Pawns from White's side such as +0.31, or #-3."""
    moves: tuple[str, ...]
    """SAN, from the position on."""


class OpeningRecord(Record):
    """The opening of a game."""

    eco: str
    """Its code in the Encyclopaedia of Chess Openings."""
    name: str
    plies: int
    """After so many plies stood the last position that has a name."""


class AnalysedMove(Record):
    """One move."""

    ply: int
    """From 1."""
    number: int
    """As players count moves."""
    side: Colour
    san: str
    uci: str
    fen: str
    """The position after it."""
    score: str | None
    """Of that position, as in ``AnalysedLine``; null: the game is over with it."""
    white_wins: Percent
    """White's winning chances in that position [percent]."""
    lost: Percent
    """Winning chances of its own side that the move gave away [percent]."""
    accuracy: Percent
    judgement: Judgement | None
    """Null: as good as any."""
    note: str
    """Why it is judged so, in one sentence; "" where it is not."""
    lines: tuple[AnalysedLine, ...]
    """The best lines of the position before it, the best first."""
    clock_s: float | None = None
    """What its player's clock showed after it [s]; null where there was none."""
    elapsed_s: float | None = None
    """How long it took [s], where that is known."""
    comment: str = ""
    """Of the game itself."""


class SideAnalysis(Record):
    """How one side has played."""

    accuracy: Percent | None
    """Null: it has not moved."""
    centipawns_lost: float | None
    """On average over its moves [centipawns]; null likewise."""
    inaccuracies: int
    mistakes: int
    blunders: int


class GameAnalysis(Record):
    """One game."""

    white: str
    black: str
    result: Result
    start: str
    """FEN."""
    chess960: bool
    engine: str
    nodes: int | None
    """Positions searched for each position of the game; null: it was searched by time."""
    move_time_s: float | None
    """Time for each position [s]; null: it was searched by nodes."""
    start_score: str | None
    """Of the first position, as in ``AnalysedLine``."""
    start_white_wins: Percent
    """White's winning chances in it [percent]."""
    opening: OpeningRecord | None
    sides: dict[Colour, SideAnalysis]
    moves: tuple[AnalysedMove, ...]


class Analyses(Record):
    """What a file holds: one game or more."""

    games: tuple[GameAnalysis, ...]
