"""The command: where the page is, what is said, and with which status it ends."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from app.campaign.schema import TaskOutcome, TaskResult
from app.cli.commands import app
from tests.app.campaign.report.test_campaign_page import Walk
from tests.app.campaign.report.test_reading import result, write


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, ["campaign", "report", *map(str, arguments)])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "new").mkdir()
    (tmp_path / "old").mkdir()
    write(
        tmp_path / "new" / "results.jsonl",
        [result(n, TaskOutcome.UNMENDED if n == 3 else TaskOutcome.RIGHT) for n in range(12)],
    )
    write(tmp_path / "old" / "results.jsonl", [result(n) for n in range(12)])
    return tmp_path


def test_it_writes_the_page_and_says_what_was_found(folder: Path) -> None:
    failed = run(folder / "new")
    assert failed.exit_code == 1
    assert failed.stdout.splitlines()[0] == str(folder / "new" / "report.html")
    assert "12 games, 24 plies: 1 failed." in failed.stdout
    assert "12 games" in Walk((folder / "new" / "report.html").read_text()).text
    assert run(folder / "old", "--out", folder / "page.html").exit_code == 0
    assert (folder / "page.html").is_file()
    assert run(folder / "old", "--out", folder / "page.html").exit_code == 0, "a page of the kind is replaced"
    assert not (folder / "old" / "report.html").exists()


def test_json_alone_is_on_stdout(folder: Path) -> None:
    told = run(folder / "new", "--json", "--compare", folder / "old")
    assert json.loads(told.stdout)["comparison"]["games"] == 12
    assert told.stderr.strip() == str(folder / "new" / "report.html")


def test_the_gate_decides_on_the_status(folder: Path) -> None:
    (folder / "bars.toml").write_text("[unmended]\nat_most = 0.4\n[crashed]\nat_most = 0.01\n")
    missed = run(folder / "new", "--gate", folder / "bars.toml")
    assert missed.exit_code == 1
    assert "Held: games that ended early: 1 of 12, so at most 33.9 %" in missed.stdout
    assert "MISSED: games that crashed: 0 of 12, so at most 22.1 %" in missed.stdout
    (folder / "bars.toml").write_text("[unmended]\nat_most = 0.4\n")
    assert run(folder / "new", "--gate", folder / "bars.toml").exit_code == 0


def campaign_file(folder: Path, draw: str = "") -> None:
    (folder / "campaign.toml").write_text(
        f"games = 12\n[spec]\n[spec.draw]\n{draw}\n[environment]\nsources = 'a'\npython = '3'\nengine = ''\n"
        "packages = {}\nfiles = {}\nthreads = {}\n"
    )


def test_an_older_campaign_may_have_drawn_what_there_is_no_more(folder: Path) -> None:
    """Releases are what a comparison is for; what is reported itself has to be read as a whole."""
    campaign_file(folder / "new")
    campaign_file(folder / "old", "rig.gone = 3")
    told = run(folder / "new", "--compare", folder / "old")
    assert told.exit_code == 1
    (said,) = [line for line in told.stdout.splitlines() if line.startswith("What was drawn in the older campaign is")]
    assert "is not known (campaign file " in said
    assert "there is nothing called rig.gone to draw" in said
    assert "12 pairs of games with the same seed" in told.stdout
    refused = run(folder / "old")
    assert refused.exit_code == 2
    assert "there is nothing called rig.gone to draw" in refused.stderr
    assert not (folder / "old" / "report.html").exists()


@pytest.mark.parametrize(("asked_for", "left_out"), [(40, False), (80, True)])
def test_how_long_games_of_an_unknown_campaign_were_is_seen_in_them(
    folder: Path, asked_for: int, left_out: bool
) -> None:
    for name, length in (("new", 40), ("old", asked_for)):
        games = [result(n).game.model_copy(update={"plies_asked_for": length}) for n in range(12)]
        write(folder / name / "results.jsonl", [TaskResult(game=game, plies=result(0).plies) for game in games])
    campaign_file(folder / "new")
    campaign_file(folder / "old", "rig.gone = 3")
    told = run(folder / "new", "--compare", folder / "old")
    assert ("Their games have another number of plies" in told.stdout) is left_out


def test_what_cannot_be_done_is_one_sentence_and_leaves_no_page(folder: Path) -> None:
    (folder / "bars.toml").write_text("[compare]\nnothing_worse = true\n")
    for arguments, said in (
        ((folder,), "there is no result of a campaign"),
        ((folder / "new", "--compare", folder), "there is no result of a campaign"),
        ((folder / "new", "--gate", folder / "none.toml"), "cannot be read"),
        ((folder / "new", "--gate", folder / "bars.toml"), "say which, by --compare"),
        (
            (folder / "new", "--out", "/proc/none/page.html"),
            "/proc/none: No such file or directory: choose another file",
        ),
        ((folder / "new", "--out", folder / "new"), "new is a folder: name a file in it with --out"),
        (
            (folder / "new", "--out", folder / "bars.toml"),
            "bars.toml exists and is not the report of a campaign: choose",
        ),
        (
            (folder / "new", "--out", folder / "new" / "results.jsonl"),
            "results.jsonl exists and is not the report of a",
        ),
    ):
        ended = run(*arguments)
        assert ended.exit_code == 2
        assert said in ended.stderr
        assert len(ended.stderr.splitlines()) == 1
    assert not (folder / "new" / "report.html").exists()
