"""Whole matches on the rig ``board``: games, set-ups, take-backs, and going on after every possible crash."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from collections.abc import Collection
from pathlib import Path
from typing import Any

import chess
import chess.pgn
import pytest
from typer.testing import CliRunner

from app import UserError
from app.cli.commands import app
from app.play.launch import resume_games, run_games
from app.play.match import last_round
from app.play.session import SessionResult
from app.records import EVENTS_FILE, read_events, read_history
from app.settings.files import keep_settings, kept_settings, settings_of
from app.terminal.game_display import UserInterface
from app.terminal.typed_lines import TypedLines
from engine.stockfish import find_engine
from hardware.table import Captured, TableSettings

TABLE = TableSettings()
ALL_KINDS = "e4 d5 exd5 c5 dxc6 a6 cxb7 Nf6 bxa8=Q e6 Nf3 Bc5 Bb5+ axb5 O-O O-O"
"""Every kind of move: quiet, capture, en passant, promotion with capture, castling."""


MASTERS = Path(__file__).resolve().parents[2] / "data" / "master_games.pgn"


def play(folder: Path, typed: str | None = None, **changes: Any) -> SessionResult:
    named = {name.replace("__", "."): value for name, value in changes.items()}
    settings = settings_of({"rig.name": "board", "rig.video": False, "out": folder, **named})
    return run_games(settings, UserInterface(), None if typed is None else TypedLines(io.StringIO(typed)))


def moves_of(folder: Path) -> list[str]:
    with (folder / "game.pgn").open(encoding="utf-8") as stream:
        game = chess.pgn.read_game(stream)
    assert game is not None
    board, sans = game.board(), []
    for move in game.mainline_moves():
        sans.append(board.san(move))
        board.push(move)
    return sans


def players_of(folder: Path) -> tuple[str, str]:
    with (folder / "game.pgn").open(encoding="utf-8") as stream:
        headers = chess.pgn.read_headers(stream)
    assert headers is not None
    return headers["White"], headers["Black"]


def test_a_line_with_every_kind_of_move(tmp_path: Path) -> None:
    done = play(tmp_path / "game", game__moves=ALL_KINDS)
    assert done.holds
    assert moves_of(tmp_path / "game") == ALL_KINDS.split()
    history = read_history(tmp_path / "game" / EVENTS_FILE, TABLE)
    history.inventory.check_against(history.board)
    assert done.report.kinds.promotion.n == 1
    assert done.report.kinds.castling.n == 2


def test_a_game_begun_by_new_goes_on_after_it_was_left(tmp_path: Path) -> None:
    folder = tmp_path / "match"
    left = play(folder, "e4\nnew\nd4\nquit\n", white__player="human", engine__nodes=50)
    assert (left.folder, left.report.result, left.report.plies) == (folder / "game-2", "*", 2)
    assert last_round(folder) == (folder / "game-2", 2, False)
    done = resume_games(
        left.folder, UserInterface(), TypedLines(io.StringIO("resign\n"))
    )  # whichever folder of the match is named
    assert (done.folder, done.report.result, done.report.plies) == (folder / "game-2", "0-1", 2)
    with pytest.raises(UserError, match="is over after 2 plies"):
        resume_games(folder, UserInterface(), TypedLines(io.StringIO("")))


def test_the_last_round_of_a_match_that_began_with_setting_up_is_its_game(tmp_path: Path) -> None:
    folder = tmp_path / "match"
    play(folder, game__standing="4k3/8/8/8/8/8/4P3/4K3 w - - 0 1", game__fen=chess.STARTING_FEN, game__moves="e4")
    assert (folder / "set-up-1").is_dir()
    assert last_round(folder) == (folder, 1, False)


def broken_engine(folder: Path) -> str:
    """One that never names a move."""
    path = folder / "broken"
    path.write_text(
        f"#!{sys.executable} -IS\nimport sys\nfor line in sys.stdin:\n"
        "    word = line.split()[:1]\n"
        "    if word == ['uci']: print('id name Broken\\nuciok', flush=True)\n"
        "    if word == ['isready']: print('readyok', flush=True)\n"
        "    if word == ['go']: print('bestmove (none)', flush=True)\n",
        encoding="utf-8",
    )
    path.chmod(0o755)
    return str(path)


class Told(UserInterface):
    """Remembers what it was told."""

    def __init__(self) -> None:
        self.said: list[str] = []

    def phase(self, text: str) -> None:
        self.said.append(text)

    def say(self, sentence: str, squares: Collection[str] = ()) -> None:
        self.said.append(sentence)


def test_a_game_whose_engine_failed_goes_on_with_another_one(tmp_path: Path) -> None:
    broken = broken_engine(tmp_path)
    folder = tmp_path / "game"
    failed = play(folder, black__path=broken, game__fen=chess.STARTING_FEN, game__plies=2, engine__nodes=20)
    assert failed.resumable
    assert "it named no move in" in failed.report.failures[0].reason
    before = (folder / "settings.json").read_text(encoding="utf-8")
    missing = CliRunner().invoke(app, ["resume", str(folder), "--no-page", "--engine", "./none"])
    assert missing.exit_code == 2
    assert "is not an executable file" in missing.output
    assert (folder / "settings.json").read_text(encoding="utf-8") == before
    done = CliRunner().invoke(app, ["resume", str(folder), "--no-page", "--engine", find_engine()])
    assert done.exit_code == 0, done.output
    kept = kept_settings(folder)
    assert (kept.engine.path, kept.white.path, kept.black.path) == (find_engine(),) * 3
    assert len(moves_of(folder)) == 2


def test_another_engine_where_none_plays_is_refused(tmp_path: Path) -> None:
    play(tmp_path / "game", game__moves="e4 e5", game__plies=1)
    done = CliRunner().invoke(app, ["resume", str(tmp_path / "game"), "--no-page", "--engine", "stockfish"])
    assert (done.exit_code, done.output) == (
        2, "touchmove: --engine has no effect here, it is for engines that choose the moves (without --moves): leave "
        "it out\n",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "option", "said"),
    [
        (
            {"white.player": "human", "black.player": "human"},
            "--engine",
            "no engine plays in this game: leave --engine",
        ),
        ({"online.use": "person"}, "--engine", "no engine plays in this game: leave --engine"),
        ({"link.role": "host"}, "--black-engine", "only one engine plays in this game: name it with --engine"),
    ],
)
def test_another_engine_takes_the_place_of_one_that_plays(
    tmp_path: Path, changes: dict[str, str], option: str, said: str
) -> None:
    keep_settings(tmp_path, settings_of(changes))
    done = CliRunner().invoke(app, ["resume", str(tmp_path), "--no-page", option, "stockfish"])
    assert done.exit_code == 2
    assert done.output.startswith(f"touchmove: {said}")


def test_a_person_whose_robots_engine_failed_is_told_how_to_go_on(tmp_path: Path) -> None:
    named = {
        "rig.name": "board", "rig.video": False, "out": tmp_path / "game", "black.player": "human", "engine.nodes": 5,
        "engine.path": broken_engine(tmp_path),
    }  # fmt: skip
    told = Told()
    run_games(settings_of(named), told, TypedLines(io.StringIO("quit\n")))
    assert "starting broken" in told.said
    (sentence,) = [one for one in told.said if one.startswith("engine ")]
    assert sentence.endswith(
        "name another one with --engine PATH ('quit' first, then 'touchmove resume' takes it); say 'go' when I may ask "
        "it again"
    )


def test_players_without_a_name_think_without_one(tmp_path: Path) -> None:
    (tmp_path / "game.pgn").write_text("1. e4 *\n", encoding="utf-8")
    named = {"rig.name": "board", "rig.video": False, "out": tmp_path / "game", "game.replay": tmp_path / "game.pgn"}
    told = Told()
    run_games(settings_of(named), told)
    assert "White thinks" in told.said


def test_a_repeatable_game_at_a_level_is_refused_in_words_of_every_command(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"at full strength: leave it out, or the strength in Elo or skill$"):
        play(tmp_path / "game", engine__nodes=5, white__elo=500)


def test_a_position_for_which_pieces_are_missing_is_refused_before_anything_is_started(tmp_path: Path) -> None:
    queens = "qqqqqqqk/8/8/8/8/8/8/K7 w - - 0 1"
    with pytest.raises(UserError, match="the position needs 7 black queens, only 4 stand"):
        play(tmp_path / "match", game__standing=chess.STARTING_FEN, game__fen=queens, game__plies=0)
    assert not (tmp_path / "match").exists()


def test_a_refused_takeback_leaves_the_clock_running(tmp_path: Path) -> None:
    told = Told()
    named = {
        "rig.name": "board", "rig.captured": "box", "rig.video": False, "out": tmp_path / "game", "clock.time": "5+0",
        "game.fen": "4k3/8/8/3p4/4P3/8/8/4K3 w - - 0 1", "white.player": "human", "engine.nodes": 50,
    }  # fmt: skip
    done = run_games(settings_of(named), told, TypedLines(io.StringIO("exd5\ntakeback\nKd2\nresign\n")))
    assert any("box" in sentence for sentence in told.said), told.said
    plies = read_history(tmp_path / "game" / EVENTS_FILE, TABLE.model_copy(update={"captured": Captured.BOX})).plies
    left = [ply.clock_s["white"] for ply in plies if ply.clock_s is not None and ply.side == "white"]
    assert len(left) == 2
    assert left[1] <= left[0] < 300.0
    assert done.report.result == "0-1"


def test_a_guard_and_a_look_need_a_camera(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"^this rig has no camera to watch for hands: leave out --guard$"):
        play(tmp_path / "game", game__moves="e4", vision__guard=True)
    with pytest.raises(UserError, match=r"^this rig has no camera to check each ply: leave out --verify$"):
        play(tmp_path / "other", game__moves="e4", vision__verify=True)


@pytest.mark.parametrize("number", [1, 4, 7])
def test_games_of_masters_are_played_again(tmp_path: Path, number: int) -> None:
    done = play(tmp_path / "game", game__replay=MASTERS, game__replay_game=number, game__plies=1000)
    with MASTERS.open(encoding="utf-8") as stream:
        games = [chess.pgn.read_game(stream) for _ in range(number)]
    assert games[-1] is not None
    assert done.holds
    assert done.report.result == games[-1].headers["Result"]
    assert done.report.plies == len(list(games[-1].mainline_moves()))


def test_several_games_with_the_pieces_set_up_in_between(tmp_path: Path) -> None:
    path = tmp_path / "games.pgn"
    path.write_text(
        f'[Event "A"]\n[Result "1-0"]\n\n{ALL_KINDS} 1-0\n\n'
        '[Event "B"]\n[SetUp "1"]\n[FEN "4k3/P7/8/8/8/8/8/4K3 w - - 0 1"]\n[Result "*"]\n\n1. a8=N Kd7 *\n\n'
        '[Event "C"]\n[Result "1/2-1/2"]\n\n1. e4 e5 1/2-1/2\n',
        encoding="utf-8",
    )
    done = play(tmp_path / "match", game__replay=path)
    assert done.holds
    assert [one.report.result for one in (*done.before, done)] == ["1-0", "*", "1/2-1/2", "*", "1/2-1/2"]
    assert moves_of(tmp_path / "match" / "game-2") == ["a8=N", "Kd7"], "to the end, though nobody can win any more"
    before = None
    for name in ("", "set-up-2", "game-2", "set-up-3", "game-3"):
        events = tmp_path / "match" / name / EVENTS_FILE
        start = {piece.name: piece.place for piece in read_events(events)[0].inventory}  # type: ignore[union-attr]
        assert before is None or start == before, f"{name} begins as the round before has ended"
        before = {piece.name: str(piece.place) for piece in read_history(events, TABLE).inventory}
    assert read_history(tmp_path / "match" / "set-up-2" / EVENTS_FILE, TABLE).board.fen().startswith("4k3/P7/")


LINE = "e4 d5 exd5 Qxd5 Nc3"


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("whole") / "match"
    path = folder.parent / "two.pgn"
    path.write_text(f'{LINE} *\n\n[SetUp "1"]\n[FEN "{chess.STARTING_FEN}"]\n\n1. d4 d5 *\n', encoding="utf-8")
    assert play(folder, game__replay=path).holds
    return folder


def cut(whole: Path, folder: Path, name: str, lines: int) -> int:
    """The match as it lies there when it was killed after so many lines of one round's record; how many there are."""
    folder.mkdir()
    (folder / "settings.json").write_text((whole / "settings.json").read_text())
    rounds = ["", "set-up-2", "game-2"]
    for one in rounds[: rounds.index(name) + 1]:
        (folder / one).mkdir(exist_ok=True)
        events = (whole / one / EVENTS_FILE).read_text().splitlines(keepends=True)
        (folder / one / EVENTS_FILE).write_text("".join(events[: lines if one == name else None]))
    return len(events)


