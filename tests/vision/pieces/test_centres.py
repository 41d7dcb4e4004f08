"""Centres of pieces, faults of the board: in pictures painted here, and in rendered ones with the camera's errors."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import chess
import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from app.measure.bench.vision.calibration import random_looks, random_mount, random_position
from app.pieces.layout import start_layout
from controller.model.constants import DeltaModel
from controller.model.workspace import seated
from hardware.interfaces import Frame, Intrinsics
from hardware.parameters import load_parameters
from hardware.piece_set import PIECE_SHAPES, Colour, Kind, piece_profile
from hardware.sim.process.table_studio import PlacedPiece, TableStudio
from hardware.sim.render.settings import MountSettings, SceneState
from hardware.table import Captured, PieceSpec, Place, TableSettings, square_place
from tests.vision.rendering import studio_of
from vision.board.view import BoardView
from vision.pieces.centres import piece_centres
from vision.pieces.outline import outline
from vision.pieces.placement_faults import FaultKind, examine_board

TABLE = TableSettings()
PINHOLE = Intrinsics(640, 480, 617.0, 617.0, 319.5, 239.5)
PIECES = [piece for piece in start_layout(chess.Board(), TABLE) if piece.place.on_board]
PAINT = {Colour.WHITE: (205, 180, 140), Colour.BLACK: (40, 30, 25)}


def usual_view() -> BoardView:
    """From beside the eighth rank, 46° down."""
    eye, forward = np.array([0.0, 0.46, 0.44]), np.array([0.0, -0.44, -0.44]) / math.hypot(0.44, 0.44)
    right = np.array([-1.0, 0.0, 0.0])
    axes = np.stack([right, np.cross(forward, right), forward])
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = axes, -axes @ eye
    return BoardView(PINHOLE, pose, TABLE)


def painted(view: BoardView, pieces: dict[int, PieceSpec], places: dict[int, tuple[float, float]]) -> Frame:
    """A flat picture, far pieces first, each drawn ring by ring; four times as fine, then made smaller."""
    fine = np.full((480 * 4, 640 * 4, 3), (120, 125, 130), np.uint8)

    def fill(points: NDArray[np.float64], colour: tuple[int, int, int]) -> None:
        at = np.rint(((view.project(points) + 0.5) * 4.0 - 0.5) * 16.0).astype(np.int32)
        cv2.fillConvexPoly(fine, at, colour, shift=4)

    for square in range(64):
        x, y = TABLE.xy(square_place(square))
        corner = 0.02 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
        fill(corner + np.array([x, y, 0.0]), (225, 210, 175) if (square + square // 8) % 2 else (115, 70, 40))
    circle = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    for square in sorted(pieces, key=lambda one: places[one][1]):
        profile = np.array(piece_profile(pieces[square].kind))
        for height in np.arange(0.0, profile[-1, 1], 0.0004):
            radius = np.interp(height, profile[:, 1], profile[:, 0])
            ring = np.column_stack([radius * np.cos(circle), radius * np.sin(circle), np.full(48, height)])
            fill(ring + np.array([*places[square], 0.0]), PAINT[pieces[square].colour])
    small = np.asarray(cv2.resize(fine, (640, 480), interpolation=cv2.INTER_AREA), dtype=float)
    noise = np.random.default_rng(3).normal(0.0, 3.0, small.shape)
    return Frame(np.clip(small + noise, 0, 255).astype(np.uint8), None, PINHOLE, 0.0)


@pytest.mark.parametrize("seed", [1, 2])
def test_painted_pieces_are_found_to_a_fraction_of_a_millimetre(seed: int) -> None:
    rng, view = np.random.default_rng(seed), usual_view()
    turned = [piece for piece in PIECES if piece.kind is not Kind.KNIGHT]  # a knight's head is not turned
    expected = dict(zip(rng.permutation(64)[: len(turned)].tolist(), turned, strict=True))
    places = {}
    for square in expected:
        x, y = TABLE.xy(square_place(square))
        reach, angle = 0.008 * math.sqrt(rng.random()), rng.uniform(0.0, 2.0 * math.pi)
        places[square] = (x + reach * math.cos(angle), y + reach * math.sin(angle))
    found = piece_centres(painted(view, expected, places), view, expected)
    errors = np.array([math.dist((one.x, one.y), places[square]) for square, one in found.items()])
    assert errors.mean() < 0.4e-3
    assert errors.max() < 1.5e-3
    assert all(one.upright or one.hidden for one in found.values())


def test_outlines_are_as_wide_and_high_as_the_piece() -> None:
    for kind in Kind:
        seen = outline(kind, math.radians(44.0))
        foot = piece_profile(kind)[3][0]
        assert seen.contour[:, 0].max() == pytest.approx(foot, abs=4e-4)
        assert -seen.contour[:, 0].min() == pytest.approx(foot, abs=4e-4)
        assert (seen.normal * seen.contour)[:, 0].sum() > 0.0  # outwards
        np.testing.assert_allclose(np.linalg.norm(seen.normal, axis=1), 1.0, atol=1e-9)


def test_nothing_expected_and_another_camera() -> None:
    view = usual_view()
    frame = painted(view, {}, {})
    assert piece_centres(frame, view, {}) == {}
    assert examine_board(frame, view, {}).faults == ()
    other = BoardView(replace(PINHOLE, fx=600.0), view.camera_from_board, TABLE)
    with pytest.raises(ValueError, match="this view is of"):
        piece_centres(frame, other, {0: PIECES[0]})


# ------------------------------------------------------------------------------------------------------- rendered


@pytest.fixture(scope="module")
def studio() -> Iterator[TableStudio]:
    with studio_of(PIECES) as made:
        yield made


@pytest.mark.slow
def test_rendered_pieces_are_found_within_the_bar(studio: TableStudio) -> None:
    rng = np.random.default_rng(21)
    errors: dict[bool, list[float]] = {True: [], False: []}
    for number in range(3):
        looks = random_looks(rng, random_mount(rng))
        poses, expected = random_position(PIECES, TABLE, rng)
        frame = studio.frame(poses, looks, seed=number)
        view = BoardView(frame.intrinsics, studio.camera_from_board(looks.mount), TABLE)
        for use_depth, all_errors in errors.items():
            found = piece_centres(frame, view, expected, use_depth=use_depth)
            for (square, one), pose in zip(found.items(), poses, strict=True):
                assert list(expected)[poses.index(pose)] == square
                all_errors.append(math.hypot(one.x - pose.x, one.y - pose.y))
                assert one.hidden or one.upright
    for found_errors in errors.values():
        assert np.mean(found_errors) < 1e-3
        assert np.percentile(found_errors, 98) < 2.5e-3
        assert max(found_errors) < 4e-3


@pytest.mark.slow
def test_what_is_wrong_is_told(studio: TableStudio) -> None:
    """A knight off its centre, a pawn missing, a bishop fallen, a pawn between squares, a rook where none should be."""
    expected = {piece.place.index: piece for piece in PIECES}
    names = {square: piece.name for square, piece in expected.items()}
    wrong = {chess.G1: (0.006, 0.0), chess.E7: (0.0, -0.02), chess.A8: (0.12, -0.16)}
    poses = []
    for square, piece in expected.items():
        x, y = TABLE.xy(Place("board", square))
        dx, dy = wrong.get(square, (0.0, 0.0))
        if square == chess.E2:
            continue
        if square == chess.F8:  # lies along the rank, on its flank
            poses.append(PlacedPiece(names[square], x, y - 0.02, height=0.011, yaw=math.pi / 2.0, tip=math.pi / 2.0))
            continue
        poses.append(PlacedPiece(piece.name, x + dx, y + dy, yaw=0.3 * square))
    frame = studio.frame(poses, SceneState(), seed=5)
    view = BoardView(frame.intrinsics, studio.camera_from_board(MountSettings()), TABLE)
    faults = {fault.square: fault for fault in examine_board(frame, view, expected, tolerance=0.004).faults}
    assert faults[chess.E2].sentence == "e2 is empty, a white pawn should stand there"
    assert faults[chess.E2].kind is FaultKind.MISSING
    knight = faults[chess.G1]
    assert knight.kind is FaultKind.OFF_CENTRE
    off = np.subtract(knight.place, TABLE.xy(square_place(chess.G1)))
    assert 1e3 * float(np.hypot(*off)) == pytest.approx(6.0, abs=2.5)
    assert knight.sentence.startswith("the white knight on g1 stands ")
    assert "towards h" in knight.sentence
    assert faults[chess.D4].sentence == "something lies on d4"
    assert chess.A8 in faults
    assert chess.F8 in faults or chess.F7 in faults
    assert chess.E7 in faults or chess.E6 in faults
    untouched = {chess.B1, chess.C1, chess.D1, chess.H1, chess.A2, chess.B2, chess.C2, chess.H2, chess.A7, chess.H7}
    assert not untouched & set(faults)


@pytest.mark.slow
@pytest.mark.parametrize("captured", Captured)
def test_the_arm_at_home_over_a_large_board_is_nothing_that_lies_on_it(captured: Captured) -> None:
    table = TableSettings(square=0.0563, captured=captured)
    heaviest = DeltaModel(load_parameters(), max(shape.mass for shape in PIECE_SHAPES.values()))
    table = seated(heaviest, table)
    board = chess.Board("rnbqkbnr/pppppppp/8/8/8/8/PPP2PPP/RNK2BNR")  # the fingers hang over the middle
    expected = {piece.place.index: piece for piece in start_layout(board, table) if piece.place.on_board}
    poses = [PlacedPiece(piece.name, *table.xy(piece.place)) for piece in expected.values()]
    rng = np.random.default_rng(0)
    with studio_of(list(expected.values()), table) as large:
        for _ in range(8):
            mount = MountSettings(shift=rng.uniform(-0.01, 0.01, 3).tolist(), turn=rng.uniform(-0.02, 0.02, 3).tolist())
            frame = large.frame(poses, SceneState(mount=mount), seed=1)
            view = BoardView(frame.intrinsics, large.camera_from_board(mount), table)
            assert examine_board(frame, view, expected).faults == ()
