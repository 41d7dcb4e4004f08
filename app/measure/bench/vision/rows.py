"""Bench ``vision``: whether the camera can be trusted with the state of the game."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from app.measure.bench.report import BenchReport, Progress, Row
from app.measure.bench.vision.actions import action_rows
from app.measure.bench.vision.calibration import calibration_rows, centre_rows
from app.measure.bench.vision.games import game_rows, trouble_rows
from app.measure.bench.vision.hands import hand_rows
from app.measure.bench.vision.photos import VARIABLE, find_rows, photo_folder, photo_rows
from app.measure.bench.vision.positions import position_rows
from app.measure.bench.vision.turns import turn_rows

RENDERED: Final = (game_rows, trouble_rows, action_rows, centre_rows, position_rows)
WHOLE_RIG: Final = (calibration_rows, hand_rows, turn_rows)  # start a world and a controller; too slow for ``quick``


def vision_bench(quick: bool, progress: Progress, photos: Path | None = None) -> BenchReport:
    """Run the bench; ``quick``: few pictures, no whole rig and no photographs: ends within a minute.

    ``photos``: folder with labelled photographs; where there is none, its rows are left out, and it is said why.
    """
    rows: dict[str, Row] = {}
    for part in RENDERED if quick else (*RENDERED, *WHOLE_RIG):
        rows |= part(quick, progress)
    folder = photo_folder(photos)
    if quick or folder is None:
        progress(f"photographs are left out: give --photos DIR or set {VARIABLE}, and not --quick")
    else:
        rows |= photo_rows(folder, progress)
        rows |= find_rows(folder, progress)
    return BenchReport.of("vision", 0, rows)
