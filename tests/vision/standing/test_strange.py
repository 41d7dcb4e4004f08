"""Something lies on the table of which nobody knows, as what has bounced out of a box; in rendered pictures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import chess
import numpy as np
import pytest

from app.measure.bench.vision.calibration import random_looks, random_mount
from app.pieces.layout import start_layout
from hardware.interfaces import Frame
from hardware.piece_set import PIECE_SHAPES
from hardware.sim.process.table_studio import PlacedPiece
from hardware.table import Captured, PieceSpec, TableSettings, square_place
from tests.vision.rendering import studio_of
from vision.board.view import BoardView
from vision.pieces.misplaced import around_board
from vision.standing.sightings import sightings_of

TABLE = TableSettings(captured=Captured.BOX)
PIECES = start_layout(chess.Board(), TABLE)
BESIDE = 0.02  # nothing lies further beyond the board: there boxes hide it [m]
TOUCHING = 0.003  # what lies so near to another piece is hard to tell from it [m]


def lying(piece: PieceSpec, among: Sequence[PlacedPiece], rng: np.random.Generator, *, close: bool) -> PlacedPiece:
    """Anywhere on the board or just beside it, or just beside another piece."""
    shape, half = PIECE_SHAPES[piece.kind], 4.0 * TABLE.square + BESIDE
    feet = {one.name: PIECE_SHAPES[one.kind].foot_radius for one in PIECES}
    along = np.linspace(0.0, shape.height, 15)[:, None]
    while True:
        (x, y), yaw = rng.uniform(-half, half, 2), rng.uniform(0.0, 2.0 * math.pi)
        axis = np.array([x, y]) + along * np.array([math.sin(yaw), -math.cos(yaw)])
        gap = min(float(np.hypot(*(axis - (one.x, one.y)).T).min()) - feet[one.name] for one in among)
        gap -= 0.8 * shape.foot_radius
        if 0.0 < gap < (TOUCHING if close else math.inf) and float(np.abs(axis).max()) < half:
            return PlacedPiece(piece.name, float(x), float(y), height=shape.foot_radius, yaw=yaw, tip=0.5 * math.pi)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_what_lies_where_nobody_expects_it_is_seen_and_nothing_is_where_nothing_lies(seed: int) -> None:
    rng = np.random.default_rng(seed)
    looks = random_looks(rng, random_mount(rng))
    gone = [piece for piece in PIECES if piece.place.on_board and rng.random() < 0.4]
    squares = iter(rng.permutation(64).tolist())
    expected = {
        square_place(next(squares)) if piece.place.on_board else piece.place: piece
        for piece in PIECES if piece not in gone
    }  # fmt: skip
    poses = []
    for place, piece in expected.items():
        off = 0.003 if place.on_board else 0.008  # reserves may stand anyhow
        x, y = np.array(TABLE.xy(place)) + rng.uniform(-off, off, 2)
        poses.append(PlacedPiece(piece.name, float(x), float(y), yaw=rng.uniform(0.0, 2.0 * math.pi)))
    with studio_of(PIECES, TABLE) as studio:
        view = None
        for close in (None, False, True, True):
            extra = gone[rng.integers(len(gone))]
            lies = [] if close is None else [lying(extra, poses, rng, close=close)]
            frame = studio.frame([*poses, *lies], looks, seed=seed)
            view = view or BoardView(frame.intrinsics, studio.camera_from_board(looks.mount), TABLE)
            strange = sightings_of(frame, view, expected, around_board(view, trays=True)).strange
            assert bool(strange) is bool(lies), f"{extra.name} at {lies}"
            for one in lies:
                middle = 0.5 * PIECE_SHAPES[extra.kind].height * np.array([math.sin(one.yaw), -math.cos(one.yaw)])
                assert all(math.dist(spot, np.array([one.x, one.y]) + middle) < 0.035 for spot in strange)


def with_a_disc(frame: Frame, view: BoardView, radius: float) -> Frame:
    """Something round stands in the middle of the board, 50 mm high: as depth would show it from above."""
    ticks = np.arange(-radius, radius, 0.0004)
    x, y = (one.ravel() for one in np.meshgrid(ticks, ticks))
    disc = np.hypot(x, y) < radius
    points = np.column_stack([x[disc], y[disc], np.full(int(disc.sum()), 0.05)])
    u, v = np.rint(view.project(points)).astype(int).T
    assert frame.depth is not None
    depth = frame.depth.copy()
    depth[v, u] = view.depth(points)
    return replace(frame, depth=depth)


@pytest.mark.parametrize(("radius", "strange"), [(0.012, True), (0.025, True), (0.04, False), (0.06, False)])
def test_what_is_larger_than_a_piece_is_left_alone(radius: float, strange: bool) -> None:
    """A cup is nothing that the arm should push."""
    with studio_of(PIECES, TABLE) as studio:
        rng = np.random.default_rng(3)
        looks = random_looks(rng, random_mount(rng))
        expected = {piece.place: piece for piece in PIECES}
        poses = [PlacedPiece(piece.name, *TABLE.xy(piece.place)) for piece in PIECES]
        frame = studio.frame(poses, looks, seed=3)
        view = BoardView(frame.intrinsics, studio.camera_from_board(looks.mount), TABLE)
        frame = with_a_disc(frame, view, radius)
        assert bool(sightings_of(frame, view, expected, around_board(view, trays=True)).strange) is strange
