"""Following a game in pictures: ``touchmove vision`` over a folder of photographs or a video."""

from app.measure.photographs.folder import CornersFrom, follow_folder
from app.measure.photographs.follow import VisionReport

__all__ = ["CornersFrom", "VisionReport", "follow_folder"]
