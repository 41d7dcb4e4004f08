"""Campaigns of stubs: what becomes of them whatever happens to their workers."""

from __future__ import annotations

import errno
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import CancelledError, Executor, Future
from functools import partial
from multiprocessing.context import SpawnProcess
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app import UserError
from app.campaign.drawing import draw
from app.campaign.environment import CampaignEnvironment, environment_here
from app.campaign.folder import CampaignFolderError, kept_campaign
from app.campaign.ledger import WHOLE, Shard, results_in
from app.campaign.repeating import Repetition
from app.campaign.running import CampaignSummary, CampaignWish, _answered, run_campaign
from app.campaign.scheduling import CampaignStopped, HandedOut, Scheduling, results_of
from app.campaign.schema import GameRow, TaskOutcome, TaskResult
from app.campaign.spec import CampaignSpec
from app.campaign.task import CampaignTask
from app.campaign.tasks.rows import crashed
from app.campaign.troubles import BrokenOff, EnvironmentDiffers, MachineTrouble
from app.campaign.workers.local_processes import LocalWorkers, WorkerDied
from app.campaign.workers.order import TaskOrder
from app.campaign.workers.stub import StubPlan, play_stub
from app.cli.commands import app as command_line
from app.measure.bench.campaign import SPEC, Unwatched
from app.records import RecordError
from tests.waiting import PATIENCE, until

GAMES = 12
QUIET = StubPlan()


def run(folder: Path, plan: StubPlan = QUIET, games: int = GAMES, **wish: object) -> CampaignSummary:
    asked = CampaignWish(games, folder, **{"workers": 2, "play": partial(play_stub, plan), "pause": 0.0, **wish})  # type: ignore[arg-type]
    return run_campaign(SPEC, asked, Unwatched())


def rows(folder: Path, name: str = WHOLE.ledger) -> dict[int, TaskResult]:
    found = list(results_in(folder / name))
    assert len({one.game.index for one in found}) == len(found), "none is there twice"
    return {
        one.game.index: one.model_copy(update={"game": one.game.model_copy(update={"attempts": 1})}) for one in found
    }


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> dict[int, TaskResult]:
    folder = tmp_path_factory.mktemp("campaign") / "quiet"
    summary = run(folder)
    assert summary.holds
    assert (summary.done, summary.outcomes) == (GAMES, {TaskOutcome.RIGHT: GAMES})
    assert (folder / "games.parquet").exists()
    return rows(folder)


def test_killed_workers_and_a_full_disk_change_no_row(tmp_path: Path, undisturbed: dict[int, TaskResult]) -> None:
    folder = tmp_path / "campaign"
    plan = StubPlan(marks=tmp_path, deaths={3: 1, 4: 1, 9: 2}, full=(6,))
    summary = run(folder, plan)
    assert rows(folder) == undisturbed
    assert {one.game.seed: one.game.attempts for one in results_in(folder / WHOLE.ledger) if one.game.attempts > 1} == {
        3: 2, 4: 2, 6: 2, 9: 3,
    }  # fmt: skip
    assert summary.holds


def test_who_kills_its_worker_each_time_has_crashed_and_all_others_are_played(
    tmp_path: Path, undisturbed: dict[int, TaskResult]
) -> None:
    summary = run(tmp_path / "campaign", StubPlan(marks=tmp_path, deaths={5: 99}))
    found = rows(tmp_path / "campaign")
    (crash,) = summary.failed
    assert (crash.seed, crash.outcome, crash.attempts) == (5, TaskOutcome.CRASHED, 3)
    assert (crash.host, crash.cpu) == (None, None), "this machine has handed it out, and played nothing"
    assert crash.log is not None
    assert crash.log.count("was killed (SIGKILL)") == 3
    assert {index: one for index, one in found.items() if index != 4} == {
        index: one for index, one in undisturbed.items() if index != 4
    }
    assert not summary.holds


