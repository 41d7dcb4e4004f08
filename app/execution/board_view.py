"""Where the board is in a camera's first picture, and what a look at it came to."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import chess

from app.execution.state import CannotSee
from app.terminal.shown import LookShown
from hardware.interfaces import Frame
from hardware.table import TableSettings
from vision.arrays import Array
from vision.board.find import find_board
from vision.board.orientation import orient
from vision.board.view import BoardNotFound, BoardView, playing_area, square_corners
from vision.reading.diagnosis import Diagnosis
from vision.reading.moves import MoveReading
from vision.reading.observer import Observation
from vision.reading.outcome import ReadingOutcome


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """One look at the board.

    Attributes:
        decision: what was played since the known position, or doubt.
        finding: what is the matter, and what to do; for people.
        look: to be confirmed.
    """

    decision: MoveReading
    finding: Diagnosis
    look: Observation


def find_view(frame: Frame, board: chess.Board | None, table: TableSettings, view: BoardView | None) -> BoardView:
    """The board in a frame; where it should be, it is only refined, and the robot's side of it is known.

    Args:
        frame: of the board, with all of it in sight.
        board: the position that stands there; None: nobody knows.
        table: board and trays.
        view: where the board should be; None: nobody knows.

    Raises:
        CannotSee: it is not there, or the pieces do not tell which side is White's.
    """
    near = None if view is None else view.project(playing_area(table))
    try:
        found = find_board(frame.colour, near=near)
        corners = found.corners
        if near is None:
            turned = None if board is None else orient(frame.colour, corners, board)
            if turned is None or not turned.sure:
                raise CannotSee(
                    "the pieces do not show which side of the board is White's: set up the position, or calibrate the "
                    "camera with 'touchmove calibrate'"
                )
            corners = turned.corners
        return BoardView.from_corners(frame.intrinsics, corners, table)
    except BoardNotFound as error:
        raise CannotSee(f"the camera does not see the board: {error}") from error


def look_shown(
    frame: Frame, view: BoardView, outcome: ReadingOutcome, text: str, squares: Iterable[chess.Square],
    likelihood: Array,
) -> LookShown:  # fmt: skip
    """What people are shown of a look: ``text`` is about some squares, ``likelihood`` as ``Evidence.likelihood``."""
    grid = view.project(square_corners(view.table))
    names = tuple(chess.square_name(square) for square in squares)
    return LookShown(frame.colour, frame.stamp, outcome.value, text, likelihood, grid, names)
