"""Any position from what is seen alone: every piece, or a question; never something else."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace

import chess
import numpy as np
import pytest

from app.measure.bench.vision.games import Scene, open_studio
from app.measure.bench.vision.positions import random_board, recognised
from app.pieces.layout import colour_of, kind_of, physical_set, start_layout
from hardware.piece_set import Colour, Kind
from hardware.sim.process.table_studio import PlacedPiece
from hardware.table import Place, TableSettings, square_place
from vision.standing.recognise import recognise

TABLE = TableSettings()


@pytest.fixture(scope="module")
def studio():
    with open_studio(TABLE) as studio:
        yield studio


def pictures(scene, board):
    return [scene.picture(board), scene.picture(), scene.picture()]


@pytest.mark.parametrize("seed", range(300, 303))
def test_what_is_said_is_so_and_next_to_nothing_is_asked(studio, seed):
    board = random_board(seed)
    found = recognised(pictures(Scene(studio, TABLE, seed), board), TABLE)
    asked = {one.place for one in found.pieces if one.instead is not None} | found.lying | found.between
    seen = {one.place: one.look for one in found.pieces if one.place.on_board and one.place not in asked}
    truth = {square_place(at): (colour_of(piece.color), kind_of(piece)) for at, piece in board.piece_map().items()}
    assert seen == {place: look for place, look in truth.items() if place not in asked | found.uncertain}
    assert len([place for place in asked if place.on_board]) < 2
    stands = {piece.place: piece for piece in start_layout(board, TABLE)}
    assert not any(place in stands for place in found.free)


def test_what_lies_or_stands_between_two_squares_is_no_piece_of_the_position(studio):
    board = chess.Board("4k3/8/8/8/8/8/8/4K2Q w - - 0 1")
    scene = Scene(studio, TABLE, 7)
    scene.picture(board)
    poses = dict(scene.table.poses)
    queen = scene.table.standing_on(chess.H1)
    poses[queen] = PlacedPiece(queen, 0.02, 0.0, 0.012, yaw=1.0, tip=math.pi / 2.0)
    found = recognised([scene.photograph(poses) for _ in range(3)], TABLE)
    assert found.lying & {Place.parse(name) for name in ("d4", "e4", "d5", "e5")}
    assert (Colour.WHITE, Kind.QUEEN) not in {one.look for one in found.pieces if one.place.on_board}
    poses[queen] = PlacedPiece(queen, 0.0, 0.02)
    found = recognised([scene.photograph(poses) for _ in range(3)], TABLE)
    assert found.between <= {Place.parse("d5"), Place.parse("e5")}
    assert len(found.between) == 1


def test_an_empty_board_is_seen_to_be_empty(studio):
    scene = Scene(studio, TABLE, 3)
    found = recognised([scene.photograph({}) for _ in range(2)], TABLE)
    assert not found.pieces
    assert not found.lying
    assert not found.uncertain
    assert len(found.free) == len(TABLE.tray_places()) or all(not place.on_board for place in found.free)


def test_without_depth_nothing_is_told(studio):
    scene = Scene(studio, TABLE, 3)
    frame = scene.picture(chess.Board())
    held = Counter((piece.colour, piece.kind) for piece in physical_set())
    with pytest.raises(ValueError, match="depth"):
        recognise([replace(frame, depth=None)], np.eye(4), held)
