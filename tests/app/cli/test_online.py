"""``touchmove online``: what cannot be had is one sentence and status 2, before anything is started."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.cli.commands import app
from tests.app.online.fake_lichess import FakeLichess
from tests.app.online.online_games import written_token

QUICK = ("--rig", "board", "--no-page")


def said(*words: str, status: int = 2, typed: str = "") -> str:
    done = CliRunner().invoke(app, ["online", *words], input=typed)
    assert done.exit_code == status, done.output
    return " ".join(done.stderr.split())


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ((), "choose who plays: --person for you at the board, or --bot for the engine"),
        (("--person", "--bot"), "choose who plays"),
        (("--person", "--color", "red"), "--color is 'red', choose white or black"),
        (("--person", "--elo", "1500"), "--elo is for --bot: in a person's game no engine runs"),
        (("--person", "--engine", "x"), "--engine is for --bot"),
        (("--person", "--upgrade"), "--upgrade is for --bot"),
        (("--person", "--pace", "fast"), "people play by the wall clock"),
        (("--person", "--days", "4"), "--days is '4'"),
        (("--person", "--opponent", "a b"), "--opponent is 'a b'"),
        (("--person", "--take-backs"), "--take-backs has no effect here, it is for an engine that plays (--bot)"),
        (("--person", "--opponent", "anna", "--accept"), "--opponent has no effect here"),
        (("--person", *QUICK, "--clock", "3+2"), "3+2, casual is blitz"),
        (("--bot", "--no-page", "--clock", "3+0"), "40 moves, of which the table needs 2:40: 4.0 s a move"),
        (("--person", *QUICK, "--server", "lichess.org"), "--server is 'lichess.org'"),
        (("--person", *QUICK, "--token-file", "missing"), "cannot be read (No such file or directory)"),
    ],
)
def test_what_cannot_be_had_is_one_sentence(words: tuple[str, ...], sentence: str) -> None:
    assert sentence in said(*words)


def test_without_the_extra_it_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules["app.cli.online"], "find_spec", lambda _: None)
    assert "pip install 'touchmove[online]'" in said("--person", *QUICK)


def test_a_person_is_asked_twice_before_an_account_becomes_a_bots(tmp_path: Path) -> None:
    with FakeLichess() as lichess, written_token(tmp_path) as token:
        words = ("--bot", *QUICK, "--server", lichess.address, "--token-file", str(token))
        assert "Robot is a person's account" in said(*words, "--out", str(tmp_path / "no"))
        assert "was not upgraded" in said(*words, "--upgrade", typed="upgrade\nno\n")
        assert lichess.upgraded == 0


def test_a_game_of_a_person_is_played_by_typing(tmp_path: Path) -> None:
    with FakeLichess() as lichess, written_token(tmp_path) as token:
        lichess.next_color = True
        told = said(
            "--person", *QUICK, "--server", lichess.address, "--token-file", str(token), "--out",
            str(tmp_path / "game"), status=0, typed="e4\nhint\nresign\n",
        )  # fmt: skip
    assert "Robot plays Anna" in told
    assert "there are no hints" in told
    assert "White resigns, result 0-1" in told
