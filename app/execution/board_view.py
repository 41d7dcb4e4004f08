"""Where the board is in a camera's first picture."""

from __future__ import annotations

import chess

from app.execution.state import CannotSee
from hardware.interfaces import Frame
from hardware.table import TableSettings
from vision.board.find import find_board
from vision.board.orientation import orient
from vision.board.view import BoardNotFound, BoardView, playing_area


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
                    "the pieces do not tell which side of the board is White's: set the position up, or calibrate the "
                    "camera with 'touchmove calibrate'"
                )
            corners = turned.corners
        return BoardView.from_corners(frame.intrinsics, corners, table)
    except BoardNotFound as error:
        raise CannotSee(f"the camera does not see the board: {error}") from error
