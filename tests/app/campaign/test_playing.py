"""Real games of a campaign, as small as they can be; and what a killed worker leaves."""

from __future__ import annotations

import errno
import fcntl
import json
import shutil
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path

import chess
import pytest
from typer.testing import CliRunner

from app.campaign.drawing import draw
from app.campaign.environment import environment_here, host_and_cpu
from app.campaign.folder import CAMPAIGN_FILE
from app.campaign.ledger import WHOLE, results_in
from app.campaign.schema import GAMES_FOLDER, TaskOutcome
from app.campaign.spec import CampaignSpec
from app.campaign.task import CampaignTask, SessionPlan
from app.campaign.tasks.lines import random_position
from app.campaign.tasks.playing import prepared
from app.campaign.tasks.relay import LossyRelay
from app.campaign.tasks.rows import TaskStory, crashed, result_of
from app.campaign.tasks.scratch import PREFIX, clear_left_behind, running_in, scratch_folder
from app.campaign.tasks.scripted_person import ScriptedPerson, standing_now
from app.campaign.troubles import MachineTrouble
from app.campaign.workers import play_task as worker
from app.campaign.workers.order import Kept, TaskOrder
from app.cli.commands import app as command_line
from app.pieces.layout import start_layout
from app.pieces.order import rearrange
from app.pieces.position import arranged
from app.records import EVENTS_FILE
from app.settings.files import SETTINGS_FILE
from controller.settings import CONTROLLER_FILE
from hardware.referee import PiecePose
from hardware.table import TableSettings
from tests.app.played_game import PlayedGame
from tests.waiting import PATIENCE, until

FILE = """
first_seed = 5
[draw]
game.plies = 1
engine.nodes = { from = 200, to = 500 }
randomisation.piece_mass = { from = 0.0, to = 0.4 }
"""


