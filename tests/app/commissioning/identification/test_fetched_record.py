"""Which of the records in a run directory is the one that was asked for."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from app.commissioning.identification import survey
from app.commissioning.identification.recording import NoRecord
from controller.settings import CONTROLLER_FILE


class AskedController:
    """Writes its record of tick 1200 as soon as it is asked."""

    def __init__(self, run_dir: Path, writes: bool = True) -> None:
        self._run_dir, self._writes = run_dir, writes

    def record(self) -> int:
        if self._writes:
            (self._run_dir / "record-1203.npz").touch()
        return 1200


@pytest.fixture
def run_dir(tmp_path: Path) -> Path:
    """Of a second controller; the first one's clock had come further, and its motions had the same numbers."""
    for number, name in enumerate(("record-35187.npz", "record-800.npz", CONTROLLER_FILE)):
        (tmp_path / name).touch()
        os.utime(tmp_path / name, ns=(number, number))
    os.utime(tmp_path / "record-800.npz", ns=(10, 10))
    return tmp_path


def test_the_record_of_an_earlier_controller_is_none(run_dir: Path) -> None:
    client: object = AskedController(run_dir)
    assert survey.fetch_record(client, run_dir).name == "record-1203.npz"  # type: ignore[arg-type]


def test_where_none_comes_it_is_said(run_dir: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(survey, "_FILE_PATIENCE", 0.05)
    client: object = AskedController(run_dir, writes=False)
    with pytest.raises(NoRecord, match="the controller's record did not appear in"):
        survey.fetch_record(client, run_dir)  # type: ignore[arg-type]
