"""What a worker is told: a task, and what it takes to play it the same as everywhere."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path

from app.campaign.environment import CampaignEnvironment
from app.campaign.task import CampaignTask
from hardware.frozen import Frozen


class Kept(StrEnum):
    """Folders of which games are kept."""

    ALL = "all"
    FAILED = "failed"
    NONE = "none"


class TaskOrder(Frozen):
    """What a worker is told."""

    task: CampaignTask
    environment: CampaignEnvironment
    engines: tuple[str, ...]
    """See ``environment_here``."""
    run: str = ""
    """Of which call of the command; what a worker has found out about itself holds for that one."""
    keep: Kept = Kept.FAILED
    folder: Path | None = None
    """Of the campaign, where games are kept; None: nowhere."""
    film: bool = False
