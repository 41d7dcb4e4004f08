"""Practice on the rig without devices: puzzles, two people, a coach's take-back, odds, endgame tables."""

from __future__ import annotations

import io
import json
from pathlib import Path

import chess.pgn
import pytest

from app import UserError
from app.play.launch import resume_games
from app.records.files import EVENTS_FILE
from app.terminal.typed_lines import TypedLines
from tests.app.play.test_games import Told, play
from tests.app.practice.test_puzzles import MATE, TWO

SYZYGY = Path(__file__).resolve().parents[2] / "data" / "syzygy"


def events(folder: Path) -> list[dict[str, object]]:
    return [json.loads(line) for line in (folder / EVENTS_FILE).read_text().splitlines()]


def moves(folder: Path) -> str:
    with (folder / "game.pgn").open() as stream:
        game = chess.pgn.read_game(stream)
    assert game is not None
    return game.board().variation_san(game.mainline_moves())


def ended(folder: Path) -> tuple[str, str]:
    """Result and reason, as the report has them."""
    report = json.loads((folder / "report.json").read_text())
    return report["result"], report["exit_reason"]


def test_puzzles_follow_each_other_and_a_wrong_move_is_taken_back(tmp_path: Path) -> None:
    puzzles = tmp_path / "two.csv"
    puzzles.write_text(TWO)
    folder = tmp_path / "game"
    told = play(
        folder, "Qxf6", "Rxe7", "Nc1", "Qxc1", "Rd8", "Bxd8",
        **{"practice.puzzles": puzzles, "game.games": 2},
    )  # fmt: skip
    assert [sentence for sentence in told.said if "solution" in sentence or "right" in sentence] == [
        "Qxf6+ is not the solution: try again", "Rxe7 is right; go on", "Nc1 is right; go on", "Qxc1 is right: solved",
        "Rd8 is right; go on", "Bxd8 is right: solved",
    ]  # fmt: skip
    assert moves(folder) == "24...Bxg3 25. Rxe7 Qb1+ 26. Nc1 Qxc1+ 27. Qxc1"
    assert any(event["event"] == "task" and event["purpose"] == "take_back" for event in events(folder))
    assert moves(folder / "game-2") == "27. Qd6 Rd8 28. Qxd8+ Bxd8"
    assert [ended(folder), ended(folder / "game-2")] == [
        ("*", "puzzle 00008 is solved"),
        ("*", "puzzle 0000D is solved"),
    ]
    assert told.results == [ended(folder), ("*", "set up"), ended(folder / "game-2")]


def test_a_file_with_fewer_puzzles_than_were_asked_for_says_so(tmp_path: Path) -> None:
    puzzles = tmp_path / "two.csv"
    puzzles.write_text(TWO)
    asked = {"practice.puzzles": puzzles, "practice.puzzle": 2, "game.games": 9}
    told = play(tmp_path / "game", "Rd8", "Bxd8", **asked)
    assert told.said[0] == f"{puzzles} has only 1 of the 9 puzzles that were asked for, from number 2 on"
    assert [result for result, _ in told.results] == ["*"]


@pytest.mark.parametrize("word", ["resign", "new"])
def test_a_puzzle_that_is_given_up_ends_with_what_was_right(tmp_path: Path, word: str) -> None:
    puzzles = tmp_path / "two.csv"
    puzzles.write_text(TWO)
    folder = tmp_path / "game"
    play(folder, "Rxe7", word, "quit", **{"practice.puzzles": puzzles, "game.games": 2})
    result, why = ("0-1", "White resigns") if word == "resign" else ("*", "given up for a new game")
    right = "24...Bxg3 25. Rxe7 Qb1+ 26. Nc1 Qxc1+ 27. Qxc1"
    assert ended(folder) == (result, f"puzzle 00008 is not solved ({why}): right was {right}")
    assert ended(folder / "game-2") == ("*", "left by the person at the board")
    end = events(folder)[-1]
    assert (end["event"], end["reason"]) == ("end", ended(folder)[1])


def test_a_puzzle_that_ends_in_mate_is_solved_by_it_also_by_another_one(tmp_path: Path) -> None:
    puzzles = tmp_path / "mate.pgn"
    puzzles.write_text(MATE)
    for number, move in enumerate(("Ra8#", "Rb8#")):
        folder = tmp_path / str(number)
        play(folder, move, **{"practice.puzzles": puzzles})
        assert ended(folder) == ("1-0", "puzzle 1 is solved: checkmate")


