"""What stands up from the board, by depth: drawn blocks, whose points are where they stand and nowhere else."""

from __future__ import annotations

import chess
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hardware.interfaces import Frame, Intrinsics
from hardware.table import TableSettings
from tests.vision.views import looking_at
from vision.appearance import BLACK, EMPTY, WHITE
from vision.board import BoardView
from vision.evidence import codes_of, states_of
from vision.kinds import Kinds
from vision.moves import Decision
from vision.solids import CEILING, Solids, solids_of
from vision.standing import Standing
from vision.verdict import Verdict

PINHOLE = Intrinsics(640, 480, 615.0, 615.0, 319.5, 239.5)
TABLE = TableSettings()


def view_from(y: float, z: float) -> BoardView:
    """A camera over the board's middle line that looks at its centre."""
    return BoardView(PINHOLE, looking_at((0.0, y + 1e-6, z), (0.0, 0.0, 0.0)), TABLE)


def scene(view: BoardView, blocks: dict[int, tuple[float, int]], hole: bool = False) -> Frame:
    """Depth of the board's plane and of blocks half a square wide: square → (height [m], brightness)."""
    rotation, shift = view.camera_from_board[:3, :3], view.camera_from_board[:3, 3]
    eye = -rotation.T @ shift
    u, v = np.meshgrid(np.arange(640.0), np.arange(480.0))
    rays = np.stack([(u - PINHOLE.cx) / PINHOLE.fx, (v - PINHOLE.cy) / PINHOLE.fy, np.ones_like(u)], axis=-1)
    rays = rays @ rotation  # in the board frame; the third coordinate in the camera stays 1
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.where(rays[..., 2] < 0.0, -eye[2] / rays[..., 2], 0.0)
        colour = np.full((480, 640, 3), 120, np.uint8)
        for square, (height, shade) in blocks.items():
            x, y = (square % 8 - 3.5) * TABLE.square, (square // 8 - 3.5) * TABLE.square
            half = TABLE.square / 4.0
            low, high = np.array([x - half, y - half, 0.0]), np.array([x + half, y + half, height])
            one, two = (low - eye) / rays, (high - eye) / rays
            enter, leave = np.minimum(one, two).max(axis=-1), np.maximum(one, two).min(axis=-1)
            hit = (enter < leave) & (enter > 0.0) & ((enter < depth) | (depth == 0.0))
            depth, colour = np.where(hit, enter, depth), np.where(hit[..., None], np.uint8(shade), colour)
    if hole:
        depth[:, 300:330] = 0.0
    return Frame(colour, depth.astype(np.float32), PINHOLE, 0.0)


@settings(max_examples=25, deadline=None)
@given(
    st.floats(0.0, 0.45), st.floats(0.4, 0.7),
    st.dictionaries(st.integers(0, 63), st.tuples(st.floats(0.03, 0.06), st.integers(20, 230)), max_size=12),
)  # fmt: skip
def test_blocks_stand_where_they_are_and_are_as_high_as_they_are(y, z, blocks):
    solids = solids_of(scene(view_from(y, z), blocks), view_from(y, z))
    for square in range(64):
        if square not in blocks:
            # a point right at an edge may be a block's that stands next to it
            assert solids.standing[square] <= 0.02 * max(solids.seen[square], 50)
        elif solids.standing[square] > 60:
            height, shade = blocks[square]
            assert solids.top[square] == pytest.approx(height, abs=0.004)
            assert np.exp(solids.colour[square]) - 0.08 == pytest.approx(shade / 255.0, abs=0.02)


def test_what_is_above_any_piece_is_no_piece():
    view = view_from(0.0, 0.6)
    solids = solids_of(scene(view, {chess.E4: (CEILING + 0.05, 90)}), view)
    assert solids.above[chess.E4] > 100
    assert solids.top[chess.E4] < CEILING


def test_where_nothing_is_measured_nothing_is_seen():
    view = view_from(0.0, 0.6)
    frame = scene(view, {})
    blind = Frame(frame.colour, np.zeros_like(frame.depth), PINHOLE, 0.0)
    solids = solids_of(blind, view)
    assert not solids.seen.any()
    assert not solids.top.any()
    with pytest.raises(ValueError, match="no depth"):
        solids_of(Frame(frame.colour, None, PINHOLE, 0.0), view)


def of_position(board: chess.Board, view: BoardView) -> Solids:
    blocks = {
        square: (0.02 + 0.006 * piece.piece_type, 220 if piece.color else 30)
        for square, piece in board.piece_map().items()
    }
    return solids_of(scene(view, blocks, hole=True), view)


def test_states_are_learnt_from_one_position_and_told_in_another():
    view, standing = view_from(0.4, 0.5), Standing()
    board = chess.Board()
    assert not standing.likelihood(of_position(board, view)).any()  # nothing is known yet
    standing.learn(of_position(board, view), states_of(codes_of(board)))
    for san in ("e4", "d5", "exd5", "Qxd5", "Nc3", "Qa5"):
        board.push_san(san)
    told = standing.likelihood(of_position(board, view))
    truth = states_of(codes_of(board))
    assert np.array_equal(told.argmax(axis=1), truth)
    other = np.where(np.arange(3) == truth[:, None], -np.inf, told).max(axis=1)
    assert (other < -2.0).all()
    assert {EMPTY, WHITE, BLACK} == set(truth.tolist())


def test_a_hand_over_a_square_says_nothing_of_it():
    view, standing = view_from(0.0, 0.6), Standing()
    board = chess.Board()
    standing.learn(of_position(board, view), states_of(codes_of(board)))
    hidden = standing.likelihood(solids_of(scene(view, {chess.E4: (0.12, 150)}), view))
    assert not hidden[chess.E4].any()


@pytest.mark.parametrize(
    ("kind", "told"),
    [(chess.QUEEN, chess.QUEEN), (chess.BISHOP, chess.BISHOP), (chess.KNIGHT, None), (chess.PAWN, None)],
)
def test_a_promoted_piece_is_told_by_its_height(kind, told):
    """Knight and rook are nearly as high: it asks; and a pawn is no piece to promote to."""
    heights = {1: 0.034, 2: 0.043, 3: 0.050, 4: 0.0385, 5: 0.056, 6: 0.062}
    board = chess.Board()
    codes = codes_of(board)
    kinds = Kinds()
    kinds.learn(np.array([heights.get(abs(int(code)), 0.0) for code in codes]), codes)
    move = chess.Move.from_uci("a7a8q")
    seen = np.zeros(64)
    seen[chess.A8] = heights[kind]
    decision = kinds.promoted(Decision(Verdict.MOVE, (move,), 1.0, 1.0, ()), seen)
    assert decision.promotion_unsure == (told is None)
    assert decision.moves[0].promotion == (told or chess.QUEEN)
    assert kinds.promoted(Decision(Verdict.MOVE, (move,), 1.0, 1.0, ()), None).promotion_unsure