@pytest.mark.parametrize("name", ["", "set-up-2", "game-2"])
def test_a_match_killed_after_any_line_of_its_record_goes_on(whole: Path, tmp_path: Path, name: str) -> None:
    total = cut(whole, tmp_path / "count", name, 1)
    for lines in range(1, total, 3 if not name else 1):  # each third one of the longest record: to save time
        folder = tmp_path / f"cut-{lines}"
        cut(whole, folder, name, lines)
        done = resume_games(folder, UserInterface())
        assert done.holds, lines
        assert moves_of(folder / "game-2") == ["d4", "d5"]
        if not name:
            assert moves_of(folder) == LINE.split(), "no ply lost, none doubled"
        final = read_history(folder / "game-2" / EVENTS_FILE, TABLE)
        final.inventory.check_against(final.board)


def test_a_match_that_is_over_is_not_resumed(whole: Path) -> None:
    with pytest.raises(UserError, match="is over after 2 plies"):
        resume_games(whole, UserInterface())


def test_a_person_plays_takes_back_changes_sides_and_resigns(tmp_path: Path) -> None:
    typed = "e4\nnonsense\nhint\ntakeback\nd4\nside\nresign\n"
    done = play(tmp_path / "game", typed, white__player="human", engine__nodes=500)
    sans = moves_of(tmp_path / "game")
    assert sans[0] == "d4"
    assert len(sans) == 3, "the engine goes on with the person's pieces, and the person resigns with its"
    assert (done.report.result, done.report.exit_reason) == ("1-0", "Black resigns")
    assert not done.resumable
    assert players_of(tmp_path / "game")[1] == "Human", "who loses has Black in the PGN, too"
    events = [json.loads(line) for line in (tmp_path / "game" / EVENTS_FILE).read_text().splitlines()]
    back = next(event for event in events if event["event"] == "task")
    assert (back["purpose"], back["taken_back"]) == ("take_back", 2)
    assert [event["by"] for event in events if event["event"] == "ply"][:2] == ["hand", "arm"]


