"""Where analyses lie: beside a PGN file, or in the folder of a recorded game."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

from app.analysis.annotated_pgn import annotated_pgn
from app.analysis.game_analysis import AnalysedGame
from app.analysis.kept import ANALYSIS_FILE
from app.analysis.model import Analyses, GameAnalysis
from app.records.files import write_atomically

ANALYSED_PGN: Final = "analysed.pgn"


class AnalysisFiles(NamedTuple):
    """Files of one analysis."""

    json: Path
    pgn: Path


def files_in(folder: Path, stem: str | None = None) -> AnalysisFiles:
    """Their paths in a folder; ``stem``: of the PGN file that is analysed, None for a recorded game."""
    before = "" if stem is None else f"{stem}."
    return AnalysisFiles(folder / f"{before}{ANALYSIS_FILE}", folder / f"{before}{ANALYSED_PGN}")


def write_analyses(files: AnalysisFiles, games: Sequence[tuple[AnalysedGame, GameAnalysis]]) -> None:
    """Write analysed games.

    Raises:
        RecordError: they cannot be written.
    """
    analyses = Analyses(games=tuple(analysis for _, analysis in games))
    write_atomically(files.json, analyses.model_dump_json(indent=1) + "\n")
    write_atomically(files.pgn, "\n".join(annotated_pgn(game, analysis) for game, analysis in games))
