"""The record of a game on the disk: events, PGN and report."""

from __future__ import annotations

from app.records.events import EndEvent, GameSetup, PlyEvent, PlyOutcome, StartEvent, StepEvent
from app.records.files import EVENTS_FILE, RecordError, new_folder, recording
from app.records.game import FRAMES, GameRecord, utc_now
from app.records.history import History, read_events, read_history
from app.records.report import Report, summarise
from app.records.robot import ROBOT_FILE, RobotRecord, kept_robot

__all__ = [
    "EVENTS_FILE", "FRAMES", "ROBOT_FILE", "EndEvent", "GameRecord", "GameSetup", "History", "PlyEvent", "PlyOutcome",
    "RecordError", "Report", "RobotRecord", "StartEvent", "StepEvent", "kept_robot", "new_folder", "read_events",
    "read_history", "recording", "summarise", "utc_now",
]  # fmt: skip
