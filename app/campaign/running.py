"""Runs a campaign, or goes on with one: draws tasks, hands them out, and keeps what comes in."""

from __future__ import annotations

import os
import time
import uuid
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Future, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Protocol

from pydantic import NonNegativeInt

from app import UserError
from app.campaign.drawing import draw
from app.campaign.environment import CampaignEnvironment, environment_here
from app.campaign.folder import KeptCampaign, keep_campaign
from app.campaign.ledger import WHOLE, Ledger, Shard, ledgers_in, results_in
from app.campaign.named_files import engines_of, files_of
from app.campaign.scheduling import CampaignStopped, HandedOut, Scheduling, gone, no_room, results_of, unlike
from app.campaign.schema import GAMES_FOLDER, GameRow, TaskOutcome, TaskResult
from app.campaign.spec import LAST_SEED, CampaignSpec
from app.campaign.tables import GrowingTables
from app.campaign.task import CampaignTask
from app.campaign.tasks.rows import crashed
from app.campaign.troubles import MachineTrouble
from app.campaign.workers.cluster import TELL_EVERY, open_cluster
from app.campaign.workers.local_processes import MOST_TASKS, LocalWorkers
from app.campaign.workers.order import Kept, TaskOrder
from app.campaign.workers.play_task import play_task
from app.records.files import recording
from hardware.frozen import Frozen

WINDOW: Final = 2
"""So many tasks for each core are handed out: one is played, one waits."""


@dataclass(frozen=True, slots=True)
class CampaignWish:
    """How a campaign is to be run.

    Attributes:
        games: so many tasks it has in all.
        folder: of the campaign.
        workers: processes on this machine; None: one for each core that this process may use.
        scheduler: address of Dask's instead; None: this machine.
        shard: only this part of the tasks.
        keep: folders of which games.
        play: what a worker does; another one for measurements.
        most_tasks: of a worker on this machine; see ``LocalWorkers``.
        pause: see ``Scheduling``.
    """

    games: int
    folder: Path
    workers: int | None = None
    scheduler: str | None = None
    shard: Shard = WHOLE
    keep: Kept = Kept.FAILED
    play: Callable[[str], str] = play_task
    most_tasks: int = MOST_TASKS
    pause: float = 10.0


class CampaignSummary(Frozen):
    """What a command says in the end."""

    folder: Path
    games: NonNegativeInt
    """That were to be played here: all, or a shard's."""
    done: NonNegativeInt
    outcomes: dict[TaskOutcome, NonNegativeInt]
    failed: tuple[GameRow, ...]
    wall_s: float
    played: NonNegativeInt
    """By this command."""

    @property
    def holds(self) -> bool:
        """Whether no game was wrong, lost or crashed, and all were played."""
        return not self.failed and self.done == self.games


class CampaignShown(Protocol):
    """Who watches a campaign."""

    def begun(self, wanted: int, before: tuple[GameRow, ...], dashboard: str | None) -> None:
        """It begins, or goes on: so many games there are to be, and these there were."""

    def waiting(self, reason: str) -> None:
        """Nothing can begin yet, and why."""

    def finished(self, game: GameRow) -> None:
        """A game is over."""

    def idle(self) -> None:
        """Time goes by."""


@dataclass(frozen=True, slots=True)
class _Workers:
    scheduling: Callable[[Callable[[CampaignTask], str], Callable[[], None]], Scheduling]
    environment: Callable[[tuple[str, ...], tuple[str, ...]], CampaignEnvironment]
    dashboard: str | None
    stop: Callable[[], None]


@dataclass(slots=True)
class _Tally:
    outcomes: Counter[TaskOutcome] = field(default_factory=Counter)
    failed: list[GameRow] = field(default_factory=list)

    def add(self, game: GameRow) -> None:
        self.outcomes[game.outcome] += 1
        if game.failed:
            self.failed.append(game)


def run_campaign(spec: CampaignSpec, wish: CampaignWish, shown: CampaignShown) -> CampaignSummary:
    """Play what has no result yet.

    Raises:
        UserError: the folder is another campaign's or cannot be written, there are no such workers, or it cannot go on;
            what was played is in the ledger, and the same call goes on.
        KeyboardInterrupt: it was interrupted; likewise.
    """
    if spec.first_seed + wish.games > LAST_SEED:
        raise CampaignStopped(
            f"{wish.games} games from first_seed = {spec.first_seed} on lead beyond {LAST_SEED}, up to which seeds can "
            "be told apart: choose a smaller first_seed, or fewer --games"
        )
    since, tally, played = time.monotonic(), _Tally(), 0
    with _workers(wish, shown) as workers:
        engines = engines_of(spec)
        environment = workers.environment(engines, files_of(spec))
        kept = keep_campaign(wish.folder, KeptCampaign(games=wish.games, spec=spec, environment=environment))
        with recording(wish.folder / GAMES_FOLDER):
            (wish.folder / GAMES_FOLDER).mkdir(exist_ok=True)
        indices = wish.shard.indices(wish.games)
        with Ledger(wish.folder / wish.shard.ledger) as ledger:
            elsewhere = _played_elsewhere(wish)
            played_once = {**elsewhere, **{game.index: game for game in ledger.before}}
            before = tuple(game for game in played_once.values() if game.index in indices)
            for game in before:
                tally.add(game)
            shown.begun(len(indices), before, workers.dashboard)

            run, folder = uuid.uuid4().hex, wish.folder.absolute()

            def order(task: CampaignTask) -> str:
                return TaskOrder(
                    task=task, environment=environment, engines=engines, run=run, keep=wish.keep, folder=folder
                ).model_dump_json()

            tasks = (_drawn(spec, index) for index in indices if index not in played_once)
            tables, handed_out = GrowingTables(wish.folder, kept.spec), HandedOut()
            try:
                for result in _results(tasks, workers, order, shown, environment, handed_out):
                    if ledger.add(result):
                        tally.add(result.game)
                        played += 1
                        shown.finished(result.game)
                    tables.write_if_due()
            except BaseException:
                try:
                    workers.stop()
                finally:  # also where who interrupts does not wait for that
                    with suppress(UserError):  # a disk that is full is told by what has ended it
                        for result in handed_out.finished():
                            ledger.add(result)
                        tables.write()
                raise
            tables.write()
    done = sum(tally.outcomes.values())
    return CampaignSummary(
        folder=wish.folder, games=len(indices), done=done, outcomes=dict(tally.outcomes), failed=tuple(tally.failed),
        wall_s=time.monotonic() - since, played=played,
    )  # fmt: skip


