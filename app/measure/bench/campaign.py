"""Bench ``campaign``: what it costs to schedule tasks, what more workers give, and whether deaths change the results.

No game is played: stubs of known duration give rows as long as those of a game of forty plies.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future, wait
from functools import partial
from pathlib import Path
from typing import Final

from app.campaign.ledger import WHOLE, results_in
from app.campaign.running import CampaignWish, run_campaign
from app.campaign.schema import GameRow
from app.campaign.spec import CampaignSpec
from app.campaign.workers.local_processes import LocalWorkers
from app.campaign.workers.stub import PLIES, StubPlan, play_stub
from app.measure.bench.report import BenchReport, Progress, row

TASKS: Final = {True: 1000, False: 10000}
"""By ``quick``."""
SECONDS: Final = {True: 0.05, False: 1.0}  # of a stub; a game takes twenty times as long
FOR_EACH: Final = {True: 20, False: 30}  # stubs for each worker; one of its processes ends and another begins meanwhile
WORKERS: Final = (1, 2, 4)
GAMES: Final = 100  # of the campaign in which workers die
KILLS: Final = 10
FULL: Final = (57,)
"""Seeds that find the disk full, once."""
SPEC: Final = CampaignSpec(draw={"start.line": True, "game.plies": PLIES})


class Unwatched:
    """A ``CampaignShown`` that shows nothing."""

    def begun(self, wanted: int, before: tuple[GameRow, ...], dashboard: str | None) -> None:
        """See ``CampaignShown.begun``."""

    def waiting(self, reason: str) -> None:
        """See ``CampaignShown.waiting``."""

    def finished(self, game: GameRow) -> None:
        """See ``CampaignShown.finished``."""

    def idle(self) -> None:
        """See ``CampaignShown.idle``."""


def campaign_bench(quick: bool, progress: Progress) -> BenchReport:
    """Measure with stubs; ``quick`` with fewer and shorter ones."""
    tasks = TASKS[quick]
    with tempfile.TemporaryDirectory(prefix="touchmove-") as name:
        folder = Path(name)
        cost = 1e3 * _campaign(folder / "many", tasks, StubPlan()) / tasks
        progress(f"{tasks} stubs: {cost:.2f} ms each")
        efficiency = {number: _efficiency(number, quick) for number in WORKERS}
        progress("; ".join(f"{number} workers: {share:.3f}" for number, share in efficiency.items()))
        different, doubled = _disturbed(folder)
        progress(f"{KILLS} workers killed and the disk full once: {different} rows different, {doubled} doubled")
    rows = {
        "schedule": row([cost], "ms", 5.0, "max", n=tasks),
        **{f"workers {number}": row([share], "1", 0.95, "least") for number, share in efficiency.items()},
        "disturbed different": row([different], "rows", 0.0, "max", n=GAMES),
        "disturbed doubled": row([doubled], "rows", 0.0, "max", n=GAMES),
    }
    return BenchReport.of("campaign", SPEC.first_seed, rows)


def _campaign(folder: Path, games: int, plan: StubPlan) -> float:
    """Run a campaign of stubs on two workers; how long it played, but for starts and tables [s, wall]."""
    wish = CampaignWish(games, folder, workers=2, play=partial(play_stub, plan), most_tasks=games, pause=0.0)
    shown = _Clocked()
    run_campaign(SPEC, wish, shown)
    return shown.last - shown.first


class _Clocked(Unwatched):
    first = last = 0.0

    def finished(self, game: GameRow) -> None:
        """See ``CampaignShown.finished``."""
        self.last = time.monotonic()
        self.first = self.first or self.last


def _efficiency(workers: int, quick: bool) -> float:
    """Share of the time for which workers that are there do something."""
    local, seconds, number = LocalWorkers(workers), SECONDS[quick], workers * FOR_EACH[quick]
    try:
        wait([local.submit(time.sleep, 0.5) for _ in range(workers)])  # each has its process then
        since = time.monotonic()
        _windowed(lambda: local.submit(time.sleep, seconds), number, 2 * workers)
        return number * seconds / (workers * (time.monotonic() - since))
    finally:
        local.shutdown()


def _windowed(submit: Callable[[], Future[None]], number: int, window: int) -> None:
    running = {submit() for _ in range(min(number, window))}
    left = number - len(running)
    while running:
        done, running = wait(running, return_when="FIRST_COMPLETED")
        running |= {submit() for _ in range(min(left, len(done)))}
        left -= min(left, len(done))


def _disturbed(folder: Path) -> tuple[int, int]:
    """How many rows differ from those of a campaign that nothing disturbed, and how many are there twice."""
    marks = folder / "marks"
    marks.mkdir()
    deaths = dict.fromkeys(range(5, 5 + 9 * KILLS, 9), 1)
    _campaign(folder / "quiet", GAMES, StubPlan())
    _campaign(folder / "disturbed", GAMES, StubPlan(marks=marks, deaths=deaths, full=FULL))
    quiet, disturbed = (_rows(folder / name) for name in ("quiet", "disturbed"))
    seeds = [seed for seed, _ in disturbed]
    different = len({*map(str, quiet)} ^ {*map(str, disturbed)})
    return different, len(seeds) - len({*seeds})


def _rows(folder: Path) -> list[tuple[int, Mapping[str, object]]]:
    found = list(results_in(folder / WHOLE.ledger))
    return sorted(
        (one.game.seed, one.model_copy(update={"game": one.game.model_copy(update={"attempts": 1})}).model_dump())
        for one in found
    )
