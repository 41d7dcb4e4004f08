"""What people see of a running campaign, on the terminal: how far, how fast, what failed so far, how long it takes."""

from __future__ import annotations

import time
from typing import Final, Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from app.campaign.schema import GameRow

PLAIN_EVERY: Final = 60.0
"""Where the output is no terminal, a line so often [s, wall]."""


class CampaignProgress:
    """``CampaignShown`` on a terminal; plain lines where there is none. A context manager."""

    def __init__(self, console: Console) -> None:
        self._console, self._terminal = console, console.is_terminal
        columns = (TextColumn("campaign"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.description}"))
        self._progress = Progress(*columns, console=console)
        self._task = self._progress.add_task("starting", total=None)
        self._since, self._told = time.monotonic(), 0.0
        self._wanted = self._before = self._done = self._failed = 0

    def __enter__(self) -> Self:
        if self._terminal:
            self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def begun(self, wanted: int, before: tuple[GameRow, ...], dashboard: str | None) -> None:
        """See ``CampaignShown.begun``."""
        self._since, self._wanted, self._before = time.monotonic(), wanted, len(before)
        self._failed = sum(game.failed for game in before)
        if before:
            self._console.print(f"going on: {len(before)} of {wanted} games are played already", highlight=False)
        if dashboard is not None:
            self._console.print(f"Dask's dashboard: {dashboard}", highlight=False, soft_wrap=True)
        self._show()

    def waiting(self, reason: str) -> None:
        """See ``CampaignShown.waiting``."""
        self._console.print(reason, highlight=False, markup=False, soft_wrap=True)

    def finished(self, game: GameRow) -> None:
        """See ``CampaignShown.finished``."""
        self._done += 1
        if game.failed:
            self._failed += 1
            self._console.print(
                f"seed {game.seed} {game.outcome}: {game.reason[:300]}", highlight=False, markup=False, soft_wrap=True
            )
        self._show()

    def idle(self) -> None:
        """See ``CampaignShown.idle``."""
        if self._terminal:
            self._show()

    def _show(self) -> None:
        done, text = self._before + self._done, self._sentence()
        if self._terminal:
            self._progress.update(self._task, completed=done, total=self._wanted, description=text)
        elif (now := time.monotonic()) >= self._told + PLAIN_EVERY or done == self._wanted:
            self._told = now
            self._console.print(f"{done} of {self._wanted} games, {text}", highlight=False, soft_wrap=True)

    def _sentence(self) -> str:
        passed = time.monotonic() - self._since
        failures = f"{self._failed} failed"
        if not self._done:
            return failures
        rate = self._done / passed
        left = (self._wanted - self._before - self._done) / rate
        return f"{3600.0 * rate:.0f} games an hour, {failures}, {_duration(left)} left"


def _duration(seconds: float) -> str:
    minutes = round(seconds / 60.0)
    if minutes >= 60:
        return f"{minutes // 60} h {minutes % 60:02d} min"
    return f"{minutes} min" if minutes >= 5 else f"{seconds:.0f} s"
