"""The analysis of a game from evaluations of its positions: a pure function."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import chess
import chess.engine

from app.analysis.evaluating import AnalysisSettings, Evaluation, positions
from app.analysis.judgement import (
    CEILING,
    Judgement,
    centipawns,
    game_accuracy,
    judgement_of,
    move_accuracy,
    win_percent,
)
from app.analysis.model import AnalysedLine, AnalysedMove, GameAnalysis, OpeningRecord, SideAnalysis
from app.analysis.openings import opening_of_game
from app.analysis.reasons import LONGEST, reason
from app.pieces.layout import colour_of
from app.players.game_end import Result
from app.records.events import score_text
from engine.answers import Candidate


@dataclass(frozen=True, slots=True)
class AnalysedGame:
    """What is analysed.

    Attributes:
        board: where it starts.
        moves: of both sides.
        white: name.
        black: name.
        result: as in PGN.
        clocks: what the mover's clock showed after each move [s]; None where there was none.
        elapsed: how long each move took [s]; None where that is not known.
        comments: of each move, for people.
        headers: of the PGN that it came from.
    """

    board: chess.Board
    moves: tuple[chess.Move, ...]
    white: str
    black: str
    result: Result
    clocks: tuple[float | None, ...]
    elapsed: tuple[float | None, ...]
    comments: tuple[str, ...]
    headers: Mapping[str, str]


def analysis_of(
    game: AnalysedGame, evaluations: Sequence[Evaluation], engine: str, settings: AnalysisSettings
) -> GameAnalysis:
    """The analysis of a game.

    Args:
        game: of which.
        evaluations: of its positions, the start first: one more than it has moves.
        engine: name of the engine that gave them.
        settings: how they were searched.
    """
    boards = tuple(positions(game.board, game.moves))
    wins = [win_percent(one.score.white()) for one in evaluations]
    moves = tuple(
        _move(game, number, boards[number], boards[number + 1], before, after)
        for number, (before, after) in enumerate(pairwise(evaluations))
    )
    accuracy = game_accuracy(wins, game.board.turn)
    found = opening_of_game(boards[-1])
    return GameAnalysis(
        white=game.white, black=game.black, result=game.result, start=game.board.fen(), chess960=game.board.chess960,
        engine=engine, nodes=None if settings.move_time else settings.nodes, move_time_s=settings.move_time,
        start_score=_score(boards[0], evaluations[0]), start_white_wins=wins[0],
        opening=None if found is None else OpeningRecord(eco=found[0].eco, name=found[0].name, plies=found[1]),
        sides={
            colour_of(side): _side(boards[0].turn, side, moves, evaluations, known)
            for side, known in ((chess.WHITE, accuracy.white), (chess.BLACK, accuracy.black))
        },
        moves=moves,
    )  # fmt: skip


def _move(
    game: AnalysedGame, number: int, board: chess.Board, after_it: chess.Board, before: Evaluation, after: Evaluation
) -> AnalysedMove:
    move, side = game.moves[number], board.turn
    one, two = before.score.pov(side), after.score.pov(side)
    best = before.lines[0] if before.lines else None
    judgement = None if best is not None and best.move == move else judgement_of(one, two)
    note = ""
    if judgement is not None:
        note = f"{judgement.value.capitalize()}. {reason(board, move, best, after.lines[0] if after.lines else None)}."
    return AnalysedMove(
        ply=number + 1, number=board.fullmove_number, side=colour_of(side), san=board.san(move), uci=board.uci(move),
        fen=after_it.fen(), score=_score(after_it, after), white_wins=win_percent(after.score.white()),
        lost=max(0.0, win_percent(one) - win_percent(two)), accuracy=move_accuracy(win_percent(one), win_percent(two)),
        judgement=judgement, note=note, lines=tuple(_line(board, line) for line in before.lines),
        clock_s=game.clocks[number], elapsed_s=game.elapsed[number], comment=game.comments[number],
    )  # fmt: skip


def _line(board: chess.Board, line: Candidate) -> AnalysedLine:
    position, said = board.copy(), list[str]()
    for move in (line.pv or (line.move,))[:LONGEST]:
        said.append(position.san(move))
        position.push(move)
    return AnalysedLine(score=score_text(line.score), moves=tuple(said))


def _score(board: chess.Board, evaluation: Evaluation) -> str | None:
    return score_text(evaluation.score) if any(board.legal_moves) else None


def _side(
    first: chess.Color, side: chess.Color, moves: Sequence[AnalysedMove], evaluations: Sequence[Evaluation],
    accuracy: float | None,
) -> SideAnalysis:  # fmt: skip
    offset = 0 if side is first else 1
    own = moves[offset::2]
    worth = [max(-CEILING, min(CEILING, centipawns(one.score.pov(side)))) for one in evaluations]
    lost = [max(0, worth[move.ply - 1] - worth[move.ply]) for move in own]
    counted = [sum(move.judgement is name for move in own) for name in Judgement]
    return SideAnalysis(
        accuracy=accuracy, centipawns_lost=sum(lost) / len(lost) if lost else None,
        inaccuracies=counted[0], mistakes=counted[1], blunders=counted[2],
    )  # fmt: skip
