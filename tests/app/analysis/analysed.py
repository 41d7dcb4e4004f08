"""An analysis that no engine made: of scores that a test gives."""

from __future__ import annotations

from pathlib import Path

import chess
from chess.engine import Cp, PovScore

from app.analysis.evaluating import AnalysisSettings, Evaluation, positions
from app.analysis.files import files_in, write_analyses
from app.analysis.game_analysis import AnalysedGame, analysis_of
from app.analysis.model import GameAnalysis
from engine.answers import Candidate


def analysed(line: str, scores: list[int], folder: Path | None = None, start: str = chess.STARTING_FEN) -> GameAnalysis:
    """A game of these moves (SAN) whose positions, from the start on, have these scores from White's side [centipawns].

    The best line of a position is its first legal move. ``folder``: of a record, where it is written.
    """
    board, moves = chess.Board(start), []
    for san in line.split():
        moves.append(board.push_san(san))
    none = (None,) * len(moves)
    game = AnalysedGame(
        chess.Board(start), tuple(moves), "Anna", "Bert", "*", none, none, ("",) * len(moves), {}
    )  # fmt: skip
    evaluations = []
    for position, centipawns in zip(positions(game.board, moves), scores, strict=True):
        score = PovScore(Cp(centipawns), chess.WHITE)
        lines = tuple(Candidate(move, score, (move,)) for move in list(position.legal_moves)[:1])
        evaluations.append(Evaluation(score, lines))
    made = analysis_of(game, evaluations, "Fake 1.0", AnalysisSettings(nodes=7))
    if folder is not None:
        write_analyses(files_in(folder), [(game, made)])
    return made
