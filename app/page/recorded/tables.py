"""The table that a recorded game was played on, as far as its settings say."""

from __future__ import annotations

from pathlib import Path

from app import UserError
from app.page.recorded.catalogue import match_of_record
from app.settings.files import kept_settings
from app.settings.tree import BOARD, SIMULATED
from hardware.table import Captured, TableSettings


def table_of_record(folder: Path) -> TableSettings:
    """Of the record in a folder; the usual table where nothing else is known."""
    try:
        settings = kept_settings(match_of_record(folder))
        if settings.rig.name in (SIMULATED, BOARD) and settings.rig.square is None:
            return TableSettings(captured=settings.rig.captured or Captured.TRAY)
        from app.play.game_setup import rig_setup_of  # what plans takes a second to load, and few need it

        return rig_setup_of(settings.rig, settings.vision.calibration).table
    except UserError:
        return TableSettings()