def _drawn(spec: CampaignSpec, index: int) -> CampaignTask:
    """See ``draw``.

    Raises:
        CampaignStopped: what is drawn does not go together.
    """
    try:
        return draw(spec, index)
    except ValueError as error:
        raise CampaignStopped(
            f"what is drawn for seed {spec.first_seed + index} cannot be played: {error}; mend the campaign's file, "
            "and begin it anew in another folder with --out"
        ) from error


def _results(
    tasks: Iterator[CampaignTask], workers: _Workers, order: Callable[[CampaignTask], str], shown: CampaignShown,
    environment: CampaignEnvironment, handed_out: HandedOut,
) -> Iterator[TaskResult]:  # fmt: skip
    def died(task: CampaignTask, reason: str, log: str) -> TaskResult:
        return crashed(task, reason, log, environment.digest)

    return results_of(tasks, workers.scheduling(order, shown.idle), died, handed_out)


def _played_elsewhere(wish: CampaignWish) -> dict[int, GameRow]:
    """What other parts of the campaign have played already, as it was cut into parts before, by index."""
    own = wish.folder / wish.shard.ledger
    others = (result for path in ledgers_in(wish.folder) if path != own for result in results_in(path))
    return {result.game.index: result.game for result in others}


@contextmanager
def _workers(wish: CampaignWish, shown: CampaignShown) -> Iterator[_Workers]:
    if wish.scheduler is not None:
        with open_cluster(wish.scheduler) as cluster:

            def ask(engines: tuple[str, ...], files: tuple[str, ...]) -> CampaignEnvironment:
                def tell() -> None:
                    shown.waiting(cluster.why_none())

                asked = cluster.executor.submit(environment_here, engines, files)
                if not cluster.cores():
                    tell()
                there = _answered(asked, cluster.deaths, tell)
                _require_this_program(there)
                return there

            yield _Workers(
                lambda order, idle: Scheduling(
                    cluster.executor, order, wish.play, lambda: WINDOW * cluster.cores(), cluster.deaths, wish.pause,
                    idle,
                ),
                ask, cluster.dashboard, lambda: None,
            )  # fmt: skip
        return
    number = wish.workers or len(os.sched_getaffinity(0))
    local = LocalWorkers(number, wish.most_tasks)
    try:
        yield _Workers(
            lambda order, idle: Scheduling(local, order, wish.play, lambda: WINDOW * number, (), wish.pause, idle),
            lambda engines, files: _answered(local.submit(environment_here, engines, files)), None, local.stop,
        )  # fmt: skip
    except BaseException:
        local.stop()
        raise
    else:
        local.shutdown()


def _require_this_program(there: CampaignEnvironment) -> None:
    """Make sure that workers elsewhere are of the program that draws here; engines, files and threads are theirs alone.

    Raises:
        CampaignStopped: they are not.
    """
    theirs = {name: getattr(there, name) for name in ("engine", "files", "threads")}
    if found := environment_here((), ()).model_copy(update=theirs).differences(there):
        raise unlike("; ".join(found))


def _answered(
    asked: Future[CampaignEnvironment], deaths: tuple[type[BaseException], ...] = (),
    tell: Callable[[], None] = lambda: None,
) -> CampaignEnvironment:  # fmt: skip
    """What the first worker says of itself.

    Args:
        asked: what it was asked.
        deaths: as of ``Scheduling``.
        tell: called now and then while it does not answer.

    Raises:
        UserError: it has not what it takes, it died, or there is no scheduler any more.
    """
    fatal: tuple[type[BaseException], ...] = (BrokenExecutor, *deaths)
    while wait([asked], TELL_EVERY).not_done:
        tell()
    try:
        return asked.result()
    except CancelledError as error:
        raise gone("it has let go of what it was asked") from error
    except MachineTrouble as error:
        raise no_room(str(error)) from error
    except fatal as error:
        raise CampaignStopped(
            f"no worker can begin: {error}: find out in its log what ended it, and the same command goes on"
        ) from error


def require_games(kept: KeptCampaign, folder: Path, seed: int) -> int:
    """The index of a seed in a campaign.

    Raises:
        CampaignStopped: it has no such.
    """
    first = kept.spec.first_seed
    if not first <= seed < first + kept.games:
        raise CampaignStopped(f"the campaign in {folder} has the seeds {first} to {first + kept.games - 1}, not {seed}")
    return seed - first
