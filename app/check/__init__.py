"""``touchmove check``: each device of a rig tried alone; what is wrong is named, with what to do about it."""

from app.check.report import CheckReport, Finding, State
from app.check.rig import check_rig

__all__ = ["CheckReport", "Finding", "State", "check_rig"]
