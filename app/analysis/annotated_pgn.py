"""An analysed game as PGN with the annotations that other programs read: NAGs, ``%eval``, ``%clk``, ``%emt``."""

from __future__ import annotations

from typing import Final

import chess
import chess.pgn

from app.analysis.game_analysis import AnalysedGame
from app.analysis.judgement import Judgement
from app.analysis.model import AnalysedMove, GameAnalysis
from app.records.events import score_of

NAGS: Final = {
    Judgement.INACCURACY: chess.pgn.NAG_DUBIOUS_MOVE,
    Judgement.MISTAKE: chess.pgn.NAG_MISTAKE,
    Judgement.BLUNDER: chess.pgn.NAG_BLUNDER,
}
"""Numeric Annotation Glyphs, as the PGN standard has them: ?!, ? and ??."""
_COLUMNS: Final = 80
"""Width of a line, as the standard wants it [characters]."""


def annotated_pgn(game: AnalysedGame, analysis: GameAnalysis) -> str:
    """The PGN of a game: each move with its evaluation and times; what is judged also with a sentence and the best
    line, as a variation.
    """
    root = chess.pgn.Game()
    root.setup(game.board)
    root.headers.update(game.headers)
    root.headers.update({"White": game.white, "Black": game.black, "Result": game.result})
    root.headers["Annotator"] = f"Touchmove, {analysis.engine}, {_searched(analysis)}"
    if analysis.opening is not None:
        root.headers.update({"ECO": analysis.opening.eco, "Opening": analysis.opening.name})
    node: chess.pgn.GameNode = root
    for move, made in zip(game.moves, analysis.moves, strict=True):
        parent, node = node, node.add_main_variation(move)
        _annotate(node, made)
        if made.judgement is not None and made.lines:
            _add_line(parent, made.lines[0].moves)
    return root.accept(chess.pgn.StringExporter(columns=_COLUMNS)) + "\n"


def _annotate(node: chess.pgn.ChildNode, made: AnalysedMove) -> None:
    node.comment = " ".join(filter(None, (made.comment, made.note)))
    if made.judgement is not None:
        node.nags.add(NAGS[made.judgement])
    if made.score is not None:
        node.set_eval(score_of(made.score))
    if made.clock_s is not None:
        node.set_clock(made.clock_s)
    if made.elapsed_s is not None:
        node.set_emt(made.elapsed_s)


def _add_line(parent: chess.pgn.GameNode, line: tuple[str, ...]) -> None:
    node = parent
    for san in line:
        node = node.add_variation(node.board().parse_san(san))


def _searched(analysis: GameAnalysis) -> str:
    if analysis.nodes is not None:
        return f"{analysis.nodes} nodes a position"
    return f"{analysis.move_time_s:g} s a position"