def test_sides_that_were_changed_stay_so_after_a_resume(tmp_path: Path) -> None:
    left = play(tmp_path / "game", "e4\nside\nquit\n", white__player="human", engine__nodes=50)
    assert left.resumable
    done = resume_games(tmp_path / "game", UserInterface(), TypedLines(io.StringIO("resign\n")))
    assert (done.report.result, done.report.exit_reason) == ("1-0", "Black resigns")
    assert len(moves_of(tmp_path / "game")) == 3
    assert players_of(tmp_path / "game")[1] == "Human"


def test_a_person_who_pauses_may_leave(tmp_path: Path) -> None:
    left = play(tmp_path / "game", "pause\nquit\n", white__player="human", engine__nodes=50)
    assert left.resumable
    assert (left.report.exit_reason, left.report.plies) == ("left by the person at the board", 0)


def test_a_move_ends_a_pause(tmp_path: Path) -> None:
    left = play(tmp_path / "game", "pause\nNf3\nquit\n", white__player="human", engine__nodes=50)
    assert moves_of(tmp_path / "game")[0] == "Nf3"
    assert left.report.plies == 2


def test_a_take_back_brings_captured_and_promoted_pieces_back(tmp_path: Path) -> None:
    start = "1n2k3/P7/8/8/8/8/8/4K2R w K - 0 1"
    typed = "axb8=Q\ntakeback\nO-O\ntakeback\na8=R\nresign\n"
    play(tmp_path / "game", typed, white__player="human", engine__nodes=500, game__fen=start)
    history = read_history(tmp_path / "game" / EVENTS_FILE, TABLE)
    history.inventory.check_against(history.board)
    assert moves_of(tmp_path / "game")[0] == "a8=R"


