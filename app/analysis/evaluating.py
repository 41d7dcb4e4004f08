"""Evaluations of a game's positions by an engine: the only part of an analysis that is not a pure function."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import chess
import chess.engine
from pydantic import BaseModel, ConfigDict, Field, PositiveFloat, PositiveInt

from engine.answers import Candidate
from engine.settings import EngineSettings
from engine.stockfish import Engine

NODES: Final = 100_000
"""Searched for each position where nothing else is said: some 0.2 s."""
_PATIENCE: Final = 30.0
"""For what needs no search, and for the start [s]."""
_LONGEST: Final = 1e8
"""Some years: more than Python can wait for is no deadline [s]."""
_SLOWEST: Final = 20_000.0
"""An engine searches at least so many positions a second, also on a busy machine [1/s]."""


class AnalysisSettings(BaseModel):
    """How each position is searched."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    engine: str | None = None
    """Path of a UCI engine; None: Stockfish."""
    nodes: PositiveInt = NODES
    """Positions searched for each position of the game."""
    move_time: PositiveFloat | None = None
    """Time for each position instead [s]; an analysis by time does not repeat exactly."""
    lines: PositiveInt = Field(default=1, le=10)
    """Best lines of each position. With more than one the search is shared between them."""
    hash_mb: PositiveInt = 64
    """Memory of the search [MiB]."""

    @property
    def limit(self) -> chess.engine.Limit:
        """Of one position."""
        return chess.engine.Limit(time=self.move_time) if self.move_time else chess.engine.Limit(nodes=self.nodes)


@dataclass(frozen=True, slots=True)
class Evaluation:
    """What an engine thinks of a position.

    Attributes:
        score: of the position.
        lines: the best ones, the best first; none where the game is over.
    """

    score: chess.engine.PovScore
    lines: tuple[Candidate, ...] = ()


def analysis_engine(settings: AnalysisSettings) -> Engine:
    """An engine for analyses, not yet open: at full strength and on one thread, so that results repeat exactly."""
    deadline = _PATIENCE + (0.0 if settings.move_time else min(settings.nodes / _SLOWEST, _LONGEST))
    return Engine(EngineSettings(path=settings.engine, hash_mb=settings.hash_mb, deadline=deadline))


def evaluate(engine: Engine, settings: AnalysisSettings, board: chess.Board) -> Evaluation:
    """One position with its history, from a cleared engine: what was searched before has no effect.

    Raises:
        EngineProblem: as ``Engine.analyse``.
    """
    if not any(board.legal_moves):
        over = chess.engine.Mate(0) if board.is_checkmate() else chess.engine.Cp(0)
        return Evaluation(chess.engine.PovScore(over, board.turn))
    lines = engine.analyse(board, settings.lines, settings.limit)
    return Evaluation(lines[0].score, lines)


def positions(board: chess.Board, moves: Sequence[chess.Move]) -> Iterator[chess.Board]:
    """Of a game from its start to its end, one more than it has moves; each with the history that led to it."""
    position = board.copy(stack=False)
    yield position.copy()
    for move in moves:
        position.push(move)
        yield position.copy()


def evaluate_game(
    engine: Engine, settings: AnalysisSettings, board: chess.Board, moves: Sequence[chess.Move],
    told: Callable[[int], None] = lambda done: None,
) -> tuple[Evaluation, ...]:  # fmt: skip
    """All positions of a game, the start first; ``told`` how many are done.

    Raises:
        EngineProblem: as ``Engine.analyse``.
    """
    found = list[Evaluation]()
    for position in positions(board, moves):
        found.append(evaluate(engine, settings, position))
        told(len(found))
    return tuple(found)
