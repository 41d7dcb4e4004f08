"""A dataset appears as a whole, or not at all."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import pytest

from app.dataset.staging import appearing
from app.records.files import RecordError


def test_a_folder_appears_when_all_went_well(tmp_path: Path) -> None:
    with appearing(tmp_path / "deep" / "set") as folder:
        (folder / "a").write_text("1")
        assert not (tmp_path / "deep" / "set").exists()
    assert [path.name for path in (tmp_path / "deep").rglob("*")] == ["set", "a"]


def test_nothing_is_left_where_it_did_not(tmp_path: Path) -> None:
    with ExitStack() as leaving:
        leaving.enter_context(pytest.raises(KeyboardInterrupt))
        (leaving.enter_context(appearing(tmp_path / "set")) / "a").write_text("1")
        raise KeyboardInterrupt
    assert not list(tmp_path.iterdir())


def test_what_a_killed_program_left_is_written_anew(tmp_path: Path) -> None:
    left = tmp_path / "set.part"
    (left / "data").mkdir(parents=True)
    (left / ".being-written").touch()
    (left / "data" / "half").touch()
    with appearing(tmp_path / "set") as folder:
        assert not (folder / "data").exists()
    assert not list((tmp_path / "set").iterdir())


def test_what_is_there_is_not_touched(tmp_path: Path) -> None:
    (tmp_path / "set").mkdir()
    with pytest.raises(RecordError, match="set is there already: choose another folder with --out, or delete it"):
        appearing(tmp_path / "set").__enter__()
    (tmp_path / "other.part").mkdir()
    with pytest.raises(RecordError, match=r"other\.part is there, and no dataset left unfinished"):
        appearing(tmp_path / "other").__enter__()


def test_two_do_not_write_one(tmp_path: Path) -> None:
    with appearing(tmp_path / "set"), pytest.raises(RecordError, match="is being written by another program"):
        appearing(tmp_path / "set").__enter__()
    assert (tmp_path / "set").is_dir()
