"""Games analysed by Stockfish: what is written, and that it can be read again."""

from __future__ import annotations

import io
import itertools
import json
import threading
from pathlib import Path

import chess
import chess.pgn
import pytest

from app import UserError
from app.analysis.analyses import AnalysesMade, analyse_games
from app.analysis.evaluating import AnalysisSettings, analysis_engine, evaluate
from app.analysis.judgement import Judgement
from app.analysis.kept import kept_analysis
from app.records.events import score_of
from app.records.files import RecordError
from tests.app.played_game import PlayedGame

NODES = 3000
SCHOLAR = """[White "Anna"]
[Black "Bert"]
[Result "1-0"]
[TimeControl "300+2"]

1. e4 { [%clk 0:05:00] [%emt 0:00:02] } e5 2. Qh5 Nc6 3. Bc4 { [%clk 0:04:50] hoping } Nf6 4. Qxf7# 1-0

[White "Bert"]
[Black "Anna"]
[FEN "4k3/8/8/8/8/8/4P3/4K3 b - - 0 1"]
[SetUp "1"]
[Result "*"]

1... Kd7 2. e4 *
"""


@pytest.fixture(scope="module")
def scholar(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, AnalysesMade]:
    file = tmp_path_factory.mktemp("pgn") / "two.pgn"
    file.write_text(SCHOLAR)
    return file, analyse_games(file, AnalysisSettings(nodes=NODES, lines=2), None, lambda _: None)


def test_the_mistake_is_found_and_named(scholar: tuple[Path, AnalysesMade]) -> None:
    first, second = scholar[1].analyses.games
    judged = {move.san: move for move in first.moves if move.judgement is Judgement.BLUNDER}
    assert list(judged) == ["Nf6"]
    assert judged["Nf6"].note.startswith("Blunder. Nf6 allows mate in 1: 4. Qxf7#; ")
    assert len(first.moves[0].lines) == 2
    assert first.opening is not None
    assert first.opening.eco[0] == "C"
    assert first.moves[-1].score is None
    assert first.sides["black"].blunders == 1
    assert first.sides["white"].accuracy > first.sides["black"].accuracy
    assert second.moves[0].number == 1
    assert second.moves[0].side == "black"


def test_the_annotated_pgn_is_read_by_python_chess(scholar: tuple[Path, AnalysesMade]) -> None:
    file, made = scholar
    assert made.files == (file.with_name("two.analysis.json"), file.with_name("two.analysed.pgn"))
    stream = io.StringIO(made.files[1].read_text())
    for analysis in made.analyses.games:
        game = chess.pgn.read_game(stream)
        assert game is not None
        assert not game.errors
        for node, move in zip(game.mainline(), analysis.moves, strict=True):
            assert node.move.uci() == move.uci
            assert node.eval() == (None if move.score is None else score_of(move.score))
    assert chess.pgn.read_game(stream) is None
    game = chess.pgn.read_game(io.StringIO(made.files[1].read_text()))
    assert game is not None
    nodes = list(game.mainline())
    assert (nodes[0].clock(), nodes[0].emt(), nodes[4].clock()) == (300.0, 2.0, 290.0)
    assert nodes[4].comment.startswith("hoping")
    assert nodes[5].nags == {chess.pgn.NAG_BLUNDER}
    assert len(nodes[4].variations) == 2
    assert game.headers["TimeControl"] == "300+2"
    assert game.headers["ECO"].startswith("C")


def test_evaluations_are_those_of_the_engine_alone(scholar: tuple[Path, AnalysesMade]) -> None:
    """What was searched before has no effect: a position on its own gets the same score."""
    settings = AnalysisSettings(nodes=NODES, lines=2)
    analysis = scholar[1].analyses.games[0]
    board = chess.Board()
    with analysis_engine(settings) as engine:
        for move in analysis.moves[:-1]:
            board.push_uci(move.uci)
        assert evaluate(engine, settings, board).score == score_of(analysis.moves[-2].score or "")


def test_a_search_may_be_as_long_as_any_engine_can_be_told() -> None:
    assert analysis_engine(AnalysisSettings(nodes=(1 << 63) - 1)).settings.deadline < threading.TIMEOUT_MAX


def test_a_recorded_game_keeps_its_analysis(tmp_path: Path) -> None:
    folder = tmp_path / "game"
    played = PlayedGame(folder).play("f3 e5 g4 Qh4#")
    played.record.end("0-1", "checkmate", played.time)
    made = analyse_games(folder, AnalysisSettings(nodes=NODES), None, lambda _: None)
    (game,) = made.analyses.games
    kept = kept_analysis(folder, ["f2f3", "e7e5", "g2g4", "d8h4"])
    assert kept == game
    assert kept_analysis(folder, ["f2f3"]) is None
    assert kept_analysis(tmp_path, ["f2f3"]) is None
    assert all(move.elapsed_s is not None and move.elapsed_s > 0.0 for move in game.moves)
    lost = [move.lost for move in game.moves]
    assert max(lost) == lost[2] > 15.0
    assert game.moves[-1].white_wins < 5.0


def test_a_file_of_another_version_is_refused_in_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "analysis.json").write_text(json.dumps({"games": [{"white": 3}]}))
    with pytest.raises(
        RecordError, match=r"analysis.json is not an analysis of this version \(games.0.*run 'touchmove"
    ):
        kept_analysis(tmp_path, [])


def test_a_game_that_may_have_been_cut_off_is_said_so(tmp_path: Path) -> None:
    file, told = tmp_path / "cut.pgn", list[str]()
    file.write_text("1. e4 e5 2. Nf")
    analyse_games(file, AnalysisSettings(nodes=1), None, told.append)
    assert told[0] == f"{file}, game 1, ends without a result after 2 plies: it may have been cut off there"


def test_what_holds_no_game_is_refused(tmp_path: Path) -> None:
    PlayedGame(tmp_path / "empty")
    for path, sentence in (
        (tmp_path / "none.pgn", "none.pgn cannot be read"),
        (tmp_path / "empty", "empty holds no game with a move: name a PGN file or the folder of a recorded game"),
    ):
        with pytest.raises(UserError, match=sentence):
            analyse_games(path, AnalysisSettings(nodes=10), None, lambda _: None)


def test_scores_follow_each_other_from_white_s_side(scholar: tuple[Path, AnalysesMade]) -> None:
    game = scholar[1].analyses.games[0]
    wins = [game.start_white_wins, *(move.white_wins for move in game.moves)]
    for (before, after), move in zip(itertools.pairwise(wins), game.moves, strict=True):
        gained = after - before if move.side == "white" else before - after
        assert move.lost == pytest.approx(max(0.0, -gained))
