"""Where the board is in each picture of a sequence: by labels, or found and followed."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from typing import Protocol

import chess
import numpy as np
from numpy.typing import NDArray

from app.measure.photographs.labels import Labels
from app.measure.photographs.pictures import Picture
from vision.board.anchor import Anchor
from vision.board.find import find_board
from vision.board.orientation import orient
from vision.board.view import BoardNotFound

Array = NDArray[np.float64]


class CornersFrom(StrEnum):
    """Who says where the board is."""

    FIND = "find"
    LABELS = "labels"


class CornerSource(Protocol):
    """Says where the board is in a picture."""

    def corners(self, picture: Picture) -> Array:
        """Outer corners of the playing area a1, h1, h8, a8, shape (4, 2) [px].

        Raises:
            BoardNotFound: nobody can say.
        """


class LabelledCorners:
    """As people marked them."""

    def __init__(self, labels: Labels) -> None:
        self._for_all = labels.corners_px
        self._files = labels.by_file()

    def corners(self, picture: Picture) -> Array:
        """See ``CornerSource``."""
        label = self._files.get(picture.name)
        corners = (label.corners_px if label is not None else None) or self._for_all
        if corners is None:
            raise BoardNotFound("the labels do not say where the board is: use '--corners find'")
        return corners.pixels()


class FoundCorners:
    """Found in the first picture, which shows a known position, and followed from there.

    Args:
        start: what stands in the first picture; it tells how the board is turned.
        progress: told where the corners are less exact than they should be, and what to do.
    """

    def __init__(self, start: chess.Board, progress: Callable[[str], None] = lambda _: None) -> None:
        self._start = start
        self._progress = progress
        self._anchor: Anchor | None = None
        self._shape: tuple[int, ...] = ()

    def corners(self, picture: Picture) -> Array:
        """See ``CornerSource``."""
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
                "the board is there, but which side is White's is not clear: does this picture show the position that "
                "the game starts with?"
            )
        if board.doubt is not None:
            self._progress(f"{picture.name}: {board.doubt}")
        self._anchor, self._shape = Anchor(picture.colour, found.corners), picture.colour.shape
        return found.corners
