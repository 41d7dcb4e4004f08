"""Processes of a simulation that are started before it is known what they run on."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from app.rig.simulation.ahead import RigAhead
from app.settings.defaults import Settings


def children() -> set[int]:
    found = set[int]()
    for task in Path(f"/proc/{os.getpid()}/task").iterdir():
        with suppress(FileNotFoundError, ProcessLookupError):  # a thread of an earlier test that has just ended
            found.update(map(int, (task / "children").read_text().split()))
    return found


@pytest.mark.parametrize(
    ("changes", "processes"),
    [
        ({"rig.pace": "fast"}, 1),
        ({"rig.pace": "real"}, 2),
        ({"rig.pace": "fast", "rig.processes": "separate"}, 0),
        ({"rig.drives": "ethercat"}, 0),
        ({"rig.name": "board"}, 0),
    ],
)
def test_what_nobody_takes_is_ended_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changes: dict[str, Any], processes: int
) -> None:
    monkeypatch.chdir(tmp_path)
    before = children()
    ahead = RigAhead(Settings().with_changes(changes))
    started = children() - before
    assert len(started) == processes
    assert ahead.take("world", tmp_path / "another", tmp_path / "log") is None, "they are for their game alone"
    ahead.cancel()
    assert not children() & started
    assert not list((tmp_path / "games").glob("*"))
    ahead.cancel()


def test_a_folder_that_was_asked_for_stays(tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    folder.mkdir()
    ahead = RigAhead(Settings().with_changes({"rig.pace": "fast", "out": folder}))
    ahead.cancel()
    assert ahead.folder == folder
    assert folder.is_dir()
