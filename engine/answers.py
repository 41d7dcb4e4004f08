"""What engines answer; and the best moves of a position by an engine that names only one at a time."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import chess
import chess.engine

Search = Callable[[chess.Board, chess.engine.Limit], chess.engine.PlayResult]
"""Searches a position by nodes or by time; its answer was not checked to be legal where the score is what counts."""


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
    """One of the best moves of a position, its score, and how the engine thinks the game goes on, from that move on."""

    move: chess.Move
    score: chess.engine.PovScore
    pv: tuple[chess.Move, ...] = ()
    """Only legal moves; () where the engine named none."""


def engine_move(played: chess.engine.PlayResult, wall: float, lost: float, troubles: tuple[str, ...]) -> EngineMove:
    """What python-chess says, and we of it; the move was checked to be legal."""
    assert played.move is not None, "checked to be legal"
    pv = tuple(played.info.get("pv", ()))
    pv = pv if pv[:1] == (played.move,) else (played.move,)  # a weakened engine plays other moves than its best
    said = played.info
    score, depth, nodes = said.get("score"), said.get("depth"), said.get("nodes")
    return EngineMove(played.move, played.ponder, score, depth, nodes, wall, pv, lost, troubles)


def searched_alone(
    search: Search, board: chess.Board, lines: int, limit: chess.engine.Limit
) -> tuple[Candidate, ...]:  # fmt: skip
    """The best moves of a position that is no end of a game, at most ``lines``, best first: each searched alone.

    ``limit`` is for all moves together, by nodes or by time. From an engine that tells no score only its own move
    comes, as an even one.
    """
    moves = list(board.legal_moves)
    nodes = None if limit.nodes is None else max(1, limit.nodes // len(moves))
    each = replace(limit, time=None if limit.time is None else limit.time / len(moves), nodes=nodes)
    found = list[Candidate]()
    for move in moves:
        after = board.copy()
        after.push(move)
        score = _ended(after) or search(after, each).info.get("score")
        if score is None:
            own = search(board, limit).move
            return () if own is None else (Candidate(own, _even(board.turn)),)
        found.append(Candidate(move, chess.engine.PovScore(score.pov(board.turn), board.turn)))
    found.sort(key=lambda candidate: candidate.score.relative, reverse=True)  # moves of one score keep their order
    return tuple(found[:lines])


def _ended(board: chess.Board) -> chess.engine.PovScore | None:
    """Score of a game that is over, where no engine has anything to search."""
    if board.is_checkmate():
        return chess.engine.PovScore(chess.engine.Mate(0), board.turn)
    return None if any(board.legal_moves) else _even(board.turn)


def _even(turn: chess.Color) -> chess.engine.PovScore:
    return chess.engine.PovScore(chess.engine.Cp(0), turn)
