"""Following a game in pictures: ``touchmove vision`` over a folder of photographs or a video."""

from app.seeing.corners import CornersFrom
from app.seeing.folder import follow_folder
from app.seeing.report import VisionReport

__all__ = ["CornersFrom", "VisionReport", "follow_folder"]