class Fewer(Unwatched):
    """Breaks off after some games."""

    def __init__(self, games: int) -> None:
        self.left, self.before = games, 0

    def begun(self, wanted: int, before: tuple[GameRow, ...], dashboard: str | None) -> None:
        self.before = len(before)

    def finished(self, game: GameRow) -> None:
        self.left -= 1
        if not self.left:
            raise KeyboardInterrupt


def test_an_interrupted_campaign_goes_on_by_the_same_call(tmp_path: Path, undisturbed: dict[int, TaskResult]) -> None:
    folder, wish = tmp_path / "campaign", partial(CampaignWish, workers=1, play=partial(play_stub, QUIET))
    with pytest.raises(KeyboardInterrupt):
        run_campaign(SPEC, wish(GAMES, folder), Fewer(4))
    played = len(rows(folder))
    assert 4 <= played < GAMES
    assert (folder / "games.parquet").exists()
    ledger = folder / WHOLE.ledger
    ledger.write_bytes(ledger.read_bytes()[:-5])  # and the power went
    shown = Fewer(99)
    assert run_campaign(SPEC, wish(GAMES, folder), shown).holds
    assert shown.before == played - 1
    assert rows(folder) == undisturbed


def test_a_second_interruption_does_not_lose_what_was_played(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(workers: LocalWorkers) -> None:
        workers.shutdown()  # what was handed out is played by then
        raise KeyboardInterrupt

    monkeypatch.setattr(LocalWorkers, "stop", stop)
    folder = tmp_path / "campaign"
    with pytest.raises(KeyboardInterrupt):
        run_campaign(SPEC, CampaignWish(GAMES, folder, workers=1, play=partial(play_stub, QUIET)), Fewer(1))
    assert len(rows(folder)) == 2, "the one that was shown, and the one that waited behind it"


def test_a_part_without_games_is_said_to_be_empty(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    none = CampaignSummary(folder=tmp_path, games=0, done=0, outcomes={}, failed=(), wall_s=0.0, played=0)
    monkeypatch.setattr("app.campaign.running.run_campaign", lambda *_: none)
    file = tmp_path / "campaign.toml"
    file.write_text("[draw]\nstart.line = true\n", encoding="utf-8")
    done = CliRunner().invoke(command_line, ["campaign", str(file), "--games", "2", "--shard", "3/8"])
    assert done.exit_code == 0
    assert "part 3 of 8 is empty: there are fewer games than parts" in done.stderr
    assert "0 of 0" not in done.stderr


@pytest.mark.parametrize("different", [(), ("world_state",)])
def test_a_repetition_in_another_environment_says_so_whatever_came_of_it(
    tmp_path: Path, different: tuple[str, ...]
) -> None:
    game = crashed(draw(SPEC, 0), "it died", "log", "e").game
    told = Repetition(
        folder=tmp_path, before=game, now=game, different=different, environment=("sources is b instead of a",)
    )
    assert list(told.sentences())[-1] == "the environment is another one: sources is b instead of a"
    assert not any("another one" in one for one in told.model_copy(update={"before": None}).sentences())


def test_shards_come_to_the_same_rows_as_the_whole(tmp_path: Path, undisturbed: dict[int, TaskResult]) -> None:
    for number in (2, 1):
        assert run(tmp_path / "campaign", workers=1, shard=Shard((number, 2))).games == GAMES // 2
    halves = [rows(tmp_path / "campaign", Shard((number, 2)).ledger) for number in (1, 2)]
    assert halves[0] | halves[1] == undisturbed
    whole = run(tmp_path / "campaign")
    assert (whole.played, whole.done, whole.holds) == (0, GAMES, True), "cut otherwise, nothing is played again"


def test_what_two_parts_have_played_counts_once(tmp_path: Path) -> None:
    folder = tmp_path / "campaign"
    run(folder)
    shutil.copy(folder / WHOLE.ledger, folder / Shard((1, 2)).ledger)
    again = run(folder)
    assert (again.done, again.outcomes, again.holds) == (GAMES, {TaskOutcome.RIGHT: GAMES}, True)


def test_a_folder_holds_one_campaign_which_may_grow(tmp_path: Path) -> None:
    folder, none = tmp_path / "campaign", partial(CampaignWish, workers=1, play=partial(play_stub, QUIET))
    run(folder, games=1, workers=1)
    assert run(folder, games=2, workers=1).played == 1
    assert kept_campaign(folder).games == 2
    other = CampaignSpec.model_validate({"draw": {"start.line": True, "game.plies": 3}})
    with pytest.raises(
        CampaignFolderError, match=r"holds another campaign \(draw.game.plies is 40 there, and 3 here\)"
    ):
        run_campaign(other, none(1, folder), Unwatched())
    text = (folder / "campaign.toml").read_text(encoding="utf-8")
    (folder / "campaign.toml").write_text(text.replace('python = "3', 'python = "2'), encoding="utf-8")
    with pytest.raises(CampaignFolderError, match=r"begun in another environment \(python is 3\.\S+ instead of 2"):
        run(folder, games=1, workers=1)
    strange = tmp_path / "strange"
    strange.mkdir()
    (strange / "thesis.tex").touch()
    with pytest.raises(CampaignFolderError, match=r"holds thesis.tex, and no campaign"):
        run(strange, games=1, workers=1)
    assert [path.name for path in strange.iterdir()] == ["thesis.tex"], "nothing is left there"


@pytest.mark.parametrize(
    ("first_seed", "games", "said"),
    [
        (1, 10, "what is drawn for seed 1 cannot be played: start.plies and start.line exclude each other"),
        (2**53 - 5, 6, "6 games from first_seed = 9007199254740987 on lead beyond 9007199254740992, up to which seeds"),
    ],
)
def test_a_campaign_that_cannot_be_drawn_to_its_end_says_so(
    tmp_path: Path, first_seed: int, games: int, said: str
) -> None:
    ranges = {"start.plies": {"one_of": [0, 4]}, "start.line": True}
    spec = CampaignSpec.model_validate({"first_seed": first_seed, "draw": ranges})
    wish = CampaignWish(games, tmp_path / "campaign", workers=1, play=partial(play_stub, QUIET))
    with pytest.raises(CampaignStopped, match=said):
        run_campaign(spec, wish, Unwatched())


def test_an_engine_that_no_worker_has_ends_it_before_a_game_is_played(tmp_path: Path) -> None:
    spec = CampaignSpec.model_validate({"draw": {"engine.nodes": 3, "white.path": str(tmp_path / "none")}})
    wish = CampaignWish(1, tmp_path / "campaign", workers=1, play=partial(play_stub, QUIET))
    with pytest.raises(UserError, match=r"none cannot play on \S+ \(it is not there\)"):
        run_campaign(spec, wish, Unwatched())
    assert not (tmp_path / "campaign").exists()


class Scripted(Executor):
    """Answers at once, as a function of the order and of how often it was asked."""

    def __init__(self, answer: Callable[[int, int], BaseException | None]) -> None:
        self.answer, self.asked = answer, list[int]()

    def submit(self, fn: Callable[..., str], /, *args: str, **kwargs: str) -> Future[str]:  # type: ignore[override]
        index, future = TaskOrder.model_validate_json(args[0]).task.index, Future[str]()
        self.asked.append(index)
        error = self.answer(index, self.asked.count(index))
        if error is None:
            future.set_result(fn(*args))
        else:
            future.set_exception(error)
        return future


def scripted(answer: Callable[[int, int], BaseException | None], state: HandedOut | None = None) -> list[TaskResult]:
    """What comes in; of a state that is given, the first result alone, and then whoever takes them breaks off."""
    here = environment_here((), ())

    def order(task: CampaignTask) -> str:
        return TaskOrder(task=task, environment=here, engines=()).model_dump_json()

    scheduling = Scheduling(Scripted(answer), order, partial(play_stub, QUIET), lambda: 4, pause=0.0)
    tasks = (draw(SPEC, index) for index in range(6))

    def died(task: CampaignTask, why: str, log: str) -> TaskResult:
        return crashed(task, why, log, here.digest)

    results = results_of(tasks, scheduling, died, state or HandedOut())
    return list(results) if state is None else [next(results)]


def test_what_was_played_and_not_taken_before_an_interruption_is_not_lost() -> None:
    state = HandedOut()
    (first,) = scripted(lambda index, _: WorkerDied("gone") if index == 2 else None, state)
    left = {one.game.index for one in state.finished()}
    assert left == {0, 1, 2, 3} - {first.game.index, 2}


def test_a_disk_that_stays_full_ends_the_campaign_with_a_sentence() -> None:
    assert len(scripted(lambda index, times: MachineTrouble("no space") if index == 2 and times < 3 else None)) == 6
    with pytest.raises(
        CampaignStopped, match=r"no game can be played: no space: mend that, and the same command goes on"
    ):
        scripted(lambda index, times: MachineTrouble("no space") if index == 2 else None)


def test_a_worker_that_is_not_as_the_others_ends_it_and_says_what_differs() -> None:
    with pytest.raises(CampaignStopped, match=r"not as the others are: packages.numpy is 1 instead of 2"):
        scripted(lambda index, _: EnvironmentDiffers("packages.numpy is 1 instead of 2") if index == 3 else None)


def test_a_worker_that_somebody_ends_has_its_task_done_again() -> None:
    found = {
        one.game.index: one.game
        for one in scripted(lambda index, n: BrokenOff("told") if index == 3 == n + 2 else None)
    }
    assert found[3].attempts == 2
    assert len(found) == 6


def test_a_scheduler_that_lets_go_of_its_tasks_is_gone() -> None:
    with pytest.raises(CampaignStopped, match=r"the scheduler is gone"):
        scripted(lambda index, _: CancelledError() if index == 3 else None)


def test_where_one_death_takes_others_along_only_who_dies_alone_has_crashed() -> None:
    def pool(index: int, times: int) -> BaseException | None:
        return WorkerDied("gone") if index == 1 or (index in (2, 3) and times < 3) else None

    found = {one.game.index: one.game for one in scripted(pool)}
    assert {index for index, game in found.items() if game.outcome is TaskOutcome.CRASHED} == {1}
    assert (found[1].attempts, found[2].attempts, found[0].attempts) == (3, 3, 1)


def test_no_room_for_the_ledger_is_said_and_nothing_half_is_left(
    tmp_path: Path, undisturbed: dict[int, TaskResult], monkeypatch: pytest.MonkeyPatch
) -> None:
    real, full = os.write, threading.Event()

    def write(descriptor: int, data: bytes) -> int:
        if b'"index":7' in bytes(data) and not full.is_set():
            full.set()
            real(descriptor, bytes(data)[:20])
            raise OSError(28, "No space left on device")
        return real(descriptor, data)

    monkeypatch.setattr(os, "write", write)
    with pytest.raises(RecordError, match="no space left on the device"):
        run(tmp_path / "campaign")
    assert run(tmp_path / "campaign").holds
    assert rows(tmp_path / "campaign") == undisturbed


def test_workers_end_when_whoever_started_them_is_killed(tmp_path: Path) -> None:
    code = (
        "import sys, time\nfrom app.campaign.workers.local_processes import LocalWorkers\n"
        "if __name__ == '__main__':\n"
        " w = LocalWorkers(1); w.submit(abs, 1).result(); w.submit(time.sleep, 600)\n"
        " print(*w.pids, flush=True); time.sleep(600)\n"
    )
    script = tmp_path / "starter.py"
    script.write_text(code, encoding="utf-8")
    root = str(Path(__file__).parents[3])
    with subprocess.Popen(
        [sys.executable, script], stdout=subprocess.PIPE, env={**os.environ, "PYTHONPATH": root}
    ) as starter:
        assert starter.stdout is not None
        pid = int(starter.stdout.readline())
        starter.kill()
    until(lambda: not runs(pid), "the worker's end")


def runs(pid: int) -> bool:
    """Whether a process runs; it may end, and be gone, while it is looked at."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def test_a_worker_breaks_off_when_told_to_and_hears_no_ctrl_c() -> None:
    workers = LocalWorkers(1)
    assert workers.submit(abs, -2).result() == 2
    (pid,) = workers.pids
    os.kill(pid, signal.SIGINT)
    assert workers.submit(os.getpid).result() == pid
    slow = workers.submit(time.sleep, 60)
    while not slow.running():
        time.sleep(0.01)
    workers.stop()
    assert slow.done()
    assert not Path(f"/proc/{pid}").exists()


def test_a_worker_makes_room_for_another_one_after_some_tasks() -> None:
    workers = LocalWorkers(1, most_tasks=2)
    pids = [workers.submit(os.getpid).result() for _ in range(5)]
    workers.shutdown()
    assert pids[0] == pids[1] != pids[2] == pids[3] != pids[4]
    with pytest.raises(RuntimeError, match="nothing more can be submitted"):
        workers.submit(os.getpid)


def failing_starts(monkeypatch: pytest.MonkeyPatch, starts: set[int]) -> None:
    """Processes of workers that cannot be started: which of them, from 1."""
    real, begun = SpawnProcess.start, list[SpawnProcess]()

    def start(process: SpawnProcess) -> None:
        begun.append(process)
        if len(begun) in starts:
            raise OSError(errno.EMFILE, "Too many open files")
        real(process)

    monkeypatch.setattr(SpawnProcess, "start", start)


def test_a_worker_that_cannot_be_started_is_the_machines_trouble(monkeypatch: pytest.MonkeyPatch) -> None:
    failing_starts(monkeypatch, {1, 3})
    workers = LocalWorkers(1, most_tasks=1)
    with pytest.raises(MachineTrouble, match=r"a worker cannot be started \(Too many open files\)"):
        workers.submit(abs, -1).result(PATIENCE)
    assert workers.submit(abs, -2).result(PATIENCE) == 2
    with pytest.raises(MachineTrouble):
        workers.submit(abs, -3).result(PATIENCE)
    workers.stop()


def test_tasks_of_workers_that_could_not_be_started_are_played_later(
    tmp_path: Path, undisturbed: dict[int, TaskResult], monkeypatch: pytest.MonkeyPatch
) -> None:
    failing_starts(monkeypatch, {2, 3})
    assert run(tmp_path / "campaign", most_tasks=5).holds
    assert rows(tmp_path / "campaign") == undisturbed


def test_where_no_worker_can_begin_the_campaign_ends_with_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    failing_starts(monkeypatch, {1})
    with pytest.raises(CampaignStopped, match=r"no game can be played: a worker cannot be started \(Too many open fil"):
        run(tmp_path / "campaign")
    dead = Future[CampaignEnvironment]()
    dead.set_exception(WorkerDied("the worker of process 3 ended with status 1"))
    with pytest.raises(CampaignStopped, match="no worker can begin: the worker of process 3 ended with status 1: find"):
        _answered(dead)
    dead = Future[CampaignEnvironment]()
    dead.set_exception(ArithmeticError("several workers died of it"))
    with pytest.raises(CampaignStopped, match="no worker can begin: several workers died of it"):
        _answered(dead, (ArithmeticError,))


def test_while_no_worker_answers_it_is_said_again_and_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.campaign.running.TELL_EVERY", 0.0)
    asked, told = Future[CampaignEnvironment](), list[int]()

    def tell() -> None:
        told.append(len(told))
        if len(told) == 3:
            asked.cancel()
            asked.set_running_or_notify_cancel()  # as Dask's executor does

    with pytest.raises(CampaignStopped, match="the scheduler is gone"):
        _answered(asked, tell=tell)
    assert told == [0, 1, 2]