@pytest.fixture
def scratch(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Where games are played, by nobody else: elsewhere whoever comes next clears away what was left behind."""
    with tempfile.TemporaryDirectory() as folder:  # sockets want short paths
        monkeypatch.setenv("TMPDIR", folder)
        monkeypatch.setattr(tempfile, "tempdir", folder)
        yield Path(folder)


def test_two_real_games_and_one_of_them_again_to_the_last_bit(tmp_path: Path, scratch: Path) -> None:
    file, folder = tmp_path / "tiny.toml", tmp_path / "campaign"
    file.write_text(FILE, encoding="utf-8")
    done = CliRunner().invoke(
        command_line, ["campaign", str(file), "--games", "2", "--workers", "2", "--out", str(folder), "--json"]
    )
    assert done.exit_code == 0, done.output
    summary = json.loads(done.stdout)
    assert (summary["done"], summary["outcomes"], summary["failed"]) == (2, {"right": 2}, [])
    found = {one.game.seed: one for one in results_in(folder / WHOLE.ledger)}
    for seed, one in found.items():
        assert (one.game.plies, one.game.wrong_plies, len(one.plies)) == (1, 0, 1)
        assert one.game.world_state is not None
        assert 200.0 <= float(one.game.drawn["engine.nodes"]) <= 500.0
        assert not (folder / "games" / str(seed)).exists(), "what went right is not kept"
    again = CliRunner().invoke(command_line, ["campaign", "repeat", str(folder), "6", "--film", "--json"])
    assert again.exit_code == 0, again.output
    told = json.loads(again.stdout)
    assert (told["different"], told["now"]["world_state"]) == ([], found[6].game.world_state)
    game = folder / "games" / "6-again" / "game"
    assert (game / "game.webm").stat().st_size > 20000
    world = json.loads((game / SETTINGS_FILE).read_text(encoding="utf-8"))["rig"]["randomise"]
    assert Path(world) == game.parent / "world.toml", "so that the game can be gone on with where it is kept"
    assert "piece_mass" in Path(world).read_text(encoding="utf-8")
    assert not list(scratch.glob(f"{PREFIX}*"))


def test_a_ply_that_was_not_done_in_one_go_has_no_times_in_the_rows(tmp_path: Path) -> None:
    PlayedGame(tmp_path).play("e4 e5 Nf3", lambda number: {"resumed": True} if number == 2 else {})
    task = draw(CampaignSpec(draw={"start.line": True}), 0)
    rows = result_of(task, tmp_path, TaskStory(), "e").plies
    assert [(row.planned_s is None, row.real_s is None) for row in rows] == [(False,) * 2, (True,) * 2, (False,) * 2]


def test_placements_of_a_hand_say_nothing_of_the_robot(tmp_path: Path) -> None:
    at = {1: {"by": "hand", "placement_mm": {"white-pawn-e": 4.0}}, 2: {"placement_mm": {"black-pawn-e": 0.5}}}
    PlayedGame(tmp_path).play("e4 e5", lambda number: at[number])
    game = result_of(draw(CampaignSpec(draw={"start.line": True}), 0), tmp_path, TaskStory(), "e").game
    assert (game.placement_mean_mm, game.placement_max_mm) == (0.5, 0.5)


def test_random_plies_before_a_game_are_as_many_as_were_asked_for() -> None:
    def begins(kind: str, **start: int) -> chess.Board | None:
        given = {f"start.{name}": value for name, value in start.items()}
        task = draw(CampaignSpec.model_validate({"kind": kind, "draw": {"engine.nodes": 3, **given}}), 0)
        task = CampaignTask.model_validate_json(task.model_dump_json())
        with prepared(task, Path("nowhere"), film=False) as (settings, _):
            return None if settings.game.fen is None else chess.Board(settings.game.fen)

    begun, usual = begins("session", plies=0), chess.Board()
    assert begun == usual, "not as the seed decides"
    assert begins("session") == random_position(1) != usual
    for kind in ("session", "game"):
        for asked, played in ((4, 4), (7, 8)):
            board = begins(kind, plies=asked)
            assert board is not None
            assert board.ply() == played, "White begins"
    assert begins("game", plies=0) is begins("game") is None


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["no.toml", "--games", "2"], "campaign 'no.toml' cannot be read"),
        (["no.toml"], "Missing option '--games'"),
        (["no.toml", "--games", "1" + 19 * "0"], "it should be at most 9007199254740992"),
        (["no.toml", "--games", "2", "--shard", "3/2"], "--shard is '3/2'"),
        (["no.toml", "--games", "2", "--keep", "some"], "'--keep some' is unknown, choose from: all, failed, none"),
        (["no.toml", "--games", "2", "--workers", "1", "--scheduler", "tcp://h:1"], "leave one of them out"),
        (["repeat", "nowhere", "3"], "nowhere holds no campaign"),
    ],
)
def test_mistakes_are_answered_in_a_sentence(arguments: list[str], said: str) -> None:
    done = CliRunner().invoke(command_line, ["campaign", *arguments])
    assert done.exit_code == 2
    assert said in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("begun", [False, True])
def test_an_interrupted_campaign_says_where_what_was_played_is_if_anything_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, begun: bool
) -> None:
    file, folder = tmp_path / "tiny.toml", tmp_path / "campaign"
    file.write_text(FILE, encoding="utf-8")

    def interrupted(*_: object) -> None:
        if begun:
            folder.mkdir()
            (folder / WHOLE.ledger).touch()
        raise KeyboardInterrupt

    monkeypatch.setattr("app.campaign.running.run_campaign", interrupted)
    done = CliRunner().invoke(command_line, ["campaign", str(file), "--games", "2", "--out", str(folder)])
    assert done.exit_code == 130
    assert (f"what was played is in {folder}" in done.stderr) is begun
    assert ("before anything was played" in done.stderr) is not begun


def test_a_game_that_cannot_be_kept_is_the_machines_trouble_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    spec = CampaignSpec(draw={"start.line": True, "game.plies": 2})
    order = TaskOrder(
        task=draw(spec, 0), environment=environment_here((), ()), engines=(), keep=Kept.ALL, folder=tmp_path
    )
    (tmp_path / CAMPAIGN_FILE).touch()
    (tmp_path / GAMES_FOLDER).mkdir()
    (tmp_path / "played").mkdir()
    (tmp_path / "played" / "world.toml").touch()

    def full(_source: str, target: str) -> str:
        Path(target).touch()
        raise OSError(errno.ENOSPC, "No space left on device", target)

    game = crashed(order.task, "", "", "").game
    with monkeypatch.context() as patched:
        patched.setattr(worker.shutil, "copytree", partial(shutil.copytree, copy_function=full))
        with pytest.raises(MachineTrouble, match=r"cannot be kept: .*No space left on device"):
            worker._keep(order, tmp_path / "played", game)
    assert not list((tmp_path / GAMES_FOLDER).iterdir())
    assert worker._keep(order, tmp_path / "played", game).folder == f"{GAMES_FOLDER}/{game.seed}"


def test_a_game_whose_processes_cannot_be_started_is_the_machines_trouble(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_more(*_: object) -> None:
        raise BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable")

    task = draw(CampaignSpec(draw={"start.line": True}), 0)
    order = TaskOrder(task=task, environment=environment_here((), ()), engines=())
    monkeypatch.setattr(worker, "play_here", no_more)
    with pytest.raises(MachineTrouble, match="Resource temporarily unavailable"):
        worker._played(order, tmp_path)


def test_a_crash_is_of_the_machine_that_has_played_the_game(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def bug(*_: object) -> None:
        raise LookupError

    task = draw(CampaignSpec(draw={"start.line": True}), 0)
    monkeypatch.setattr(worker, "play_here", bug)
    game = worker._played(TaskOrder(task=task, environment=environment_here((), ()), engines=()), tmp_path).game
    assert (game.outcome, (game.host, game.cpu)) == (TaskOutcome.CRASHED, host_and_cpu())


def test_a_game_that_is_broken_off_in_compiled_code_has_not_crashed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whose dispatcher makes a SystemError of the interrupt."""

    def interrupted(*_: object) -> None:
        raise SystemError("returned a result with an exception set") from KeyboardInterrupt()

    task = draw(CampaignSpec(draw={"start.line": True}), 0)
    monkeypatch.setattr(worker, "play_here", interrupted)
    with pytest.raises(KeyboardInterrupt):
        worker._played(TaskOrder(task=task, environment=environment_here((), ()), engines=()), tmp_path)


def test_where_there_is_no_room_for_a_games_folder_it_is_played_later(
    scratch: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise FileNotFoundError(errno.ENOENT, "No usable temporary directory found in ['/tmp']")

    for module, name in ((fcntl, "flock"), (tempfile, "mkdtemp"), (tempfile, "gettempdir")):
        monkeypatch.setattr(module, name, full)
        with (
            pytest.raises(MachineTrouble, match=r"no folder for a game can be made \(No usable temporary directory"),
            scratch_folder(1),
        ):
            pass
        assert not list(scratch.iterdir())


@pytest.mark.usefixtures("scratch")
def test_what_a_killed_worker_leaves_is_ended_and_cleared_away() -> None:
    code = """
import subprocess, sys, time
from app.campaign.tasks.scratch import scratch_folder
with scratch_folder(77) as folder:
    world = [sys.executable, "-c", "import time; time.sleep(600)", str(folder)]
    subprocess.Popen(world, start_new_session=True)
    print(folder, flush=True)
    time.sleep(600)
"""
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as worker:
        assert worker.stdout is not None
        folder = Path(worker.stdout.readline().strip())
        clear_left_behind()
        assert folder.is_dir(), "its worker lives"
        worker.kill()
    assert len(running_in(folder)) == 1
    clear_left_behind()
    assert not folder.exists()
    until(lambda: not running_in(folder), "the world's end")
    with scratch_folder(78) as mine:
        clear_left_behind()
        assert mine.is_dir()
    assert not mine.exists()


def test_the_program_of_a_game_ends_in_order_when_its_worker_is_killed(tmp_path: Path) -> None:
    code = """
import sys
from pathlib import Path
from app.campaign.drawing import draw
from app.campaign.spec import CampaignSpec
from app.campaign.tasks.kills import play_with_kills
play_with_kills(draw(CampaignSpec(draw={"start.line": True, "game.plies": 200}), 0), Path(sys.argv[1]), False)
"""
    record = tmp_path / "game" / EVENTS_FILE
    with subprocess.Popen([sys.executable, "-c", code, str(tmp_path)]) as worker:
        until(lambda: record.exists() and b'"event":"ply"' in record.read_bytes(), "a ply")
        worker.kill()
    until(lambda: not running_in(tmp_path), "the end of all that it has started")
    ended = json.loads(record.read_text(encoding="utf-8").splitlines()[-1])
    assert (ended["event"], ended["reason"]) == ("end", "interrupted")


def test_a_relay_loses_what_its_seed_says_and_follows_another_controller(tmp_path: Path) -> None:
    def controller() -> socket.socket:
        made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        made.bind(("127.0.0.1", 0))
        made.settimeout(0.05)
        content = {"host": "127.0.0.1", "port": made.getsockname()[1]}
        (tmp_path / CONTROLLER_FILE).write_text(json.dumps(content), encoding="utf-8")
        return made

    def passed(seed: int, loss: float) -> list[int]:
        found, senders = list[int](), list[tuple[str, int]]()
        with (
            controller() as end,
            LossyRelay(tmp_path, loss, seed) as relay,
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client,
        ):
            client.connect(("127.0.0.1", relay.port))
            client.settimeout(PATIENCE)
            for number in range(40):
                client.send(bytes([number]))

            def all_told() -> bool:
                """Each of them has come, or was lost."""
                with suppress(TimeoutError):
                    data, sender = end.recvfrom(99)
                    found.append(data[0])
                    senders.append(sender)
                return len(found) + relay.lost >= 40

            until(all_told, "what was sent")
            if not loss:
                end.sendto(b"yes", senders[-1])
                assert client.recv(99) == b"yes"
            assert relay.lost == 40 - len(found)
        return found

    assert passed(3, 0.4) == passed(3, 0.4) != passed(4, 0.4)
    assert 14 <= len(passed(3, 0.4)) <= 34
    assert passed(3, 0.0) == list(range(40))


@pytest.mark.parametrize("said", ["checkmate, result 0-1: another game?", "stalemate, result 1/2-1/2: another game?"])
def test_a_scripted_person_leaves_when_the_game_is_over(said: str, monkeypatch: pytest.MonkeyPatch) -> None:
    person = ScriptedPerson(Path("nowhere"), 1, chess.Board(), SessionPlan(acts=5), TableSettings())
    monkeypatch.setattr(person, "_do", lambda act: ["look", "fix"])
    monkeypatch.setattr(person, "_amiss", lambda: None)
    answers = []
    for sentence in ("White to move: your move", said, said):
        person.prompt(sentence)
        answers.append(person.typed.next(1.0))
    assert answers == ["look", "quit", "quit"]
    assert person.mishaps == []
    assert sum(person.acts.values()) == 1


def test_the_controller_sees_through_a_bad_link_that_a_program_was_killed(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as end:
        end.bind(("127.0.0.1", 0))
        end.settimeout(PATIENCE)
        (tmp_path / CONTROLLER_FILE).write_text(json.dumps({"host": "127.0.0.1", "port": end.getsockname()[1]}))
        with LossyRelay(tmp_path, 0.3, 5) as relay:

            def heard_of(name: bytes) -> tuple[str, int]:
                """Where a new client is to the controller, which sends until it is heard, and is killed."""
                with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
                    client.connect(("127.0.0.1", relay.port))
                    for _ in range(40):
                        client.send(name)
                    while (heard := end.recvfrom(99))[0] != name:
                        pass
                    return heard[1]

            first = heard_of(b"first")
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
                own.connect(first)
                with pytest.raises(ConnectionRefusedError):
                    until(lambda: not own.send(b"telemetry"), "a closed port")
            heard_of(b"second")


def test_of_two_pieces_on_one_square_a_person_takes_the_one_that_does_not_belong_there() -> None:
    table, board = TableSettings(), chess.Board()
    specs = {piece.name: piece for piece in start_layout(board, table)}
    x, y = table.xy(specs["white-king"].place)
    at = {name: table.xy(piece.place) for name, piece in specs.items()} | {"white-pawn-e": (x + 0.004, y + 0.018)}
    poses = [PiecePose(name, *spot, 0.0, 0.0) for name, spot in at.items()]
    stands, beside = standing_now(poses, specs, table)
    assert stands.find("white-king") == specs["white-king"]
    assert beside == {"white-pawn-e": at["white-pawn-e"]}
    (transfer,) = rearrange(stands, arranged(stands, board), seen=beside)
    assert (transfer.name, transfer.target, transfer.grasped_at(table)) == (
        "white-pawn-e", specs["white-pawn-e"].place, at["white-pawn-e"]
    )  # fmt: skip
