"""``touchmove host`` and ``join``: what is refused before anything is opened, in one sentence."""

from __future__ import annotations

import getpass
from pathlib import Path
from types import SimpleNamespace

import pytest
from typer import Exit
from typer.testing import CliRunner

from app.cli.commands import app
from app.cli.linked import secret_or_end
from app.settings.defaults import LinkSection

RUN = CliRunner()


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("host", "--color", "red"), "touchmove: --color is 'red', choose white or black"),
        (("join", "robot:port"), "touchmove: 'robot:port' is no address of a robot: write HOST or HOST:PORT"),
        (("host",), "touchmove: two robots need a secret that both know, and nobody can type it here: name its file"),
        (("join", "robot", "--secret", "{}/none"), "/none cannot be read (No such file or directory): copy the file"),
        (("host", "--secret", "{}/none/secret"), "cannot be written (No such file or directory): name another file"),
        (("host", "--listen", "everywhere", "--secret", "{}/new"), "link.listen is 'everywhere'"),
        (("join", "robot", "--moves", "e4", "--nodes", "5", "--secret", "{}/new"), "touchmove: --nodes has no effect"),
    ],
)
def test_a_mistake_is_said_in_one_sentence(tmp_path: Path, arguments: tuple[str, ...], sentence: str) -> None:
    told = RUN.invoke(app, [*(one.format(tmp_path) for one in arguments), "--rig", "board", "--no-page"])
    assert told.exit_code == 2
    assert sentence in told.stderr
    assert "Traceback" not in told.stderr


def test_a_secret_that_nobody_types_ends_in_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    def closed(_: str) -> str:
        raise EOFError

    monkeypatch.setattr("app.cli.linked.sys.stdin", SimpleNamespace(isatty=lambda: True))
    monkeypatch.setattr(getpass, "getpass", closed)
    with pytest.raises(Exit) as ended:
        secret_or_end(LinkSection())
    assert ended.value.exit_code == 2


def test_a_host_makes_a_secret_once(tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    arguments = ("host", "--secret", str(secret), "--rig", "board", "--no-page", "--fen", "no position")
    told = RUN.invoke(app, arguments)
    assert told.exit_code == 2
    assert f"touchmove: made a new secret in {secret}: copy this file to the other robot" in told.stderr
    assert secret.stat().st_mode & 0o777 == 0o600
    before = secret.read_text()
    assert before.strip() not in told.stderr
    assert "made a new" not in RUN.invoke(app, arguments).stderr
    assert secret.read_text() == before
