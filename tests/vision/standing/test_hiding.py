"""Squares that look empty: a piece that is hidden but for a little is suspected there, and hardly anywhere else."""

from __future__ import annotations

import chess
import pytest

from app.measure.bench.vision.games import Scene, open_studio
from app.measure.bench.vision.positions import random_board
from app.pieces.layout import start_layout
from app.rig.simulation.nominal_view import nominal_view
from hardware.piece_set import Colour
from hardware.sim.process.table_studio import PlacedPiece
from hardware.table import TableSettings, square_place
from vision.board.find import find_board
from vision.board.view import BoardView, playing_area
from vision.pieces.fit import Fit
from vision.pieces.misplaced import around_board
from vision.standing.hiding import hiding_places

TABLE = TableSettings()
SQUARES = [square_place(square) for square in chess.SQUARES]


@pytest.fixture(scope="module")
def studio():
    with open_studio(TABLE) as studio:
        yield studio


def suspected(frame, expected):
    near = nominal_view(frame.intrinsics, TABLE).project(playing_area(TABLE))
    view = BoardView.from_corners(frame.intrinsics, find_board(frame.colour, near=near).corners, TABLE)
    fit = Fit(frame, view, expected, use_depth=True, around=around_board(view, trays=True))
    return hiding_places([place for place in SQUARES if place not in expected], fit, view)


@pytest.mark.parametrize("seed", range(2))
def test_a_pawn_right_behind_a_king_is_suspected_there_and_of_its_side(studio, seed):
    """The camera hangs on Black's side: a king of Black's hides White's pawn on the rank before him."""
    board = chess.Board("8/4p3/8/3k4/3P4/8/4P3/4K3 w - - 0 1")
    scene = Scene(studio, TABLE, seed)
    scene.table.set(board)
    poses = dict(scene.table.poses)
    for square, aside in ((chess.D5, 0.0), (chess.D4, 0.008)):
        name, (x, y) = scene.table.standing_on(square), TABLE.xy(square_place(square))
        poses[name] = PlacedPiece(name, x + aside, y)
    expected = {piece.place: piece for piece in start_layout(board, TABLE)}
    del expected[square_place(chess.D4)]
    assert suspected(scene.photograph(poses), expected)[square_place(chess.D4)] is Colour.WHITE


def test_where_nothing_hides_next_to_nothing_is_suspected(studio):
    count = 0
    for seed in range(60, 66):
        board, scene = random_board(seed), Scene(studio, TABLE, seed)
        expected = {piece.place: piece for piece in start_layout(board, TABLE)}
        count += len(suspected(scene.picture(board), expected))
    assert count <= 4  # of some 280
