"""The record of a game on the disk: events, PGN and report."""

from __future__ import annotations

from app.records.events import EndEvent, PlyEvent, StartEvent, read_events
from app.records.files import RecordError, new_folder, recording
from app.records.game import GameRecord, GameSetup, PlyOutcome, utc_now
from app.records.report import Report, summarise

__all__ = [
    "EndEvent",
    "GameRecord",
    "GameSetup",
    "PlyEvent",
    "PlyOutcome",
    "RecordError",
    "Report",
    "StartEvent",
    "new_folder",
    "read_events",
    "recording",
    "summarise",
    "utc_now",
]
