"""What can be said: every move, in words that the recogniser knows, and nothing that could be two moves."""

from __future__ import annotations

from collections import Counter

import chess
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pocketsphinx import Decoder

from app.players.typed_commands import PlayMove, Word, parse_command
from app.voice.phrases import ADDRESS, NO, REQUESTS, YES, grammar_of, lines_of, sayable


def _reached(choices: list[int], board: chess.Board) -> chess.Board:
    for choice in choices:
        moves = list(board.legal_moves)
        if not moves:
            break
        board.push(moves[choice % len(moves)])
    return board


positions = st.builds(
    _reached,
    st.lists(st.integers(0, 1 << 16), max_size=90),
    st.sampled_from([chess.Board(), chess.Board.from_chess960_pos(100)]).map(chess.Board.copy)
    | st.just("4k3/P6P/8/1pP5/8/8/p6p/R3K2R w KQ b6 0 1").map(chess.Board),
)


@given(positions)
def test_every_legal_move_can_be_said_and_what_is_said_is_that_move(board: chess.Board) -> None:
    phrases = Counter(lines_of(sayable(board)).values())
    for move in board.legal_moves:
        san = board.san(move).rstrip("+#")
        assert phrases[san] >= 5
        assert parse_command(san, board) == PlayMove(move)


@given(positions)
def test_words_are_known_to_the_recogniser(board: chess.Board) -> None:
    words = {word for phrase in (*lines_of(sayable(board)), ADDRESS, YES, NO) for word in phrase.split()}
    assert [word for word in words if DICTIONARY.lookup_word(word) is None] == []


DICTIONARY = Decoder(lm=None, loglevel="FATAL")


@pytest.mark.parametrize(
    ("fen", "san", "phrase"),
    [
        (chess.STARTING_FEN, "Nf3", "knight f three"),
        (chess.STARTING_FEN, "e4", "echo two to echo four"),
        ("r3k2r/8/8/8/8/8/8/R3K2R w KQkq - 0 1", "O-O-O", "castles queen side"),
        ("4k3/8/8/8/8/8/8/R3K2R w KQ - 0 1", "Ra2", "rook to alpha two"),
        ("3rk3/4P3/8/8/8/8/8/4K3 w - - 0 1", "exd8=N+", "e takes d eight becomes a knight"),
        ("4k3/8/8/2pP4/8/8/8/4K3 w - c6 0 1", "dxc6", "pawn takes charlie six"),
        ("4k3/8/8/8/8/2N5/8/4K1N1 w - - 0 1", "Nge2", "knight g e two"),
    ],
)
def test_moves_as_people_say_them(fen: str, san: str, phrase: str) -> None:
    assert lines_of(sayable(chess.Board(fen)))[phrase] == san.rstrip("+#")


def test_what_could_be_two_moves_is_none() -> None:
    """Two pawns that may take on d5, and a knight that has a companion."""
    board = chess.Board("4k3/8/8/3p4/2P1P3/8/1N1N4/4K3 w - - 0 1")
    lines = lines_of(sayable(board))
    assert lines["pawn takes d five"] is None
    assert "knight c four" not in lines
    assert lines["c takes d five"] == "cxd5"


@given(positions)
def test_the_recogniser_is_given_what_stands_for_a_line_and_takes_it(board: chess.Board) -> None:
    said = sayable(board, ["yes", "no"])
    DICTIONARY.add_jsgf_string("all", f"#JSGF V1.0; grammar all; public <said> = {grammar_of(said)};")
    assert DICTIONARY.get_fsg("all").accept(max(lines_of(said), key=len))


def test_nothing_that_is_spoken_ends_the_program() -> None:
    assert not {Word.QUIT, Word.NEW, Word.KEEP} & set(REQUESTS.values())
