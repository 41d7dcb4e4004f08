"""Games read to be played again."""

from __future__ import annotations

from pathlib import Path

import chess
import pytest

from app.records.recorded_games import ReplayError, recorded_games

TWO = """[Event "A"]
[White "X"]
[Black "Y"]
[Result "1-0"]

1. e4 {best by test} e5 (1... c5 2. Nf3) 2. Qh5 {[%clk 0:04:59]} Nc6 3. Bc4 Nf6?? 4. Qxf7# 1-0

[Event "B"]
[White "Z"]
[Black "W"]
[Result "*"]
[SetUp "1"]
[FEN "4k3/8/8/8/8/8/4P3/4K3 w - - 0 1"]

1. e4 Kd7 *
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "two.pgn"
    path.write_text(TWO, encoding="utf-8")
    return path


def test_main_lines_with_their_comments_and_without_variations(file: Path) -> None:
    first, second = recorded_games(file)
    assert [move.uci() for move in first.moves] == ["e2e4", "e7e5", "d1h5", "b8c6", "f1c4", "g8f6", "h5f7"]
    assert first.comments[:3] == ("best by test", "", "[%clk 0:04:59]")
    assert (first.white, first.black, first.result) == ("X", "Y", "1-0")
    assert second.board.fen() == "4k3/8/8/8/8/8/4P3/4K3 w - - 0 1"
    assert len(second.moves) == 2


def test_one_of_them_and_the_rest_of_it(file: Path) -> None:
    (second,) = recorded_games(file, 2)
    assert second.white == "Z"
    rest = recorded_games(file, 1)[0].from_ply(3)
    assert rest.board.fen() == "rnbqkbnr/pppp1ppp/8/4p3/4P3/8/PPPP1PPP/RNBQKBNR w KQkq - 0 2"
    assert len(rest.moves) == len(rest.comments) == 5
    with pytest.raises(ReplayError, match=r"--from-ply 8: .* has 7 plies: choose 1 to 7"):
        recorded_games(file, 1)[0].from_ply(8)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "contains no game"),
        ("Dear Anna,\n\nthe games are in the other file.\n", "contains no game: give a PGN file"),
        ('[White "X"]\n\n1. e4 e5 2. Ke3 *\n', r"game 1, after 2 plies: illegal san: 'Ke3' in .*: correct the file"),
        ('[White "X"]\n\n1. e4 -- 2. d4 *\n', r"game 1, ply 2 passes, which chess does not allow: correct the file"),
        ("1. e4 e4 ) Z0 *\n", r"game 1, is not readable PGN: correct the file"),
        (
            '[Variant "Crazyhouse"]\n\n1. e4 e5 *\n',
            r"game 1, is of the variant Crazyhouse: only chess and Chess960 are supported",
        ),
        ('[Variant "Xiangqi"]\n\n1. e4 e5 *\n', r"game 1, is of the variant Xiangqi: only chess and Chess960"),
        ('[Variant "King of the Hill"]\n\n1. e4 *\n', r"game 1, is of the variant King of the Hill"),
        (
            '[SetUp "1"]\n[FEN "8/8/8/8/8/8/8/K7 w - - 0 1"]\n\n1. Ka2 *\n',
            r"game 1, does not begin with a legal "
            r"position",
        ),
    ],
)
def test_what_cannot_be_played_is_one_sentence(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "bad.pgn"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ReplayError, match=said):
        recorded_games(path)
    with pytest.raises(ReplayError, match=r"game 1|contains no game"):
        recorded_games(path, 3 if text == "" else 1)
    with pytest.raises(ReplayError, match="cannot be read"):
        recorded_games(tmp_path / "none.pgn")


def test_what_is_to_be_done_instead_is_what_the_command_can_do(tmp_path: Path) -> None:
    path = tmp_path / "games.pgn"
    path.write_text("1. e4 *\n\n1. d4 *\n", encoding="utf-8")
    with pytest.raises(ReplayError, match=r"has no game 3: choose --game 1 to 2$"):
        recorded_games(path, 3)
    path.write_text('[White "X"]\n\n1. e4 -- 2. d4 *\n', encoding="utf-8")
    with pytest.raises(ReplayError, match=r"has no game 5: it has only one: leave --game out$"):
        recorded_games(path, 5)
    with pytest.raises(ReplayError, match=r"does not allow: correct the file$"):
        recorded_games(path)
    with pytest.raises(ReplayError, match=r"does not allow: correct the file, or choose another$"):
        recorded_games(path, 1, ", or choose another")


@pytest.mark.parametrize("text", ["1. e4 e5 2. Nf3", "1. e4 e5 2. Nf3 {and here", "1. e4 e5 2. Nf3 (2. f4"])
def test_a_game_that_is_cut_off_is_said_to_be_so(tmp_path: Path, text: str) -> None:
    path = tmp_path / "cut.pgn"
    path.write_text(f'[White "X"]\n\n{text}', encoding="utf-8")
    (game,) = recorded_games(path)
    assert len(game.moves) == 3
    assert game.cut == f"{path}, game 1, ends without a result after 3 plies: it may have been cut off there"
    path.write_text(f'[White "X"]\n\n1. e4 e5 2. Nf3 *\n\n[White "Y"]\n\n{text}', encoding="utf-8")
    assert [one.cut is None for one in recorded_games(path)] == [True, False]


def test_castling_of_chess960_is_read(tmp_path: Path) -> None:
    path = tmp_path / "fischer.pgn"
    path.write_text(
        '[Variant "Chess960"]\n[SetUp "1"]\n[FEN "4k3/8/8/8/8/8/8/1RK5 w Q - 0 1"]\n\n1. O-O-O *\n', encoding="utf-8"
    )
    (game,) = recorded_games(path)
    assert game.board.chess960
    after = game.board.copy()
    after.push(game.moves[0])
    assert after.piece_at(chess.C1) == chess.Piece(chess.KING, chess.WHITE)
    assert after.piece_at(chess.D1) == chess.Piece(chess.ROOK, chess.WHITE)
