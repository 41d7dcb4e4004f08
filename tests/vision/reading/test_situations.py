"""What people do that is no legal move is named, with its squares, and what to do."""

from __future__ import annotations

import chess
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vision.reading.diagnosis import explain
from vision.reading.evidence import codes_of, states_of
from vision.reading.outcome import Situation


def position(moves: str) -> chess.Board:
    board = chess.Board()
    for san in moves.split():
        board.push_san(san)
    return board


def after(board: chess.Board, *changes: str):
    """States after changes: 'e2e4' moves whatever stands there, 'e2-' takes it off, 'e4+w' adds a white piece."""
    states = states_of(codes_of(board))
    for change in changes:
        square = chess.parse_square(change[:2])
        if change[2] == "-":
            states[square] = 0
        elif change[2] == "+":
            states[square] = 1 if change[3] == "w" else 2
        else:
            states[chess.parse_square(change[2:])] = states[square]
            states[square] = 0
    return states


OPEN = "e4 e5 Nf3 Nc6 Bc4 Bc5"
CASES = [
    ("", (), Situation.NOTHING, "", "make your move"),
    ("", ("e2e4",), Situation.LEGAL, "e2 e4", "e4"),
    ("", ("e2e5",), Situation.ILLEGAL, "e2 e5", "a pawn does not move like that here: put it back on e2"),
    ("", ("e7e5",), Situation.WRONG_SIDE, "e7 e5", "it is White's move: put it back on e7"),
    ("", ("g1-",), Situation.MISSING, "g1", "the white knight on g1 is missing"),
    ("", ("d1-", "d8-"), Situation.MISSING, "d1 d8", "the white queen on d1 and the black queen on d8 are missing"),
    ("", ("e4+b",), Situation.EXTRA, "e4", "there is a black piece on e4, where none should be: take it off"),
    ("", ("d1+b",), Situation.RECOLOURED, "d1", "d1 (white queen)"),
    ("", ("e2e4", "e7e5"), Situation.TWO_MOVES, "e2 e4 e7 e5", "both sides have moved, e4 and e5"),
    ("", ("e2e4", "d2d4"), Situation.TWO_MOVES, "e2 e4 d2 d4", "White has moved twice"),
    ("e4 e5", ("e5e7",), Situation.TAKEN_BACK, "e5 e7", "the last move is taken back"),
    (OPEN, ("e1g1",), Situation.UNFINISHED, "e1 g1", "put the rook from h1 on f1"),
    ("e4 d5", ("d5-",), Situation.UNFINISHED, "d5 e4", "finish the capture"),
    ("e4 d5", ("d5-", "e4-"), Situation.UNFINISHED, "d5 e4", "put the piece from e4 on d5"),
    ("e4 a6 e5 d5", ("e5d6",), Situation.UNFINISHED, "e5 d6 d5", "take the pawn on d5 off"),
    ("e4 e5 Nf3 Nc6 Ke2 a6 Ke1 a5 Be2 a4", ("e1g1", "h1f1"), Situation.ILLEGAL, "e1 g1 h1 f1", "O-O is not allowed"),
    ("e4 e5 Qh5 Nf6 Qxf7+", ("a7a6",), Situation.ILLEGAL, "a7 a6", "the king would be in check"),
]  # fmt: skip


@pytest.mark.parametrize(("line", "changes", "situation", "squares", "words"), CASES)
def test_the_commonest_cases(line, changes, situation, squares, words):
    board = position(line)
    finding = explain(after(board, *changes), board)
    assert finding.situation is situation
    assert {chess.parse_square(name) for name in squares.split()} <= set(finding.squares)
    assert words in finding.sentence


@pytest.mark.parametrize(
    ("fen", "change", "words"),
    [
        (
            "r3k3/8/8/8/8/8/8/K6R w - - 0 1",
            "h1f1",
            "the white rook from h1 must not go to f1, the king would be in check",
        ),
        ("r7/8/8/8/8/8/8/K6N w - - 0 1", "h1f1", "the white knight from h1 must not go to f1"),
        (
            "k6r/8/8/8/8/8/8/R3K3 b - - 0 1",
            "h8f8",
            "the black rook from h8 must not go to f8, the king would be in check",
        ),
    ],
)
def test_who_moves_a_rook_that_must_not_is_told_nothing_of_castling(fen, change, words):
    board = chess.Board(fen)
    finding = explain(after(board, change), board)
    assert finding.situation is Situation.ILLEGAL
    assert words in finding.sentence
    assert "O-O" not in finding.sentence


def test_a_board_swept_off_is_to_be_set_up_again():
    finding = explain(np.zeros(64, dtype=np.intp), chess.Board())
    assert finding.situation is Situation.WRONG_BOARD
    assert "32 squares" in finding.sentence
    assert "set the position up" in finding.sentence


@settings(max_examples=80)
@given(st.integers(0, 10**6), st.lists(st.tuples(st.integers(0, 63), st.integers(0, 2)), max_size=5))
def test_every_wrong_square_is_named(seed, changes):
    rng, board = np.random.default_rng(seed), chess.Board()
    for _ in range(int(rng.integers(40))):
        moves = list(board.legal_moves)
        if not moves:
            break
        board.push(moves[rng.integers(len(moves))])
    expected = states_of(codes_of(board))
    seen = expected.copy()
    for square, state in changes:
        seen[square] = state
    finding = explain(seen, board)
    assert set(np.flatnonzero(seen != expected).tolist()) <= set(finding.squares)
    assert finding.sentence
    assert (finding.situation is Situation.NOTHING) == np.array_equal(seen, expected)


def test_a_piece_that_took_its_own_side_s_is_looked_for_where_looks_have_changed():
    board = position("e4 e5")
    seen = after(board, "f1-")
    altered = (chess.E7, chess.E2, chess.G2)
    finding = explain(seen, board, altered)
    assert finding.situation is Situation.ILLEGAL
    assert finding.squares == (chess.F1, chess.G2)
    assert "white pawn" in finding.sentence
    assert explain(seen, board, (chess.E7,)).situation is Situation.MISSING


@pytest.mark.parametrize(
    ("changes", "unsure", "situation"),
    [
        (("f1d3",), ("f1",), Situation.LEGAL),
        (("d3+w",), ("f1",), Situation.LEGAL),
        (("d3+w",), (), Situation.EXTRA),
        (("d3+w",), ("d3",), Situation.EXTRA),
        (("d3+w", "a7-"), ("f1",), Situation.WRONG_BOARD),
        (("f1-",), ("f1", "d3"), Situation.MISSING),
    ],
)
def test_a_move_whose_start_is_hidden_is_asked_for(changes, unsure, situation):
    """Something before it may hide that it has gone; that it has come, is seen."""
    board = position("e4 e5")
    hidden = tuple(map(chess.parse_square, unsure))
    finding = explain(after(board, *changes), board, (), chess.Move.from_uci("f1d3"), hidden)
    assert finding.situation is situation
    assert ("this looks like Bd3" in finding.sentence) == (situation is Situation.LEGAL)
