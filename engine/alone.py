"""The best moves of a position by an engine that names only one at a time: each move is made and searched alone."""

from __future__ import annotations

from collections.abc import Callable

import chess
import chess.engine

from engine.answers import Candidate

Search = Callable[[chess.Board, int], chess.engine.PlayResult]
"""Searches a position by so many nodes; its answer was not checked to be legal where the score is what counts."""


def searched_alone(search: Search, board: chess.Board, lines: int, nodes: int) -> tuple[Candidate, ...]:
    """The best moves, best first.

    Args:
        search: asks the engine.
        board: not at the end of a game; left as it is.
        lines: how many moves at most.
        nodes: positions searched for all moves together.

    Returns:
        From an engine that tells no score only its own move, as an even one.
    """
    moves = list(board.legal_moves)
    found = list[Candidate]()
    for move in moves:
        after = board.copy()
        after.push(move)
        score = _ended(after) or search(after, max(1, nodes // len(moves))).info.get("score")
        if score is None:
            own = search(board, nodes).move
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
