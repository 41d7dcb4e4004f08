"""What has fallen into a box, in rendered pictures with the camera's errors."""

from __future__ import annotations

import chess
import numpy as np
import pytest

from app.measure.bench.vision.calibration import random_looks, random_mount
from app.pieces.layout import start_layout
from hardware.piece_set import PIECE_SHAPES
from hardware.sim.bodies.scene import LINING
from hardware.sim.process.table_studio import PlacedPiece
from hardware.table import Box, Captured, PieceSpec, TableSettings
from tests.vision.rendering import studio_of
from vision.board.view import BoardView
from vision.pieces.boxes import holds_more
from vision.pieces.swapped import KnownPicture

TABLE = TableSettings(captured=Captured.BOX)
PIECES = [piece for piece in start_layout(chess.Board(), TABLE) if piece.place.on_board]


def lying(piece: PieceSpec, box: Box, rng: np.random.Generator) -> PlacedPiece:
    """Anyhow within the walls, on the lining."""
    shape, yaw = PIECE_SHAPES[piece.kind], rng.uniform(0.0, 2.0 * np.pi)
    along = np.array([np.sin(yaw), -np.cos(yaw)])
    room = np.array([box.half_x, box.half_y]) - 0.5 * shape.height * np.abs(along) - shape.foot_radius
    middle = np.array([box.x, box.y]) + rng.uniform(-1.0, 1.0, 2) * np.maximum(room, 0.0)
    x, y = (middle - 0.5 * shape.height * along).tolist()
    return PlacedPiece(piece.name, x, y, height=LINING + shape.foot_radius, yaw=yaw, tip=0.5 * np.pi)


@pytest.mark.slow
def test_what_comes_into_a_box_is_mostly_seen_and_never_where_nothing_came() -> None:
    rng, seen, invented = np.random.default_rng(7), [], []
    with studio_of(PIECES, TABLE) as studio:
        for number in range(6):
            looks = random_looks(rng, random_mount(rng))
            boxed = [one for one in PIECES if rng.random() < 0.3]
            rest = [one for one in PIECES if one not in boxed]
            new = [rest.pop(rng.integers(len(rest))) for _ in range(3)]
            poses = [lying(one, TABLE.boxes()[rng.integers(2)], rng) for one in boxed]
            poses += [PlacedPiece(one.name, *TABLE.xy(one.place)) for one in rest]
            frame = studio.frame(poses, looks, seed=number)
            view = BoardView(frame.intrinsics, studio.camera_from_board(looks.mount), TABLE)
            before = KnownPicture(frame, view)
            for piece in new:
                side = int(rng.integers(2))
                now = studio.frame([*poses, lying(piece, TABLE.boxes()[side], rng)], looks, seed=number)
                found = [holds_more(before, KnownPicture(now, view), box) for box in TABLE.boxes()]
                seen.append(found[side])
                invented.append(found[1 - side])
    assert np.mean(seen) > 0.5
    assert not any(invented)
