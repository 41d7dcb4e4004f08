"""Figures as such: bars, files, the command, and that the pictures in the docs are of today's numbers."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from app import UserError
from app.cli.commands import app as command_line
from app.measure import names
from app.measure.figures import FIGURES, make_figure
from app.measure.figures.drawing import axes, picture
from app.measure.figures.result import Bar, FigureResult, FolderUnusable, save

ROOT = Path(__file__).resolve().parents[4]
PICTURES = ROOT / "docs" / "pictures"


def sketch(value: float = 1.0) -> FigureResult:
    sheet = picture(3.0, 2.0)
    axes(sheet)[0].plot([0.0, value], [0.0, 1.0])
    return FigureResult(
        "A line", {"length": Bar(value, "m", 0.5, 2.0)}, {"n": 1}, {"": sheet, "-more": picture(1.0, 1.0)}
    )


def test_a_bar_holds_within_its_range() -> None:
    assert Bar(1.0, "m", 1.0, 2.0).holds
    assert Bar(2.0, "m", 1.0, 2.0).holds
    assert not Bar(2.1, "m", 1.0, 2.0).holds
    assert not Bar(np.nan, "m", high=2.0).holds
    assert Bar(0.5, "m", high=1.0).as_json() == {"value": 0.5, "unit": "m", "low": None, "high": 1.0, "holds": True}


def test_pictures_and_numbers_lie_side_by_side_and_repeat_to_the_byte(tmp_path: Path) -> None:
    content = save("line", sketch(), tmp_path / "a")
    assert content == json.loads((tmp_path / "a" / "figure-line.json").read_text())
    assert content["pictures"] == ["figure-line.png", "figure-line-more.png"]
    assert content["holds"] is True
    save("line", sketch(), tmp_path / "b")
    for name in ("figure-line.png", "figure-line-more.png", "figure-line.json"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    assert save("line", sketch(3.0), tmp_path / "c")["holds"] is False


def test_a_folder_that_cannot_be_written_is_named_with_the_remedy(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(
        FolderUnusable, match=r"^pictures cannot be written to .*/file: .*; choose another folder with --o"
    ):
        save("line", sketch(), tmp_path / "file")


def test_an_unknown_figure_is_refused_with_the_choices(tmp_path: Path) -> None:
    assert set(names.FIGURES) == {*FIGURES, "move"}
    sentence = "there is no figure '8', choose from: 5, 6, 7, 9, newton, encoder, touch, workspace, separation, move"
    with pytest.raises(UserError, match=f"^{sentence}$"):
        make_figure("8", tmp_path, print)
    done = CliRunner().invoke(command_line, ["figures", "8", "--out", str(tmp_path)])
    assert done.exit_code == 2
    assert done.stderr.endswith(f"touchmove: {sentence}\n")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("move", "what"), [("", "no move"), ("1.", "no move"), ("e4 e5", "a line of moves")])
def test_the_figure_of_a_move_shows_one_move(move: str, what: str, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=f"^'{move}' is {what}: give one move, such as e4 or e2e4$"):
        make_figure("move", tmp_path, print, move)


@pytest.mark.parametrize(("value", "status"), [(1.0, 0), (3.0, 1)])
def test_the_command_prints_one_object_and_says_by_its_status_whether_it_holds(
    value: float, status: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.measure.names.FIGURES", ("line",))
    monkeypatch.setattr("app.measure.figures.FIGURES", {"line": lambda progress: sketch(value)})
    done = CliRunner().invoke(command_line, ["figures", "line", "--out", str(tmp_path), "--json"])
    assert done.exit_code == status
    assert json.loads(done.stdout) == json.loads((tmp_path / "figure-line.json").read_text())
    plain = CliRunner().invoke(command_line, ["figures", "line", "--out", str(tmp_path)])
    assert ("does not hold" in plain.stdout) is (status == 1)


@pytest.mark.parametrize("name", sorted(FIGURES))
def test_the_docs_show_every_figure_and_it_holds(name: str) -> None:
    content = json.loads((PICTURES / f"figure-{name}.json").read_text())
    assert content["figure"] == name
    assert content["holds"] is True
    page = (ROOT / "docs" / "results.md").read_text()
    for file in content["pictures"]:
        assert (PICTURES / file).stat().st_size < 300_000
        assert f"pictures/{file}" in page


@pytest.mark.parametrize("name", ["newton", "encoder", "workspace", "9", "move"])
def test_the_numbers_in_the_docs_are_those_of_today(name: str, tmp_path: Path) -> None:
    shown = json.loads((PICTURES / f"figure-{name}.json").read_text())
    assert close(json.loads(json.dumps(make_figure(name, tmp_path, print))), shown)


NUMBER = re.compile(r"\d+\.\d+")


def numbers_in(text: str) -> list[float]:
    return [float(number) for number in NUMBER.findall(text)]


def close(one: object, other: object) -> bool:
    """Equal but for what another processor's rounding can do."""
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(close(one[key], other[key]) for key in one)
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(close, one, other))
    if isinstance(one, str) and isinstance(other, str):  # numbers in titles are rounded
        return NUMBER.split(one) == NUMBER.split(other) and close(numbers_in(one), numbers_in(other))
    if isinstance(one, float | int) and isinstance(other, float | int):
        return one == pytest.approx(other, rel=2e-2, abs=1e-9)
    return one == other
