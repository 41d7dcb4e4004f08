"""The commands together: what all of them cost."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.cli.commands import app


def test_commands_are_known_without_what_only_one_of_them_needs() -> None:
    """So that ``--help`` answers at once: Pydantic alone takes as long as all the rest."""
    heavy = ("asyncio", "chess", "numpy", "pydantic", "rich")
    script = f"import sys, app.cli.commands; print([name for name in {heavy} if name in sys.modules])"
    loaded = subprocess.run([sys.executable, "-P", "-c", script], capture_output=True, text=True, check=True)
    assert loaded.stdout.strip() == "[]"


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("campaign", "repeat", "{}", "abc"), "seed is 'abc': it should be a whole number"),
        (("campaign", "repeat", "{}", "--", "-5"), "seed is '-5': it should be at least 0"),
        (("film", "{}/nothing"), "/nothing' does not exist"),
        (("dataset", "{}/nothing", "--out", "{}/set"), "/nothing' does not exist"),
        (("dataset", "{}", "--out", "{}/set"), " holds no recorded game"),
        (("film", "{}"), "there is nothing to film in "),
    ],
)
def test_a_bad_argument_is_one_sentence(tmp_path: Path, arguments: tuple[str, ...], sentence: str) -> None:
    told = CliRunner().invoke(app, [one.format(tmp_path) for one in arguments])
    assert told.exit_code == 2
    assert told.stderr.count("\n") == 1
    assert sentence in told.stderr
