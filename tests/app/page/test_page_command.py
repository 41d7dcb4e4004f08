"""``touchmove page``: shows records, makes a password, and ends with Ctrl-C."""

from __future__ import annotations

import getpass
import json
import os
import re
import signal
import subprocess
import sys
import urllib.request
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.cli.commands import app
from app.page.web.sign_in import PasswordHash
from app.play.launch import run_games
from app.settings.files import kept_settings, settings_of
from app.terminal.game_display import UserInterface
from tests.app.page.recorded.recorded_games import RecordedGame

PASSWORD = "correct horse battery"


@contextmanager
def command(*arguments: str, folder: Path) -> Iterator[str]:
    """Address of a page that the command shows; it ends well by Ctrl-C."""
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "app.cli", "page", "--port", "0", *arguments], cwd=folder, text=True,
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
        env={name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")},
    )  # fmt: skip
    try:
        assert process.stderr is not None
        said = process.stderr.readline()
        found = re.fullmatch(r"touchmove: the page is at (http://127\.0\.0\.1:\d+/); Ctrl-C ends it\n", said)
        assert found, said
        yield found[1]
        process.send_signal(signal.SIGINT)
        out, error = process.communicate(timeout=60.0)
        assert (process.returncode, out, error) == (0, "", "")
    finally:
        process.kill()
        process.wait()


def answer(address: str) -> object:
    with urllib.request.urlopen(address, timeout=60.0) as response:
        return json.load(response)


def run(*arguments: str, typed: str = "") -> tuple[int, str]:
    """Status and what is said."""
    result = CliRunner().invoke(app, ["page", *arguments], input=typed)
    return result.exit_code, result.output


def test_a_folder_of_games_is_shown_or_one_game_of_it(tmp_path: Path) -> None:
    for name in ("one", "two"):
        RecordedGame(tmp_path / "games" / name).record.close()
    with command(folder=tmp_path) as address:
        listed = answer(address + "games")
        assert isinstance(listed, list)
        assert sorted(one["id"] for one in listed) == ["one", "two"]
    with command("games/two", folder=tmp_path) as address:
        listed = answer(address + "games")
        assert isinstance(listed, list)
        assert [one["id"] for one in listed] == ["two"]


def test_a_folder_without_games_is_said_so(tmp_path: Path) -> None:
    for folder in (tmp_path, tmp_path / "missing"):
        status, said = run(str(folder))
        assert status == 2
        assert said == f"touchmove: there is no recorded game in {folder}: name the folder of one, or of many\n"


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--host", "0.0.0.0"], "needs a password"),
        (["--host", "house"], "IPv4"),
        (["--password", "missing"], "password file missing cannot be read"),
        (["--port", "99999"], "--port"),
    ],
)
def test_what_cannot_be_opened_is_one_sentence(tmp_path: Path, arguments: list[str], sentence: str) -> None:
    RecordedGame(tmp_path).record.close()
    status, said = run(str(tmp_path), *arguments)
    assert status == 2
    assert sentence in said
    assert said.count("\n") == 1


def test_a_password_is_asked_for_twice_and_kept_hashed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    answers = iter([PASSWORD, PASSWORD])
    monkeypatch.setattr(getpass, "getpass", lambda _: next(answers))
    status, said = run("--set-password", str(tmp_path / "password"))
    assert status == 0
    assert "holds the hashed password" in said
    assert PasswordHash.load(tmp_path / "password").matches(PASSWORD)


@pytest.mark.parametrize(
    ("answers", "sentence"),
    [([PASSWORD, PASSWORD + "!"], "the two passwords differ"), (["short", "short"], "has 5 characters")],
)
def test_a_password_that_is_no_good_is_not_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answers: list[str], sentence: str
) -> None:
    said_then = iter(answers)
    monkeypatch.setattr(getpass, "getpass", lambda _: next(said_then))
    status, said = run("--set-password", str(tmp_path / "password"))
    assert status == 2
    assert sentence in said
    assert not (tmp_path / "password").exists()


@pytest.mark.parametrize("seen", [True, False])
def test_where_nobody_can_type_a_password_none_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seen: bool
) -> None:
    def nobody(_: str) -> str:
        if seen:
            warnings.warn("it can be seen", getpass.GetPassWarning, stacklevel=2)
        raise EOFError

    monkeypatch.setattr(getpass, "getpass", nobody)
    done = CliRunner().invoke(app, ["page", "--set-password", str(tmp_path / "password")])
    assert done.exit_code == 2
    (line,) = done.stderr.splitlines()
    assert "run this at a terminal" in line
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize("command", [["demo", "--rig", "board"], ["resume", "match"]])
def test_a_page_that_nobody_is_to_see_is_refused(command: list[str], tmp_path: Path) -> None:
    out = [] if command[0] == "resume" else ["--out", str(tmp_path / "game")]
    done = CliRunner().invoke(app, [*command, "--headless", "--page", *out])
    assert done.exit_code == 2
    assert "--page would have no effect: leave one of them out" in done.stderr
    assert not [*tmp_path.iterdir()]


def test_a_game_finds_its_pages_password_from_any_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    changes = {"rig.name": "board", "rig.video": False, "game.moves": "e4", "page.password": Path("password")}
    run_games(settings_of(changes), UserInterface())
    (match,) = (tmp_path / "games").iterdir()
    assert kept_settings(match).page.password == tmp_path / "password"
