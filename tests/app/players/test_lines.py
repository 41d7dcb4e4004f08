"""Lines of play as text."""

from __future__ import annotations

import re

import chess
import pytest

from app import UserError
from app.players.given_line import LineError, given_line, parse_line


def ucis(text: str, fen: str = chess.STARTING_FEN) -> list[str]:
    return [move.uci() for move in parse_line(text, chess.Board(fen))]


@pytest.mark.parametrize(
    "text",
    [
        "e4 d5 exd5 Qxd5 Nc3",
        "e2e4 d7d5 e4d5 d8d5 b1c3",
        "e4 d7d5 exd5 d8d5 Nc3",
        "1. e4 d5 2. exd5 Qxd5 3. Nc3",
        "1.e4 d5 2.exd5 2...Qxd5 3.Nc3 *",
        "1.e4! d5?! 2.exd5 Qxd5 3.Nc3 1-0",
        "e4, d5, exd5, Qxd5, Nc3",
        "e4\nd5\n\texd5 Qxd5 Nc3 1/2-1/2",
    ],
)
def test_notations_give_the_same_moves(text: str) -> None:
    assert ucis(text) == ["e2e4", "d7d5", "e4d5", "d8d5", "b1c3"]


def test_special_moves() -> None:
    fen = "r3k2r/P6p/8/5pP1/8/8/8/R3K2R w KQkq f6 0 1"
    assert ucis("gxf6 O-O", fen) == ["g5f6", "e8g8"]
    assert ucis("e1c1 0-0", fen) == ["e1c1", "e8g8"]
    assert ucis("a1a6 h7h6 e1g1", fen)[-1] == "e1g1"
    assert ucis("a7a8q", "4k3/P7/8/8/8/8/8/4K3 w - - 0 1") == ["a7a8q"]
    assert ucis("A7A8N", "4k3/P7/8/8/8/8/8/4K3 w - - 0 1") == ["a7a8n"]
    assert ucis("a8=R+", "4k3/P7/8/8/8/8/8/4K3 w - - 0 1") == ["a7a8r"]


def test_chess960_castling() -> None:
    board = chess.Board("5k2/8/8/8/8/8/8/5KR1 w G - 0 1", chess960=True)
    assert [m.uci() for m in parse_line("O-O", board)] == [m.uci() for m in parse_line("f1g1", board)] == ["f1g1"]


def test_nothing_is_no_moves() -> None:
    assert parse_line("  1. * ", chess.Board()) == ()


def test_a_line_that_is_to_be_played_has_a_move() -> None:
    assert len(given_line("e4 e5", chess.Board())) == 2
    with pytest.raises(UserError, match="--moves is ' ': give at least one move, such as e4, or leave it out"):
        given_line(" ", chess.Board())


def test_the_board_is_not_changed() -> None:
    board = chess.Board()
    parse_line("e4 e5", board)
    assert board.fen() == chess.STARTING_FEN
    assert not board.move_stack


AFTER_E4_E5 = "rnbqkbnr/pppp1ppp/8/4p3/4P3/8/PPPP1PPP/RNBQKBNR w KQkq - 0 2"
FREE = "4k3/8/8/8/8/8/8/4K3 w - - 0 1"
MATE = "rnb1kbnr/pppp1ppp/8/4p3/6Pq/5P2/PPPPP2P/RNBQKBNR w KQkq - 1 3"


@pytest.mark.parametrize(
    ("text", "fen", "message"),
    [
        (
            "1. e4 e5 2. Ke3",
            chess.STARTING_FEN,
            f'ply 3 of the line, "Ke3", is not legal in {AFTER_E4_E5}: choose Ke2, a3, b3, c3, d3 or 24 others',
        ),
        (
            "e4 e5 e1e3",
            chess.STARTING_FEN,
            f'ply 3 of the line, "e1e3", is not legal in {AFTER_E4_E5}: '
            "choose e1e2, b1a3, b1c3, d1e2, d1f3 or 24 others",
        ),
        (
            "hello",
            FREE,
            f'ply 1 of the line, "hello", is neither SAN nor UCI in {FREE}: choose Ke2, Kd1, Kd2, Kf1, Kf2',
        ),
        (
            "Rd1",
            "4k3/8/8/8/8/8/8/R4RK1 w - - 0 1",
            'ply 1 of the line, "Rd1", is ambiguous in 4k3/8/8/8/8/8/8/R4RK1 w - - 0 1: '
            "choose Rad1, Rfd1, Rab1, Rac1, Rfb1 or 21 others",
        ),
        ("--", FREE, 'ply 1 of the line, "--", passes, which chess does not allow: choose Kd1, Kd2, Ke2, Kf1, Kf2'),
        ("0000", FREE, 'ply 1 of the line, "0000", passes, which chess does not allow: choose Kd1, Kd2, Ke2, Kf1, Kf2'),
        (
            "f3 e5 g4 Qh4# a3",
            chess.STARTING_FEN,
            f'ply 5 of the line, "a3", is not legal in {MATE}: the game is over at that point (0-1)',
        ),
    ],
)
def test_errors_name_token_number_position_and_choices(text: str, fen: str, message: str) -> None:
    with pytest.raises(LineError, match=f"^{re.escape(message)}$"):
        parse_line(text, chess.Board(fen))
