"""Where the board is in the pictures, and what is said of it, while a game is followed."""

from __future__ import annotations

import random
from collections.abc import Iterator
from typing import Any, cast

import chess
import pytest

from app.execution.observation import GameObserver
from app.execution.state import AwaitedReply, CannotSee, Devices
from app.measure.bench.vision.games import Scene, open_studio, random_game
from app.rig.simulation.nominal_view import nominal_view
from hardware.interfaces import Frame, Intrinsics
from hardware.sim.process.table_studio import TableStudio
from hardware.table import TableSettings
from tests.app.execution.test_toppled import Still
from tests.vision.drawing import START, Drawing, draw, pose
from vision.board.view import BoardView
from vision.reading.outcome import Situation

SIZE, TABLE = (640, 480), TableSettings()
FOCAL = 1.2 * SIZE[0]
"""Of the camera that ``pose`` has."""


def picture(tilt: float, stamp: float, believed: float) -> Frame:
    """The start position seen at a tilt by a webcam whose focal length is believed to be so much [px]."""
    pinhole = Intrinsics(*SIZE, believed, believed, 319.5, 239.5)
    return Frame(draw(pose(tilt, 0.1, 0.7, SIZE), START, Drawing()), None, pinhole, stamp)


@pytest.fixture(scope="module")
def studio() -> Iterator[TableStudio]:
    with open_studio(TABLE) as opened:
        yield opened


def following(still: Still, believed: BoardView | None = None) -> GameObserver:
    observer = GameObserver(Devices(*(cast(Any, still) for _ in range(3)), None), TABLE, lambda _pinhole: believed)
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


@pytest.mark.parametrize("seed", [4301, 4304, 4312])
def test_the_arms_own_move_that_nobody_has_looked_at_belies_nothing(studio: TableStudio, seed: int) -> None:
    """A reply may be made before anybody looks: the picture before it is then older than the position. What the arm has
    moved looks changed, and is no sign that a piece which is missing stands there.
    """

    rng, scene, board = random.Random(seed), Scene(studio, TABLE, seed), chess.Board()
    for move in random_game(seed, 2 * (seed % 11)):
        board.push(move)
    still = Still(scene.picture(board))
    observer = GameObserver(
        Devices(*(cast(Any, still) for _ in range(3)), None), TABLE, lambda pinhole: nominal_view(pinhole, TABLE)
    )
    observer.begin(board)
    arms, after = rng.choice(list(board.legal_moves)), board.copy()
    after.push(arms)
    own = after.occupied_co[board.turn] & ~after.kings & ~chess.BB_SQUARES[arms.to_square]
    gone = rng.choice(list(chess.SquareSet(own)))
    shown = after.copy()
    shown.remove_piece_at(gone)
    still.shown = scene.picture(shown)
    observer.frame()
    assert not observer.answered(AwaitedReply(after))
    finding = observer.read().finding
    assert (finding.situation, finding.squares) == (Situation.MISSING, (gone,))
