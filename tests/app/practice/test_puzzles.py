"""Puzzles: read from files, and judged."""

from __future__ import annotations

from pathlib import Path

import chess
import pytest

from app.players.advice import TakingBack
from app.practice.puzzles import PuzzleAdviser, PuzzleError, puzzles_from, puzzles_of

TWO = """PuzzleId,FEN,Moves,Rating
00008,r6k/pp2r2p/4Rp1Q/3p4/8/1N1P2R1/PqP2bPP/7K b - - 0 24,f2g3 e6e7 b2b1 b3c1 b1c1 h6c1,1798
0000D,5rk1/1p3ppp/pq3b2/8/8/1P1Q1N2/P4PPP/3R2K1 w - - 2 27,d3d6 f8d8 d6d8 f6d8,1513
"""
MATE = '[FEN "6k1/5ppp/8/8/8/8/8/RR4K1 w - - 0 1"]\n[SetUp "1"]\n\n1. Ra8# *\n'


@pytest.fixture
def csv(tmp_path: Path) -> Path:
    path = tmp_path / "two.csv"
    path.write_text(TWO)
    return path


def test_the_opponent_has_the_first_move_in_a_csv(csv: Path) -> None:
    first, second = puzzles_of(csv)
    assert (first.person, second.person) == (chess.WHITE, chess.BLACK)
    assert first.name == "puzzle 00008"
    assert [move.uci() for move in second.line] == ["d3d6", "f8d8", "d6d8", "f6d8"]
    assert puzzles_from(csv, 2, 5) == (second,)


def test_in_a_pgn_the_side_to_move_solves_it(tmp_path: Path) -> None:
    path = tmp_path / "one.pgn"
    path.write_text(MATE)
    (puzzle,) = puzzles_of(path)
    assert puzzle.person is chess.WHITE
    assert len(puzzle.line) == 1


def test_a_right_move_goes_on_and_a_wrong_one_is_taken_back(csv: Path) -> None:
    puzzle = puzzles_of(csv)[1]
    adviser, board = PuzzleAdviser(puzzle), puzzle.board.copy()
    board.push(puzzle.line[0])
    wrong = adviser.judge(board, chess.Move.from_uci("b6d6"))
    assert wrong is not None
    assert (wrong.sentence, wrong.taking_back) == ("Qxd6 is not the solution: try again", TakingBack.NEEDED)
    right = adviser.judge(board, puzzle.line[1])
    assert right is not None
    assert (right.sentence, right.taking_back) == ("Rd8 is right; go on", TakingBack.NO)
    for move in puzzle.line[1:3]:
        board.push(move)
    last = adviser.judge(board, puzzle.line[3])
    assert last is not None
    assert last.sentence == "Bxd8 is right: solved"


def test_any_mate_solves_it(tmp_path: Path) -> None:
    path = tmp_path / "one.pgn"
    path.write_text(MATE)
    (puzzle,) = puzzles_of(path)
    said = PuzzleAdviser(puzzle).judge(puzzle.board, puzzle.board.parse_san("Rb8#"))
    assert said is not None
    assert (said.sentence, said.taking_back) == ("Rb8# is mate: solved", TakingBack.NO)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "needs the columns FEN and Moves, and has none: add a line that names them"),
        ("FEN,Solution\n", "needs the columns FEN and Moves, and has FEN, Solution"),
        ("FEN,Moves\n", "contains no puzzle: give a CSV file with the columns FEN and Moves, or a PGN file"),
        ("FEN,Moves\nx,e2e4\n", "puzzle 1, does not begin with a position"),
        ("FEN,Moves\n8/8/8/8/8/8/8/K7 w - - 0 1,a1a2\n", "puzzle 1, does not begin with a legal position"),
        (f"FEN,Moves\n{chess.STARTING_FEN},e2e4 e2e4\n", "puzzle 1, ply 2, 'e2e4', is not a legal move: correct"),
        (f"FEN,Moves\n{chess.STARTING_FEN},e2e4 0000 d2d4\n", "puzzle 1, ply 2, '0000', is not a legal move: correct"),
        (f"FEN,Moves\n{chess.STARTING_FEN},e2e4\n", "puzzle 1, needs a move of the opponent and a solution"),
        (f"FEN,Moves\n{chess.STARTING_FEN}\n", "puzzle 1, needs a move of the opponent and a solution"),
    ],
)
def test_what_is_no_puzzle_is_refused_in_one_sentence(tmp_path: Path, text: str, sentence: str) -> None:
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(PuzzleError) as caught:
        puzzles_of(path)
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_puzzle_that_is_not_there_is_refused(csv: Path, tmp_path: Path) -> None:
    with pytest.raises(PuzzleError, match=r"two.csv has no puzzle 3: choose 1 to 2"):
        puzzles_from(csv, 3, 1)
    with pytest.raises(PuzzleError, match=r"none.csv cannot be read"):
        puzzles_of(tmp_path / "none.csv")
    (tmp_path / "bytes.csv").write_bytes(b"FEN,Moves\n\xff\xfe,e2e4\n")
    with pytest.raises(PuzzleError, match=r"bytes.csv is not a CSV file in UTF-8"):
        puzzles_of(tmp_path / "bytes.csv")
