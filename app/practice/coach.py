"""A coach: at a person's blunder it offers to take the move back, and says why in one sentence."""

from __future__ import annotations

from typing import Final, Self

import chess

from app.analysis.evaluating import AnalysisSettings, analysis_engine, evaluate
from app.analysis.judgement import Judgement, judgement_of
from app.analysis.reasons import reason
from app.players.advice import Advice, TakingBack

NODES: Final = 100_000
"""Searched before and after a move: some 0.2 s each."""


class Coach:
    """``Adviser`` with an engine of its own at full strength, whatever the opponent plays like. A context manager."""

    def __init__(self, path: str | None, nodes: int = NODES) -> None:
        """``path``: of the engine; None: Stockfish. ``nodes``: positions searched before and after a move."""
        self._settings = AnalysisSettings(engine=path, nodes=nodes)
        self._engine = analysis_engine(self._settings)

    def __enter__(self) -> Self:
        self._engine.open()
        return self

    def __exit__(self, *_: object) -> None:
        self._engine.close()

    def judge(self, board: chess.Board, move: chess.Move) -> Advice | None:
        """See ``Adviser``: only blunders are spoken of."""
        after = board.copy()
        after.push(move)
        if after.is_checkmate():
            return None
        before = evaluate(self._engine, self._settings, board)
        best, found = before.lines[0], evaluate(self._engine, self._settings, after)
        judged = judgement_of(before.score.pov(board.turn), found.score.pov(board.turn))
        if best.move == move or judged is not Judgement.BLUNDER:
            return None
        return Advice(reason(board, move, best, found.lines[0] if found.lines else None), TakingBack.OFFERED)
