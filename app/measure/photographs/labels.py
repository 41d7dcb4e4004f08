"""What people know of the pictures in a folder: ``labels.json``.

Corners, moves and positions by hand, in the forms ``chess-seq/1`` (a settled picture a frame) and ``chess-video/1``.
More may stand in the file than is read here.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Final, Literal

import chess
import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from app import UserError
from vision.arrays import Array
from vision.board.view import CORNER_NAMES

FILE_NAME: Final = "labels.json"

Point = tuple[float, float]


def _position(fen: str) -> str:
    try:
        chess.Board(fen)
    except ValueError as error:
        raise ValueError(f"'{fen}' is not a position: {error}") from error
    return fen


Fen = Annotated[str, AfterValidator(_position)]


def _move(uci: str) -> str:
    try:
        chess.Move.from_uci(uci)
    except ValueError as error:
        raise ValueError(f"'{uci}' is not a move: write it as from square and to square, such as e2e4") from error
    return uci


Uci = Annotated[str, AfterValidator(_move)]


class _Read(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore", allow_inf_nan=False)


class Corners(_Read):
    """Outer corners of the playing area [px]."""

    a1: Point
    h1: Point
    h8: Point
    a8: Point

    def pixels(self) -> Array:
        """In the order of ``vision.board.view.CORNER_NAMES``, shape (4, 2)."""
        return np.array([getattr(self, name) for name in CORNER_NAMES])


class FrameLabel(_Read):
    """One picture of a sequence."""

    file: str
    moves_since_previous: tuple[Uci, ...] = ()
    fen: Fen | None = None  # the position after them
    corners_px: Corners | None = None


class Interval(_Read):
    """Frames of a video in which nothing moves, both ends included."""

    ply: int
    first_frame: int
    last_frame: int
    fen: Fen


class Labels(_Read):
    """All that is known."""

    schema_: Literal["chess-seq/1", "chess-video/1"] = Field(alias="schema")
    initial_fen: Fen = chess.STARTING_FEN
    corners_px: Corners | None = None
    frames: tuple[FrameLabel, ...] = ()
    video: str | None = None
    fps: float | None = None
    stable_intervals: tuple[Interval, ...] = ()
    moves_uci: tuple[Uci, ...] = ()

    def of_view(self, name: str, played: int) -> FrameLabel | None:
        """What is known of a settled view, None where nothing is.

        ``name``: its file's or, of a video, the number of the frame; ``played``: so many plies were played before it.
        """
        if self.video is None:
            return self.by_file().get(name)
        for one in self.stable_intervals:
            if one.first_frame <= int(name) <= one.last_frame:
                return FrameLabel(file=name, moves_since_previous=self.moves_uci[played : one.ply], fen=one.fen)
        return None

    def by_file(self) -> Mapping[str, FrameLabel]:
        """Pictures by the name of their file."""
        return {frame.file: frame for frame in self.frames}


def load_labels(folder: Path) -> Labels | None:
    """What ``labels.json`` of a folder says, None where there is none.

    Raises:
        UserError: it cannot be read, or says what cannot be.
    """
    path = folder / FILE_NAME
    if not path.exists():
        return None
    try:
        return Labels.model_validate(json.loads(path.read_text(encoding="utf-8")))
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"])) or "labels"
        raise UserError(f"{path}: {place}: {first['msg']}: correct it, or move the file away") from error
    except (OSError, ValueError, RecursionError) as error:
        raise UserError(f"{path} cannot be read: {error}: correct it, or move the file away") from error
