"""What depth shows standing, in rendered pictures: every piece once, where it is, as high as its kind, of its side."""

from __future__ import annotations

import math
from dataclasses import replace

import chess
import numpy as np
import pytest

from app.measure.bench.vision.games import Scene, open_studio
from app.pieces.layout import start_layout
from hardware.piece_set import PIECE_SHAPES, Colour
from hardware.sim.process.table_studio import PlacedPiece
from hardware.table import TableSettings
from vision.board.find import find_board
from vision.board.orientation import orient
from vision.board.view import BoardView
from vision.pieces.misplaced import around_board
from vision.standing.sightings import rough_sightings, sightings_of

TABLE = TableSettings()
PIECES = start_layout(chess.Board(), TABLE)


@pytest.fixture(scope="module")
def studio():
    with open_studio(TABLE) as studio:
        yield studio


@pytest.mark.parametrize("seed", range(3))
def test_every_piece_is_seen_once_where_it_stands(studio, seed):
    """Four of them are carried: to empty squares, between two, and into a tray; the other ones are 2 mm off at most."""
    scene = Scene(studio, TABLE, seed)
    poses = {}
    for piece in PIECES:
        (x, y), (dx, dy) = TABLE.xy(piece.place), scene.rng.uniform(-0.002, 0.002, 2)
        poses[piece.name] = PlacedPiece(piece.name, x + dx, y + dy, yaw=float(scene.rng.uniform(-3.0, 3.0)))
    frame = scene.photograph(poses)
    found = orient(frame.colour, find_board(frame.colour).corners, chess.Board())
    view = BoardView.from_corners(frame.intrinsics, found.corners, TABLE)
    names = [
        piece.name for piece in scene.rng.permutation(np.array([p for p in PIECES if p.place.on_board], dtype=object))
    ]
    for name, (x, y) in zip(names, ((-0.1, -0.02), (0.0, 0.0), (0.06, 0.02), (0.19, 0.1)), strict=False):
        poses[name] = PlacedPiece(name, x, y, yaw=float(scene.rng.uniform(-3.0, 3.0)))
    seen = sightings_of(
        scene.photograph(poses), view, {piece.place: piece for piece in PIECES}, around_board(view, trays=True)
    )
    left = list(seen.all)
    for piece in PIECES:
        at = poses[piece.name].x, poses[piece.name].y
        near = [one for one in left if math.dist((one.x, one.y), at) < 0.008]
        if not near and piece.place in seen.hidden:
            continue
        assert len(near) == 1, f"{piece.name} at {at}"
        left.remove(near[0])
        if max(map(abs, at)) < 4.0 * TABLE.square:  # trays may be cut by the picture's edge
            assert near[0].upright
            assert abs(near[0].height - PIECE_SHAPES[piece.kind].height) < 0.005
            assert (near[0].white > 0.0) is (piece.colour is Colour.WHITE)
    assert not left


@pytest.mark.parametrize("blind", [False, True])
def test_nothing_stands_on_an_empty_table_nor_where_there_is_no_depth(studio, blind):
    scene = Scene(studio, TABLE, 5)
    frame = scene.photograph({})
    if blind:
        frame = replace(frame, depth=np.zeros_like(frame.depth))
    view = BoardView(frame.intrinsics, studio.camera_from_board(scene.looks.mount), TABLE)
    assert rough_sightings(frame, view, around_board(view, trays=True)) == []
