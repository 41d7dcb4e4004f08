"""Rows of ``touchmove bench vision``: games in photographs and videos of real boards, where there are any."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

from app.measure.bench.report import Row, row
from app.measure.photographs import CornersFrom, follow_folder
from app.measure.photographs.labels import FILE_NAME, load_labels
from app.measure.photographs.report import Score

Progress = Callable[[str], None]

VARIABLE: Final = "TOUCHMOVE_PHOTOS"
"""Names the folder with labelled photographs where the command line does not."""
LEAST: Final = {CornersFrom.LABELS: 0.95, CornersFrom.FIND: 0.90}
"""Share of plies that must be read without asking."""


def photo_folder(given: Path | None) -> Path | None:
    """The folder with labelled photographs, None where there is none."""
    named = given or (Path(os.environ[VARIABLE]) if os.environ.get(VARIABLE) else None)
    return named if named is not None and named.is_dir() else None


def sequences(photos: Path) -> Iterator[Path]:
    """Folders below that hold a labelled game."""
    for path in sorted(photos.rglob(FILE_NAME)):
        text = path.read_text(encoding="utf-8")
        if '"chess-seq/' in text or '"chess-video/' in text:
            yield path.parent


def photo_rows(photos: Path, progress: Progress) -> dict[str, Row]:
    """Follow every labelled game, with the board's corners as labelled and as found.

    Raises:
        UserError: labels are wrong, or a picture cannot be read.
    """
    rows: dict[str, Row] = {}
    for source, least in LEAST.items():
        scores = []
        for folder in sequences(photos):
            labels = load_labels(folder)
            if (
                source is CornersFrom.LABELS
                and labels is not None
                and labels.video is not None
                and not labels.corners_px
            ):
                continue
            report = follow_folder(folder, source, lambda _step: None)
            assert report.score is not None
            scores.append(report.score)
            progress(f"{folder.name}, corners by {source}: {_told(report.score)}{report.failed or ''}")
        plies = sum(score.plies for score in scores)
        unasked = sum(score.right for score in scores) / max(plies, 1)
        wrong = [float(score.wrong) for score in scores]
        share = row([unasked], "1")
        rows[f"photos {source}"] = share.model_copy(update={"limit": least, "holds": unasked >= least, "n": plies})
        rows[f"photos {source} wrong"] = row(wrong, "1", 0.0, "max")
    return rows


def _told(score: Score) -> str:
    return f"{score.plies} plies, {score.right} right, {score.wrong} wrong, {score.asked} asked "
