"""A folder with a game: pictures of it one by one, or a video."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

import chess

from app import UserError
from app.measure.photographs.corners import CornersFrom, CornerSource, FoundCorners, LabelledCorners
from app.measure.photographs.follow import follow
from app.measure.photographs.labels import Labels, load_labels
from app.measure.photographs.pictures import VIDEOS, Picture, picture_files, read_picture, read_video
from app.measure.photographs.report import VisionReport
from vision.board.view import BoardNotFound
from vision.hands.stillness import VideoGate

LOOKED_THROUGH: Final = 200
"""Frames at the beginning of a video in which the board is looked for: hands may be over it at first."""
EVERY: Final = 5
"""Every so manyth of them is tried."""


def follow_folder(folder: Path, corners_from: CornersFrom, progress: Callable[[str], None]) -> VisionReport:
    """Follow the game in a folder; ``labels.json`` in it answers where it must be asked, and keeps the score.

    Args:
        folder: with pictures in the order of their names, each a settled view; or with one video.
        corners_from: who says where the board is.
        progress: told what is being done.

    Raises:
        UserError: there is nothing to be followed, or the labels are wrong.
    """
    labels = load_labels(folder)
    if corners_from is CornersFrom.LABELS and labels is None:
        raise UserError(f"{folder} has no labels.json that says where the board is: use '--corners find'")
    start = chess.Board(labels.initial_fen) if labels is not None else chess.Board()
    marked = labels if corners_from is CornersFrom.LABELS else None
    source = LabelledCorners(marked) if marked is not None else FoundCorners(start, progress)
    video = _video(folder, labels)
    if video is not None:
        views = _settled(video, labels.fps if labels is not None else None, source)
        return follow(views, labels, source, progress)
    files = picture_files(folder)
    return follow(map(read_picture, files), labels, source, progress)


def _video(folder: Path, labels: Labels | None) -> Path | None:
    """The folder's video; its pictures come first where there are both."""
    if labels is not None and labels.video is not None:
        return folder / labels.video
    try:
        picture_files(folder)
    except UserError:
        if not folder.is_dir():
            raise
        videos = sorted(one for one in folder.iterdir() if one.suffix.lower() in VIDEOS)
        if len(videos) > 1:
            names = ", ".join(one.name for one in videos)
            raise UserError(f"{folder} holds several videos, {names}: put each into a folder of its own") from None
        return videos[0] if videos else None
    return None


def _settled(path: Path, fps: float | None, source: CornerSource) -> Iterator[Picture]:
    """The settled views of a video, by its own frame times."""
    corners = None
    trouble: BoardNotFound | None = None
    for picture in itertools.islice(read_video(path, fps), 0, LOOKED_THROUGH, EVERY):
        try:
            corners = source.corners(picture)
            break
        except BoardNotFound as error:
            trouble = error
    if corners is None:
        raise UserError(f"the board is not found in the first {LOOKED_THROUGH} frames of {path.name}: {trouble}")
    gate = VideoGate(corners)
    for picture in read_video(path, fps):
        view = gate.update(picture.colour, picture.stamp)
        if view is not None:
            yield Picture(picture.name, view.colour, view.stamp)
