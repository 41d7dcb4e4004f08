"""Where analyses lie: beside a PGN file, or in the folder of a recorded game."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

from pydantic import ValidationError

from app.analysis.annotated_pgn import annotated_pgn
from app.analysis.game_analysis import AnalysedGame
from app.analysis.model import Analyses, GameAnalysis
from app.records.files import RecordError, write_atomically

ANALYSIS_FILE: Final = "analysis.json"
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


def kept_analysis(folder: Path, moves: Sequence[str]) -> GameAnalysis | None:
    """The analysis of a recorded game, if its folder holds one of just these moves (UCI).

    Raises:
        RecordError: there is a file that cannot be read.
    """
    path = files_in(folder).json
    if not path.is_file():
        return None
    try:
        games = Analyses.model_validate_json(path.read_bytes()).games
    except OSError as error:
        raise RecordError(f"{path} cannot be read ({error.strerror}): delete it, or correct its permissions") from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the file"
        raise RecordError(
            f"{path} is not an analysis of this version ({where}: {first['msg']}): run 'touchmove analyse' again"
        ) from error
    return next((one for one in games if [move.uci for move in one.moves] == [*moves]), None)
