"""Who looks after the page's process: at the end nobody is left, whenever that comes; a page that cannot be is said."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from app.page.publisher import PagePublisher
from app.page.supervisor import PageSupervisor
from app.players.person import PersonGone
from app.settings.tree import PageSection
from app.terminal.typed_lines import TypedLines
from tests.waiting import until


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[subprocess.Popen[bytes]]:
    """Pages that do what stands in the place of their host, and end."""
    made: list[subprocess.Popen[bytes]] = []

    def start(self: PageSupervisor) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-P", "-c", self._settings.host]
        made.append(subprocess.Popen(command, stdout=subprocess.PIPE))
        return made[-1]

    monkeypatch.setattr(PageSupervisor, "_start", start)
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


def test_where_no_page_can_be_nobody_is_waited_for_who_might_come_by_it(
    started: list[subprocess.Popen[bytes]],
) -> None:
    publisher, said = PagePublisher("play"), list[str]()
    lines = TypedLines(None, company=lambda: not publisher.given_up)
    assert lines.next(0.0) is None
    with supervisor("raise SystemExit(2)", publisher, said):
        until(lambda: publisher.given_up and bool(said))
        assert said == ["the page's process ended, see what it says above; the game goes on without it"]
        with pytest.raises(PersonGone):
            lines.next(0.0)
    assert len(started) == 1
