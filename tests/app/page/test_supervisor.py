"""Who looks after the page's process: at the end nobody is left, whenever that comes; a page that cannot be is said."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from app.page.publisher import PagePublisher
from app.page.starting import StartedPage
from app.page.supervisor import PageSupervisor
from app.players.person import PersonGone
from app.settings.defaults import PageSection
from app.terminal.typed_lines import TypedLines
from tests.waiting import PATIENCE, until


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[subprocess.Popen[bytes]]:
    """Pages that do what stands in the place of their host, and end."""
    made: list[subprocess.Popen[bytes]] = []

    class Started:
        def __init__(self) -> None:
            self.end, self.theirs = socket.socketpair()

        def serve(self, settings: str, records: Path) -> None:
            command = [sys.executable, "-P", "-c", json.loads(settings)["host"]]
            with self.theirs:
                self.process = subprocess.Popen(command, stdout=subprocess.PIPE)
            made.append(self.process)

    monkeypatch.setattr("app.page.supervisor.StartedPage", Started)
    return made


def supervisor(what: str, publisher: PagePublisher, said: list[str]) -> PageSupervisor:
    settings = PageSection().model_copy(update={"host": what})
    return PageSupervisor(settings, publisher, Path("games"), said.append, said.append)


def test_a_game_that_ends_just_after_its_page_starts_no_other_one(
    started: list[subprocess.Popen[bytes]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.page.supervisor.PAUSE", 600.0)
    with supervisor("print('http://127.0.0.1:4711/')", PagePublisher("play"), []) as looking:
        until(lambda: looking._process.poll() is not None)
    assert not looking._thread.is_alive()
    assert len(started) == 1


def test_a_page_that_was_started_ahead_and_is_not_wanted_ends_without_a_word() -> None:
    started = StartedPage()
    started.cancel()
    assert started.process.poll() is not None
    started.cancel()
    orphan = StartedPage()
    assert orphan.process.stdin is not None
    orphan.process.stdin.close()  # as where who started it is killed
    assert orphan.process.wait(PATIENCE) == 0
    assert orphan.process.stdout is not None
    assert orphan.process.stdout.read() == b""
    orphan.cancel()


def test_where_no_page_can_be_nobody_is_waited_for_who_might_come_by_it(
    started: list[subprocess.Popen[bytes]],
) -> None:
    publisher, said = PagePublisher("play"), list[str]()
    lines = TypedLines(None, company=lambda: not publisher.given_up)
    assert lines.next(0.0) is None
    with supervisor("raise SystemExit(2)", publisher, said):
        until(lambda: publisher.given_up and bool(said))
        assert said == ["the page's process ended, see its messages above; the game continues without it"]
        with pytest.raises(PersonGone):
            lines.next(0.0)
    assert len(started) == 1


def test_nobody_waits_for_a_page_that_still_loads(
    started: list[subprocess.Popen[bytes]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.page.supervisor.PATIENCE", 600.0)
    with supervisor("import time; time.sleep(600)", PagePublisher("play"), []):
        pass
    assert started[0].poll() == -signal.SIGKILL
