"""A folder with a game: pictures of it one by one, or a video; and where the board is in each of them."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterator
from enum import StrEnum
from pathlib import Path
from typing import Final

import chess

from app import UserError
from app.measure.photographs.follow import CornerSource, VisionReport, follow
from app.measure.photographs.labels import Labels, load_labels
from app.measure.photographs.pictures import VIDEOS, Picture, picture_files, read_picture, read_video
from app.records import EVENTS_FILE, FRAMES, read_events
from app.records.events import StartEvent
from app.records.history import counted_plies
from vision.arrays import Array
from vision.board.find import find_board
from vision.board.moved import Anchor
from vision.board.orientation import orient
from vision.board.view import BoardNotFound
from vision.hands.hand_and_motion import VideoGate

LOOKED_THROUGH: Final = 200  # first frames of a video in which the board is looked for: hands may be over it at first
_PLY: Final = re.compile(r"ply-(\d+)")
EVERY: Final = 5
"""One in so many of them is tried."""


class CornersFrom(StrEnum):
    """Who says where the board is."""

    FIND = "find"
    LABELS = "labels"


def follow_folder(folder: Path, corners_from: CornersFrom, progress: Callable[[str], None]) -> VisionReport:
    """Follow the game in a folder; ``labels.json`` in it answers where it must be asked, and keeps the score.

    The folder has pictures in the order of their names, each a settled view; or one video; or it is that of a recorded
    game, or of its frames. ``corners_from``: who says where the board is.

    Raises:
        UserError: there is nothing to be followed, or the labels are wrong.
    """
    folder = folder / FRAMES if (folder / EVENTS_FILE).exists() and (folder / FRAMES).is_dir() else folder
    labels = load_labels(folder)
    if corners_from is CornersFrom.LABELS and labels is None:
        raise UserError(f"{folder} has no labels.json with the board's corners: use '--corners find'")
    start = chess.Board(labels.initial_fen) if labels is not None else _recorded_start(folder) or chess.Board()
    marked = labels if corners_from is CornersFrom.LABELS else None
    source = labelled_corners(marked) if marked is not None else FoundCorners(start, progress)
    video = _video(folder, labels)
    if video is not None:
        views = _settled(video, labels.fps if labels is not None else None, source)
    else:
        views = map(read_picture, picture_files(folder))
    return follow(views, labels, source, progress, start)


def labelled_corners(labels: Labels) -> CornerSource:
    """As people marked them."""
    files = labels.by_file()

    def corners(picture: Picture) -> Array:
        label = files.get(picture.name)
        found = (label.corners_px if label is not None else None) or labels.corners_px
        if found is None:
            raise BoardNotFound("the labels do not say where the board is: use '--corners find'")
        return found.pixels()

    return corners


class FoundCorners:
    """Found in the first picture, which shows the position ``start``, and followed from there.

    ``progress`` is told where the corners are less exact than they should be, and what to do.
    """

    def __init__(self, start: chess.Board, progress: Callable[[str], None]) -> None:
        self._start, self._progress = start, progress
        self._anchor: Anchor | None = None
        self._shape: tuple[int, ...] = ()

    def __call__(self, picture: Picture) -> Array:
        """As a ``CornerSource``."""
        if self._anchor is None:
            return self._begin(picture)
        if picture.colour.shape != self._shape:
            raise BoardNotFound(
                f"this picture has {picture.colour.shape[1]}x{picture.colour.shape[0]} pixels and the first one had "
                f"{self._shape[1]}x{self._shape[0]}: take all of them with one camera"
            )
        check = self._anchor.follow(picture.colour)
        if check.moved:
            self._anchor = Anchor(picture.colour, check.corners)
        # where too little of the board is seen to tell, it is taken to be where it was; the squares then tell otherwise
        return check.corners

    def _begin(self, picture: Picture) -> Array:
        board = find_board(picture.colour)
        found = orient(picture.colour, board.corners, self._start)
        if not found.sure:
            raise BoardNotFound(
                "the board was found, but it is not clear which side is White's: does this picture show the initial "
                "position of the game?"
            )
        if board.doubt is not None:
            self._progress(f"{picture.name}: {board.doubt}")
        self._anchor, self._shape = Anchor(picture.colour, found.corners), picture.colour.shape
        return found.corners


def _recorded_start(folder: Path) -> chess.Board | None:
    """The position that the first frame of a recorded game shows; None: these are no frames of one."""
    events = folder.parent / EVENTS_FILE
    if folder.name != FRAMES or not events.exists():
        return None
    recorded = read_events(events)
    start = recorded[0]
    assert isinstance(start, StartEvent), "a record begins with its start"
    board = chess.Board(start.fen, chess960=start.chess960)
    first = _PLY.search(picture_files(folder)[0].name)
    for ply in counted_plies(recorded)[: int(first[1]) if first is not None else 0]:
        board.push_uci(ply.uci)
    return board


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
            raise UserError(f"{folder} holds several videos, {names}: put each into its own folder") from None
        return videos[0] if videos else None
    return None


def _settled(path: Path, fps: float | None, source: CornerSource) -> Iterator[Picture]:
    """The settled views of a video, by its own frame times."""
    trouble: BoardNotFound | None = None
    for picture in itertools.islice(read_video(path, fps), 0, LOOKED_THROUGH, EVERY):
        try:
            gate = VideoGate(source(picture))
            break
        except BoardNotFound as error:
            trouble = error
    else:
        raise UserError(f"the board was not found in the first {LOOKED_THROUGH} frames of {path.name}: {trouble}")
    for picture in read_video(path, fps):
        view = gate.update(picture.colour, picture.stamp)
        if view is not None:
            yield Picture(picture.name, view.colour, view.stamp)
