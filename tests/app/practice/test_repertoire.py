"""A repertoire: read with its variations, played by the robot, and left by a person."""

from __future__ import annotations

from pathlib import Path

import chess
import pytest

from app.players.advice import TakingBack
from app.players.decision import Decision
from app.practice.repertoire import Repertoire, RepertoireAdviser, RepertoireError, RepertoirePlayer, load_repertoire

LINES = '1. e4 e5 (1... c5 2. Nf3 d6) 2. Nf3 Nc6 3. Bb5 *\n\n[White "?"]\n\n1. Nf3 Nc6 2. e4 e5 *\n'


@pytest.fixture
def repertoire(tmp_path: Path) -> Repertoire:
    path = tmp_path / "rep.pgn"
    path.write_text(LINES)
    return load_repertoire(path)


def after(*sans: str) -> chess.Board:
    board = chess.Board()
    for san in sans:
        board.push_san(san)
    return board


class Other:
    name = "other"

    def choose(self, board: chess.Board, clock: object = None) -> Decision:
        return Decision(chess.Move.from_uci("a7a6"))


def test_variations_and_transpositions_count(repertoire: Repertoire) -> None:
    assert {move.uci() for move in repertoire.moves(after("e4"))} == {"e7e5", "c7c5"}
    assert [move.uci() for move in repertoire.moves(after("Nf3", "Nc6", "e4", "e5"))] == ["f1b5"]
    assert repertoire.moves(after("d4")) == ()


def test_the_main_line_s_move_comes_first_though_a_variation_transposes_into_it(tmp_path: Path) -> None:
    path = tmp_path / "rep.pgn"
    path.write_text("1. e4 (1. d4 e6 2. e4 c5) 1... e6 2. d4 d5 3. Nc3 (3. e5 c5 4. c3) 3... Nf6 *\n")
    found = load_repertoire(path)
    assert [move.uci() for move in found.moves(after("e4", "e6", "d4"))] == ["d7d5", "c7c5"]
    assert RepertoirePlayer(found, 1, Other()).hint(after("d4", "e6", "e4")).move == chess.Move.from_uci("d7d5")


def test_the_robot_plays_it_by_seed_and_then_the_other_goes_on(repertoire: Repertoire) -> None:
    played = {RepertoirePlayer(repertoire, seed, Other()).choose(after("e4")).move for seed in range(12)}
    assert {move.uci() for move in played if move is not None} == {"e7e5", "c7c5"}
    player = RepertoirePlayer(repertoire, 1, Other())
    assert player.choose(after("e4")) == player.choose(after("e4"))
    assert player.choose(after("d4")).move == chess.Move.from_uci("a7a6")
    hint = player.hint(after("e4")).move
    assert hint is not None
    assert hint.uci() == "e7e5"


def test_it_says_where_it_was_left_and_where_it_ends(repertoire: Repertoire) -> None:
    adviser = RepertoireAdviser(repertoire)
    board = after("e4", "c5")
    assert adviser.judge(board, board.parse_san("Nf3")) is None
    left = adviser.judge(board, board.parse_san("d4"))
    assert left is not None
    assert (left.sentence, left.taking_back) == ("2. d4 leaves your repertoire, which plays Nf3", TakingBack.OFFERED)
    board = after("e4", "e5", "Nf3", "Nc6")
    end = adviser.judge(board, board.parse_san("Bb5"))
    assert end is not None
    assert end.sentence == "your repertoire ends with 3. Bb5: from here you are on your own"
    board = after("d4")
    assert adviser.judge(board, board.parse_san("d5")) is None


def test_a_null_move_and_what_follows_it_is_no_line(tmp_path: Path) -> None:
    path = tmp_path / "threat.pgn"
    path.write_text("1. e4 e5 (1... g5 2. d4 (2. -- h5) 2... h6) 2. Nf3 -- 3. Bb5 *\n")
    repertoire = load_repertoire(path)
    assert [move.uci() for move in repertoire.moves(after("e4", "g5"))] == ["d2d4"]
    passed = after("e4", "g5")
    passed.push(chess.Move.null())
    assert repertoire.moves(passed) == ()
    assert repertoire.moves(after("e4", "e5", "Nf3")) == ()
    assert len(repertoire) == 5


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "contains no move: give a PGN file with a repertoire"),
        ("1. e4 e4 *\n", "game 1: illegal san"),
        ("1. -- e5 *\n", "contains no move"),
    ],
)
def test_what_is_no_repertoire_is_refused(tmp_path: Path, text: str, sentence: str) -> None:
    path = tmp_path / "bad.pgn"
    path.write_text(text)
    with pytest.raises(RepertoireError, match=sentence):
        load_repertoire(path)
    with pytest.raises(RepertoireError, match=r"none.pgn cannot be read"):
        load_repertoire(tmp_path / "none.pgn")