def test_nobody_at_the_keyboard_leaves_a_game_that_goes_on(tmp_path: Path) -> None:
    done = play(tmp_path / "game", "e4\n", white__player="human", engine__nodes=500)
    assert not done.holds
    assert done.resumable
    again = resume_games(tmp_path / "game", UserInterface(), TypedLines(io.StringIO("d4\nresign\n")))
    assert again.report.result == "0-1"
    assert moves_of(tmp_path / "game")[::2] == ["e4", "d4"]


def test_one_ply_is_not_called_plies(tmp_path: Path) -> None:
    assert play(tmp_path / "game", game__moves="e4").report.exit_reason == "1 ply played"


def test_what_only_devices_need_is_not_loaded_for_a_prompt() -> None:
    """So that the rig without devices asks for the first move within three seconds on a slow machine, too."""
    heavy = ("numba", "mujoco", "scipy", "cv2", "pyrealsense2", "av", "matplotlib")
    script = f"import sys, app.play.launch; print([name for name in {heavy} if name in sys.modules])"
    loaded = subprocess.run([sys.executable, "-P", "-c", script], capture_output=True, text=True, check=True)
    assert loaded.stdout.strip() == "[]"


def test_what_only_an_unknown_board_needs_is_not_loaded_for_a_game() -> None:
    """Parts of SciPy take half a second of each start, and a camera knows its board from the last time."""
    code = "import sys, app.execution.recovery, app.motion.planner; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True)
    modules = set(loaded.stdout.split())
    assert {"cv2", "vision.board.find", "app.motion.planner"} <= modules
    assert not {"scipy.optimize", "scipy.spatial"} & modules


def test_a_report_is_computed_again_from_the_events(tmp_path: Path) -> None:
    done = play(tmp_path / "game", game__moves="e4 d5 exd5")
    run = CliRunner().invoke(app, ["report", str(tmp_path / "game"), "--json"])
    assert run.exit_code == 0, run.output
    again, first = json.loads(run.output), json.loads(done.report.model_dump_json())
    assert {**again, "details": None} == {**first, "details": None}
    assert "capture" in CliRunner().invoke(app, ["report", str(tmp_path / "game")]).output
    assert CliRunner().invoke(app, ["report", str(tmp_path)]).exit_code == 2