def test_after_the_last_puzzle_whoever_wants_another_game_plays_the_engine(tmp_path: Path) -> None:
    puzzles = tmp_path / "mate.pgn"
    puzzles.write_text(MATE)
    folder = tmp_path / "game"
    play(folder, "Ra8#", "new", "e4", "resign", "quit", accompanied=True, **{"practice.puzzles": puzzles})
    assert ended(folder) == ("1-0", "puzzle 1 is solved: checkmate")
    assert moves(folder / "game-2").startswith("1. e4 ")
    assert ended(folder / "game-2") == ("0-1", "White resigns")


def test_a_puzzle_is_left_and_gone_on_with(tmp_path: Path) -> None:
    puzzles = tmp_path / "two.csv"
    puzzles.write_text(TWO)
    folder = tmp_path / "game"
    play(folder, "Rxe7", "quit", **{"practice.puzzles": puzzles, "game.games": 2})
    assert not (folder / "game-2").exists()
    told = Told()
    resume_games(folder, told, TypedLines(io.StringIO("Nc1\nQxc1\nresign\n")))
    assert [sentence for sentence in told.said if "right" in sentence] == [
        "Nc1 is right; go on",
        "Qxc1 is right: solved",
    ]
    assert json.loads((folder / "game-2" / "report.json").read_text())["result"] == "1-0"


def test_two_people_share_the_board(tmp_path: Path) -> None:
    folder = tmp_path / "game"
    told = play(
        folder, "e4", "e5", "takeback", "c5", "hint", "side", "draw", "no", "Nf3", "draw", "yes",
        **{"black.player": "human", "clock.time": "5+3"},
    )  # fmt: skip
    assert moves(folder) == "1. e4 c5 2. Nf3"
    assert told.results == [] or told.results[-1] == ("1/2-1/2", "draw agreed")
    assert "two people play: change seats" in told.said
    assert any(sentence.startswith("no engine is playing that could give a hint") for sentence in told.said)
    assert json.loads((folder / "report.json").read_text())["result"] == "1/2-1/2"
    start = events(folder)[0]
    assert start["white"] == start["black"] == "Human"


def test_the_side_to_move_resigns_where_two_people_play(tmp_path: Path) -> None:
    play(tmp_path / "game", "e4", "resign", **{"black.player": "human"})
    assert json.loads((tmp_path / "game" / "report.json").read_text())["result"] == "1-0"


@pytest.mark.parametrize(("answer", "played"), [("yes", "3... Qe7"), ("no", "3... Nf6")])
def test_the_coach_s_offer_is_taken_or_not(tmp_path: Path, answer: str, played: str) -> None:
    start = "r1bqkbnr/pppp1ppp/2n5/4p2Q/2B1P3/8/PPPP1PPP/RNB1K1NR b KQkq - 3 3"
    more = {"white.player": "engine", "black.player": "human", "game.fen": start, "practice.coach": True}
    told = play(tmp_path / "game", "Nf6", answer, *(["Qe7", "quit"] if answer == "yes" else ["quit"]), **more)
    assert any(sentence.startswith("Nf6 allows mate in 1") for sentence in told.said)
    assert moves(tmp_path / "game").startswith(played.replace("3... ", "3..."))


def test_the_robot_gives_odds(tmp_path: Path) -> None:
    play(tmp_path / "game", "e4", "quit", **{"practice.odds": "queen"})
    fen = events(tmp_path / "game")[0]["fen"]
    assert str(fen).startswith("rnb1kbnr/pppppppp/8/8/8/8/PPPPPPPP/RNBQKBNR w KQkq")


def test_hints_come_from_the_tables(tmp_path: Path) -> None:
    told = play(
        tmp_path / "game", "hint", "quit",
        **{"game.fen": "8/8/8/8/8/1k6/7r/K7 b - - 0 1", "black.player": "human", "white.player": "engine",
           "engine.syzygy": SYZYGY},
    )  # fmt: skip
    assert "I would play Rh1#" in told.said


def test_a_folder_without_tables_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"contains no Syzygy tables"):
        play(tmp_path / "game", "quit", **{"engine.syzygy": tmp_path})
