"""What engines answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import chess
import chess.engine


@dataclass(frozen=True, slots=True)
class EngineMove:
    """A legal move and what the engine said of it; None where it said nothing."""

    move: chess.Move
    ponder: chess.Move | None
    """Reply that the engine expects."""
    score: chess.engine.PovScore | None
    depth: int | None
    """Search depth [plies]."""
    nodes: int | None
    """Positions searched."""
    wall: float
    """Wall time from question to answer, restarts included [s]."""
    pv: tuple[chess.Move, ...] = ()
    """How the engine thinks the game goes on, from its move on."""
    lost: float = 0.0
    """Of the wall time: what failed attempts took [s]."""
    troubles: tuple[str, ...] = ()
    """What went wrong on the way, a phrase each."""


class Candidate(NamedTuple):
    """One of the best moves of a position and its score."""

    move: chess.Move
    score: chess.engine.PovScore


def engine_move(played: chess.engine.PlayResult, wall: float, lost: float, troubles: tuple[str, ...]) -> EngineMove:
    """What python-chess says, and we of it; the move was checked to be legal."""
    assert played.move is not None, "checked to be legal"
    pv = tuple(played.info.get("pv", ()))
    return EngineMove(
        move=played.move,
        ponder=played.ponder,
        score=played.info.get("score"),
        depth=played.info.get("depth"),
        nodes=played.info.get("nodes"),
        wall=wall,
        pv=pv if pv[:1] == (played.move,) else (played.move,),  # a weakened engine plays other moves than its best
        lost=lost,
        troubles=troubles,
    )
