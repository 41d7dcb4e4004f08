"""Helpers for tests that run the whole program in processes of its own."""

from __future__ import annotations

import contextlib
import functools
import gc
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import hypothesis
import pytest
import typer.main

from hardware.sim.clients.wire import world_pid
from tests.controllers import Controller
from tests.standstills import pytest_runtest_protocol, pytest_terminal_summary  # noqa: F401 (pytest calls them here)
from tests.waiting import PATIENCE

# "ci" draws the same examples on every machine and in every run, so that a failure is one of the change in hand;
# "nightly" draws fresh ones from the seed that `make nightly` prints. Neither measures how long an example takes.
hypothesis.settings.register_profile(
    "ci", derandomize=True, database=None, deadline=None, max_examples=100,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)  # fmt: skip
hypothesis.settings.register_profile(
    "nightly", hypothesis.settings.get_profile("ci"), derandomize=False, max_examples=300, print_blob=True
)
hypothesis.settings.load_profile("ci")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Whole programs come first: they wait more than they work, and one that began last would run alone in the end."""
    items.sort(key=lambda item: item.path.parent != Path(__file__).parent)


def pytest_collection_finish() -> None:
    """Thousands of tests are not looked at by each collection of garbage, of which a controller makes one as it starts:
    in a process as large as this it takes a second."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def _commands_made_once() -> Iterator[None]:
    """Typer's runner makes all commands anew from the signatures of their functions for each call, which takes longer
    than most of what is called."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("typer.testing._get_command", functools.cache(typer.main.get_command))
        yield


class Run:
    """One started ``touchmove`` command in a process group of its own."""

    def __init__(self, arguments: list[str], folder: Path, environment: dict[str, str] | None = None) -> None:
        self.folder = folder
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", "app.cli", *arguments],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            env={**os.environ, **(environment or {})}, start_new_session=True,
        )  # fmt: skip

    def wait(self, timeout: float = 240.0) -> tuple[int, str, str]:
        """Exit status, as a shell tells it, and what was said.

        Where Ctrl-C meets code that Python makes of text, as that of a dataclass, CPython ends a program by the signal
        itself, whatever became of the exception; to a shell that is 130, too.
        """
        out, err = self.process.communicate(timeout=timeout)
        status = self.process.returncode
        return 128 - status if status == -signal.SIGINT else status, out, err

    def signal(self, number: int) -> None:
        self.process.send_signal(number)

    def helpers(self) -> dict[str, int]:
        """Pids of the processes that belong to this run: by run directory, or children of the app."""
        found = {}
        for entry in Path("/proc").iterdir():
            if not entry.name.isdigit():
                continue
            try:
                command = (entry / "cmdline").read_bytes().split(b"\0")
                status = (entry / "stat").read_text()
            except (FileNotFoundError, ProcessLookupError):
                continue
            state, parent = status.rsplit(")", 1)[1].split()[:2]
            if state == "Z":
                continue
            mine = any(str(self.folder).encode() in part for part in command)
            if int(entry.name) != self.process.pid and (mine or int(parent) == self.process.pid):
                name = next((w for w in ("world", "controller", "drawing", "stockfish")
                             if any(w.encode() in part for part in command[:5])), "other")  # fmt: skip
                found[name] = int(entry.name)
        return found

    def plies(self) -> int:
        events = self.folder / "events.jsonl"
        return events.read_text().count('"event":"ply"') if events.exists() else 0

    def until(self, condition: Callable[[], Any], what: str, timeout: float = PATIENCE) -> Any:
        deadline = time.monotonic() + timeout
        while True:
            if value := condition():
                return value
            if self.process.poll() is not None:
                pytest.fail(f"the program ended before {what}: {self.process.communicate()}")
            if time.monotonic() > deadline:
                pytest.fail(f"no {what} within {timeout} s")
            time.sleep(0.02)

    def world_end(self, timeout: float = PATIENCE) -> dict[str, Any]:
        """The world's snapshot, once it is there."""
        path = self.folder / "run" / "world_end.json"
        deadline = time.monotonic() + timeout
        while not path.exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        return dict(json.loads(path.read_text()))


@pytest.fixture
def demo(tmp_path: Path) -> Iterator[Callable[..., Run]]:
    """Start ``touchmove demo`` into a folder of the test's own; whatever is left of it is killed afterwards."""
    runs: list[Run] = []

    def start(*arguments: str, name: str = "game", environment: dict[str, str] | None = None) -> Run:
        folder = tmp_path / name
        run = Run(["demo", "--out", str(folder), "--headless", "--json", *arguments], folder, environment)
        runs.append(run)
        return run

    yield start
    for run in runs:
        for pid in [*run.helpers().values(), *([run.process.pid] if run.process.poll() is None else [])]:
            with contextlib.suppress(ProcessLookupError):  # it was about to end by itself
                os.kill(pid, signal.SIGKILL)
        run.process.wait()
        for pipe in (run.process.stdout, run.process.stderr):
            if pipe is not None:
                pipe.close()


@pytest.fixture
def by_hand(tmp_path: Path) -> Iterator[Callable[..., Controller]]:
    started: list[Controller] = []

    def start(rig: Path, within: tuple[str, ...] = ()) -> Controller:
        started.append(Controller(rig, within))
        return started[-1]

    yield start
    for one in started:
        one.end(signal.SIGKILL)
    for left in tmp_path.rglob("world.sock"):  # of a world that nobody has ended
        if (pid := world_pid(left.parent)) is not None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
