"""A piece that lies behind another one, and looks as if it stood, is noticed since it looked otherwise before."""

from __future__ import annotations

from collections.abc import Iterator

import chess
import pytest

from app.measure.bench.vision.actions import ClumsyHands
from app.measure.bench.vision.games import BoardReader, Scene, open_studio, random_game
from app.pieces.layout import start_layout
from hardware.sim.process.table_studio import TableStudio
from hardware.table import TableSettings
from vision.pieces.placement_faults import FaultKind, examine_board

TABLE = TableSettings()
OFF = 0.02
"""Pieces stand up to a fifth of a square off here, which is none of this test's business [m]."""


@pytest.fixture(scope="module")
def studio() -> Iterator[TableStudio]:
    with open_studio(TABLE) as opened:
        yield opened


@pytest.mark.parametrize(("seed", "square"), [(9010, chess.C2), (9061, chess.C2), (9074, chess.G2), (9081, chess.C7)])
def test_a_hidden_piece_that_was_knocked_over_does_not_look_as_it_did(
    studio: TableStudio, seed: int, square: int
) -> None:
    scene, board = Scene(studio, TABLE, seed), chess.Board()
    reader = BoardReader(scene.picture(board), board, TABLE)
    for move in random_game(seed, 6 + seed % 40):
        board.push(move)
    frame = scene.picture(board)
    reader.rectified(frame)
    expected = {piece.place.index: piece for piece in start_layout(board, TABLE) if piece.place.on_board}
    first = examine_board(frame, reader.view, expected, tolerance=OFF)
    assert first.faults == ()
    assert examine_board(scene.picture(), reader.view, expected, first.likeness, tolerance=OFF).faults == ()
    hands = ClumsyHands(scene.table, TABLE, board, scene.rng)
    hands.knock(square)
    knocked = scene.photograph(hands.poses)
    assert examine_board(knocked, reader.view, expected, tolerance=OFF).faults == (), "it is a hidden one"
    (fault,) = examine_board(knocked, reader.view, expected, first.likeness, tolerance=OFF).faults
    assert (fault.kind, fault.square) == (FaultKind.FALLEN, square)
    assert "does not look as it did" in fault.sentence
