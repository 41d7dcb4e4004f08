"""What stands up from the board, by depth: drawn blocks, whose points are where they stand and nowhere else."""

from __future__ import annotations

import chess
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hardware.interfaces import Frame
from tests.vision.blocks import PINHOLE, scene, view_from
from vision.board.view import BoardView
from vision.reading.appearance import BLACK, EMPTY, WHITE
from vision.reading.evidence import codes_of, states_of
from vision.reading.moves import MoveReading
from vision.reading.occupancy import HARDLY, DepthOccupancy
from vision.reading.outcome import ReadingOutcome
from vision.reading.piece_kinds import KindClassifier
from vision.reading.solids import CEILING, Solids, solids_of


@settings(max_examples=25)
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
    solids = solids_of(scene(view, {chess.E4: (CEILING + 0.03, 90)}), view)
    assert solids.above[chess.E4] > 100
    assert solids.top[chess.E4] < CEILING


def test_where_nothing_is_measured_nothing_is_seen():
    view = view_from(0.0, 0.6)
    frame = scene(view, {})
    blind = Frame(frame.colour, np.zeros_like(frame.depth), PINHOLE, 0.0)
    solids = solids_of(blind, view)
    assert not solids.seen.any()
    assert not solids.top.any()
    assert solids.room == pytest.approx(np.ones(64))
    with pytest.raises(ValueError, match="no depth"):
        solids_of(Frame(frame.colour, None, PINHOLE, 0.0), view)


def of_position(board: chess.Board, view: BoardView) -> Solids:
    blocks = {
        square: (0.02 + 0.006 * piece.piece_type, 220 if piece.color else 30)
        for square, piece in board.piece_map().items()
    }
    return solids_of(scene(view, blocks, hole=True), view)


def test_states_are_learnt_from_one_position_and_told_in_another():
    view, standing = view_from(0.4, 0.5), DepthOccupancy()
    board = chess.Board()
    assert not standing.likelihood(of_position(board, view)).any()  # nothing is known yet
    standing.learn(of_position(board, view), states_of(codes_of(board)))
    for san in ("e4", "d5", "exd5", "Qxd5", "Nc3", "Qa5"):
        board.push_san(san)
    solids = of_position(board, view)
    told = standing.likelihood(solids)
    truth = states_of(codes_of(board))
    assert np.array_equal(told.argmax(axis=1), truth)
    other = np.where(np.arange(3) == truth[:, None], -np.inf, told).max(axis=1)
    unseen = (truth == EMPTY) & (solids.room > 0.1)  # a part of them lies in the hole
    rim = (truth != EMPTY) & (solids.other.mean(axis=1) > HARDLY)  # of a hidden piece says little of its colour
    assert (other[~unseen & ~rim] < -2.0).all()
    assert unseen.sum() < 8
    assert rim.sum() < 24
    assert {EMPTY, WHITE, BLACK} == set(truth.tolist())


def test_a_hand_over_a_square_says_nothing_of_it():
    view, standing = view_from(0.0, 0.6), DepthOccupancy()
    board = chess.Board()
    standing.learn(of_position(board, view), states_of(codes_of(board)))
    hidden = standing.likelihood(solids_of(scene(view, {chess.E4: (0.11, 150)}), view))
    assert not hidden[chess.E4].any()


def learnt(view: BoardView) -> DepthOccupancy:
    """From the start position."""
    standing, board = DepthOccupancy(), chess.Board()
    standing.learn(of_position(board, view), states_of(codes_of(board)))
    return standing


def test_what_hovers_over_a_square_takes_nothing_from_what_is_seen_of_it():
    view = view_from(0.5, 0.5)
    free = solids_of(scene(view, {chess.E4: (0.20, 150)}, hovering=0.14), view)
    assert not free.above.any()
    told = learnt(view).likelihood(free)
    assert (told[chess.E4, [WHITE, BLACK]] < -6.0).all()


@pytest.mark.parametrize(("y", "square"), [(0.35, chess.C5), (0.45, chess.E4), (0.55, chess.F6)])
def test_of_a_square_behind_something_tall_depth_says_nothing_until_a_piece_would_have_been_seen(y, square):
    view = view_from(y, 0.35)
    standing = learnt(view)
    wall = {square + 8 + file: (0.075, 20) for file in (-1, 0, 1)}
    for content in ({}, {square: (0.034, 220)}):
        hidden = solids_of(scene(view, {**wall, **content}), view)
        if content and hidden.standing[square] == 0:
            assert hidden.room[square] > 0.2
            assert standing.likelihood(hidden)[square].min() > -2.0
        elif content:
            assert standing.likelihood(hidden)[square, EMPTY] < 0.0
    seen = solids_of(scene(view, {}), view)
    assert seen.room[square] < 0.01
    assert standing.likelihood(seen)[square, [WHITE, BLACK]].max() < -5.0


def test_what_stands_before_a_square_is_known_to_hide_it():
    view = view_from(0.5, 0.4)
    queen = solids_of(scene(view, {chess.E5: (0.054, 20)}), view)
    assert queen.other[chess.E4].mean() > 0.4
    assert not queen.other[[chess.E5, chess.E6, chess.A1, chess.H8]].any()


@pytest.mark.parametrize(
    ("kind", "told"),
    [(chess.QUEEN, chess.QUEEN), (chess.BISHOP, chess.BISHOP), (chess.KNIGHT, None), (chess.PAWN, None)],
)
def test_a_promoted_piece_is_told_by_its_height(kind, told):
    """Knight and rook are nearly as high: it asks; and a pawn is no piece to promote to."""
    heights = {1: 0.034, 2: 0.043, 3: 0.050, 4: 0.0385, 5: 0.056, 6: 0.062}
    board = chess.Board()
    codes = codes_of(board)
    kinds = KindClassifier()
    kinds.learn(np.array([heights.get(abs(int(code)), 0.0) for code in codes]), codes)
    move = chess.Move.from_uci("a7a8q")
    seen = np.zeros(64)
    seen[chess.A8] = heights[kind]
    decision = kinds.promoted(MoveReading(ReadingOutcome.MOVE, (move,), 1.0, 1.0, ()), seen)
    assert decision.promotion_unsure == (told is None)
    assert decision.moves[0].promotion == (told or chess.QUEEN)
    assert kinds.promoted(MoveReading(ReadingOutcome.MOVE, (move,), 1.0, 1.0, ()), None).promotion_unsure
