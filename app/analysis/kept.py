"""The analysis of a recorded game, read back: what report and page show."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from app.analysis.model import Analyses, GameAnalysis
from app.records.files import RecordError

ANALYSIS_FILE: Final = "analysis.json"
"""In the folder of a game; of a PGN file, beside it and after its name."""


def kept_analysis(folder: Path, moves: Sequence[str]) -> GameAnalysis | None:
    """The analysis of a recorded game, if its folder holds one of just these moves (UCI).

    Raises:
        RecordError: there is a file that cannot be read.
    """
    path = folder / ANALYSIS_FILE
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
