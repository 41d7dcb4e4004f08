"""Where the board is in the pictures, while a game is followed."""

from __future__ import annotations

from typing import Any, cast

import chess
import pytest

from app.execution.observation import GameObserver
from app.execution.state import CannotSee, Devices
from hardware.interfaces import Frame, Intrinsics
from hardware.table import TableSettings
from tests.vision.drawing import START, Drawing, draw, pose
from vision.board.view import BoardView

SIZE = (640, 480)
FOCAL = 1.2 * SIZE[0]
"""Of the camera that ``pose`` has."""


class Still:
    """Camera, arm and clock of a table that is photographed; all stand still."""

    def __init__(self, shown: Frame) -> None:
        self.shown = shown

    def read(self, max_age: float) -> Frame:
        return self.shown

    def state(self) -> None:
        return None

    def now(self) -> float:
        return self.shown.stamp


def picture(tilt: float, stamp: float, believed: float) -> Frame:
    """The start position seen at a tilt by a webcam whose focal length is believed to be so much [px]."""
    pinhole = Intrinsics(*SIZE, believed, believed, 319.5, 239.5)
    return Frame(draw(pose(tilt, 0.1, 0.7, SIZE), START, Drawing()), None, pinhole, stamp)


def following(still: Still, believed: BoardView | None = None) -> GameObserver:
    observer = GameObserver(
        Devices(*(cast(Any, still) for _ in range(3)), None), TableSettings(), lambda _pinhole: believed
    )
    observer.begin(chess.Board())
    return observer


def test_a_camera_that_was_turned_is_followed() -> None:
    still = Still(picture(0.35, 1.0, FOCAL))
    observer = following(still)
    before = observer.view
    still.shown = picture(0.6, 2.0, FOCAL)
    observer.read()
    assert observer.view is not before


def test_a_wrong_focal_length_that_shows_only_once_the_camera_was_turned_is_said() -> None:
    still = Still(picture(0.35, 1.0, 1.2 * FOCAL))
    observer = following(still)
    before = observer.view
    still.shown = picture(0.6, 2.0, 1.2 * FOCAL)
    with pytest.raises(CannotSee, match=r"camera or board have moved: .* or check the intrinsics"):
        observer.read()
    assert observer.view is before
    still.shown = picture(0.35, 3.0, 1.2 * FOCAL)
    observer.read()  # turned back, all is well again
