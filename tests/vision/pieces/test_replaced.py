"""A piece put in the place of one of its own side: what colours cannot tell, outlines and places can."""

from __future__ import annotations

from collections.abc import Iterator

import chess
import numpy as np
import pytest

from app.pieces.layout import start_layout
from hardware.sim.process.table_studio import PlacedPiece, TableStudio
from hardware.sim.render.settings import SceneState
from hardware.table import PieceSpec, Place, TableSettings
from tests.vision.rendering import studio_of
from vision.board.view import BoardView
from vision.pieces.swapped import KnownPicture, looked_closer, replaced
from vision.reading.diagnosis import Diagnosis, explain
from vision.reading.outcome import Situation

pytestmark = pytest.mark.slow
TABLE = TableSettings()
BOARD = chess.Board()
SPECS = {str(spec.place): spec for spec in start_layout(BOARD, TABLE)}
EXPECTED = {spec.place.index: spec for spec in SPECS.values() if spec.place.on_board}


@pytest.fixture(scope="module")
def studio() -> Iterator[TableStudio]:
    with studio_of(tuple(SPECS.values())) as made:
        yield made


def pictures(
    studio: TableStudio, start: str, end: str | None, off: tuple[float, float]
) -> tuple[KnownPicture, KnownPicture]:
    """Before and after a piece has left its square, for another one or for good; what stood there is gone as well."""
    rng = np.random.default_rng(3)
    poses = {}
    for square, spec in SPECS.items():
        x, y = (np.array(TABLE.xy(spec.place)) + rng.uniform(-0.002, 0.002, 2)).tolist()
        poses[square] = PlacedPiece(spec.name, x, y, yaw=float(rng.uniform(-3.0, 3.0)))
    first = studio.frame(poses.values(), SceneState(), 1)
    moved: PieceSpec = SPECS[start]
    del poses[start]
    if end is not None:
        x, y = TABLE.xy(Place.parse(end))
        poses[end] = PlacedPiece(moved.name, x + off[0], y + off[1], yaw=0.3)
    second = studio.frame(poses.values(), SceneState(), 2)
    view = BoardView(first.intrinsics, studio.camera_from_board(SceneState().mount), TABLE)
    return KnownPicture(first, view), KnownPicture(second, view)


@pytest.mark.parametrize(
    ("start", "end", "off"),
    [
        ("b1", "f1", (0.003, 0.001)),
        ("b1", "g1", (-0.004, 0.003)),
        ("c1", "f1", (0.0, 0.005)),
        ("a8", "b8", (0.002, -0.003)),
    ],
)
def test_the_square_is_found_also_of_a_twin(
    studio: TableStudio, start: str, end: str, off: tuple[float, float]
) -> None:
    before, now = pictures(studio, start, end, off)
    found = replaced(before, now, EXPECTED, chess.parse_square(start))
    assert found[:1] == (chess.parse_square(end),)


@pytest.mark.parametrize("start", ["b1", "d2", "h8", "e7"])
def test_where_a_piece_is_only_gone_none_is_suspected(studio: TableStudio, start: str) -> None:
    before, now = pictures(studio, start, None, (0.0, 0.0))
    assert replaced(before, now, EXPECTED, chess.parse_square(start)) == ()


def test_the_sentence_names_both_squares_and_other_findings_stay(studio: TableStudio) -> None:
    before, now = pictures(studio, "b1", "g1", (0.004, 0.0))
    seen = np.array(
        [0 if (piece := BOARD.piece_at(square)) is None else 1 if piece.color else 2 for square in range(64)]
    )
    seen[chess.B1] = 0
    missing = explain(seen, BOARD)
    assert missing.situation is Situation.MISSING
    closer = looked_closer(missing, seen, BOARD, before, now, EXPECTED)
    assert closer.squares == (chess.B1, chess.G1)
    assert "it may stand on g1" in closer.sentence
    other = Diagnosis(Situation.EXTRA, (chess.E4,), "there is something on e4")
    assert looked_closer(other, seen, BOARD, before, now, EXPECTED) is other
