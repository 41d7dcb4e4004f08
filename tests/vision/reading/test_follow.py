"""Laws of reading moves from looks, on drawn boards."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import chess
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from tests.vision.synthetic import camera_matrix, corners_of, draw
from vision.reading.evidence import Evidence, codes_of, states_of
from vision.reading.moves import decide
from vision.reading.observer import Observer
from vision.reading.outcome import ReadingOutcome
from vision.reading.rectified_view import sight_of_picture
from vision.reading.solids import Solids

ABOVE = camera_matrix(0.35)
OBLIQUE = camera_matrix(0.75, distance=14.5)


def off(rng: np.random.Generator) -> NDArray[np.float64]:
    return rng.uniform(-0.2, 0.2, (64, 2))


def see(board, rng, matrix=ABOVE, offsets=None, **how):
    return sight_of_picture(draw(board, matrix, rng, offsets=offsets, **how), corners_of(matrix))


@cache
def perfect(fen: str) -> Evidence:
    """What a look of which nothing is hidden would say of a position that has not changed."""
    states = states_of(codes_of(chess.Board(fen)))
    return _evidence(states, np.zeros(64, bool))


def _evidence(states: NDArray[np.intp], changed: NDArray[np.bool_]) -> Evidence:
    looks = np.full((64, 3), -6.0)
    looks[np.arange(64), states] = 0.0
    return Evidence(looks, np.where(changed, 6.0, -6.0), np.eye(64))


def shown(board: chess.BaseBoard, before: chess.BaseBoard) -> Evidence:
    codes, old = codes_of(board), codes_of(before)
    return _evidence(states_of(codes), codes != old)


def random_game(seed: int, plies: int) -> chess.Board:
    rng, board = np.random.default_rng(seed), chess.Board()
    for _ in range(plies):
        moves = list(board.legal_moves)
        if not moves:
            break
        board.push(moves[rng.integers(len(moves))])
    return board


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.integers(0, 120))
def test_every_legal_move_is_read_when_all_is_seen(seed, plies):
    board = random_game(seed, plies)
    for move in list(board.legal_moves)[:12]:
        after = board.copy()
        after.push(move)
        decision = decide(shown(after, board), board)
        assert decision.verdict is ReadingOutcome.MOVE
        (read,) = decision.moves
        assert (read.from_square, read.to_square) == (move.from_square, move.to_square)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.integers(0, 100), st.integers(0, 63), st.integers(0, 2))
def test_no_move_is_read_into_a_placement_that_no_move_leads_to(seed, plies, square, state):
    board = random_game(seed, plies)
    before = states_of(codes_of(board))
    states = before.copy()
    states[square] = state
    legal = [before]
    for move in board.legal_moves:
        after = board.copy()
        after.push(move)
        legal.append(states_of(codes_of(after)))
    decision = decide(_evidence(states, states != before), board)
    if any(np.array_equal(states, one) for one in legal):
        assert decision.verdict is not ReadingOutcome.DOUBT
    else:
        assert decision.verdict is ReadingOutcome.DOUBT
        assert square in decision.squares


def test_nothing_is_read_when_nothing_has_changed():
    decision = decide(perfect(chess.STARTING_FEN), chess.Board())
    assert decision.verdict is ReadingOutcome.NOTHING
    assert decision.moves == ()
    assert decision.confidence > 0.99


def test_two_plies_are_read_only_when_asked_for():
    board, after = chess.Board(), chess.Board()
    for san in ("e4", "e5"):
        after.push_san(san)
    evidence = shown(after, board)
    assert decide(evidence, board).verdict is ReadingOutcome.DOUBT
    decision = decide(evidence, board, plies=2)
    assert [move.uci() for move in decision.moves] == ["e2e4", "e7e5"]


def test_a_hidden_square_leaves_the_move_readable():
    """A tall piece in front of an empty square must not look like a piece behind it."""
    board = chess.Board()
    after = board.copy()
    after.push_san("Nf3")
    cover = np.eye(64)
    cover[chess.F3, chess.F4] = 0.8
    codes, old = codes_of(after), codes_of(board)
    states = states_of(codes)
    states[chess.F4] = 1  # the knight's head
    evidence = _evidence(states, (codes != old) | (np.arange(64) == chess.F4))
    assert decide(Evidence(evidence.states, evidence.changed, np.eye(64)), board).verdict is ReadingOutcome.DOUBT
    decision = decide(Evidence(evidence.states, evidence.changed, cover), board)
    assert decision.moves == (after.peek(),)


def play_through(line, matrix, seed, **how):
    """Follow a line in drawn pictures; what was read, ply by ply."""
    rng = np.random.default_rng(seed)
    board = chess.Board()
    offsets = off(rng)
    observer = Observer(board, see(board, rng, matrix, offsets))
    for san in line.split():
        move = board.push_san(san)
        offsets = offsets.copy()
        offsets[move.to_square] = rng.uniform(-0.2, 0.2, 2)
        light = {key: float(rng.uniform(*value)) for key, value in how.items()}
        look = observer.look(see(board, rng, matrix, offsets, **light))
        yield move, observer.decide(look)
        observer.confirm(look, board)


CASTLING = "e4 e5 Nf3 Nc6 Bb5 a6 Bxc6 dxc6 O-O Bg4 h3 Bxf3 Qxf3 Qd7 d3 O-O-O"
EN_PASSANT = "e4 Nf6 e5 d5 exd6 cxd6 d4 e6 Nf3 Be7 Bd3 O-O O-O"


@pytest.mark.parametrize("line", [CASTLING, EN_PASSANT])
@pytest.mark.parametrize(("matrix", "share"), [(ABOVE, 0.7), (OBLIQUE, 0.1)], ids=["above", "oblique"])
@pytest.mark.parametrize("seed", range(2))
def test_a_drawn_game_is_never_read_wrong(line, matrix, share, seed):
    """Flat colours and white heads before white squares are harder than wood: here it may ask, but not be wrong."""
    read = list(play_through(line, matrix, seed, brightness=(0.7, 1.1), noise=(2.0, 6.0)))
    assert all(decision.verdict is ReadingOutcome.DOUBT or decision.moves == (move,) for move, decision in read)
    assert sum(decision.verdict is ReadingOutcome.MOVE for _, decision in read) >= share * len(read)


def test_states_are_read_square_by_square():
    rng = np.random.default_rng(5)
    board = chess.Board()
    observer = Observer(board, see(board, rng))
    for san in ("d4", "d5", "c4", "dxc4", "e3"):
        board.push_san(san)
        look = observer.look(see(board, rng, offsets=off(rng)))
        assert np.array_equal(look.evidence.states.argmax(axis=1), states_of(codes_of(board)))
        observer.confirm(look, board)


def test_an_exposure_step_is_no_change():
    rng = np.random.default_rng(6)
    board = chess.Board()
    observer = Observer(board, see(board, rng))
    for brightness in (0.45, 1.1, 0.7):
        look = observer.look(see(board, rng, brightness=brightness))
        assert observer.decide(look).verdict is ReadingOutcome.NOTHING


def test_a_look_with_depth_in_between_is_refused():
    board = chess.Board()
    rng = np.random.default_rng(1)
    sight = see(board, rng)
    observer = Observer(board, sight)
    none = np.zeros(64, dtype=np.intp)
    deep = replace(
        sight,
        solids=Solids(none, none, none, np.zeros(64), np.zeros((64, 3)), np.ones(64), np.zeros((64, 36), np.bool_)),
    )
    with pytest.raises(ValueError, match="one camera"):
        observer.look(deep)
