"""The robot of a record: what was written is what is read, and what cannot be read is a sentence."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.records import ROBOT_FILE, RecordError, RobotRecord, kept_robot
from app.records.robot import keep_robot
from hardware.parameters import load_parameters
from hardware.table import Captured, TableSettings


def test_what_is_kept_comes_back(tmp_path: Path) -> None:
    assert kept_robot(tmp_path) is None
    for table in (TableSettings(), TableSettings(square=0.05, captured=Captured.BOX, yaw_in_base=0.01)):
        robot = RobotRecord(parameters=load_parameters(), table=table)
        keep_robot(tmp_path, robot)
        assert kept_robot(tmp_path) == robot
    hung = RobotRecord(
        parameters=load_parameters(), table=TableSettings(),
        board_from_camera=((1.0, 0.0, 0.0, 0.1), (0.0, -1.0, 0.0, -0.4), (0.0, 0.0, -1.0, 0.9)),
    )  # fmt: skip
    keep_robot(tmp_path, hung)
    assert kept_robot(tmp_path) == hung


def test_what_cannot_be_read_is_a_sentence(tmp_path: Path) -> None:
    path = tmp_path / ROBOT_FILE
    path.write_text('{"parameters": {}}')
    with pytest.raises(RecordError, match=r"robot.json is of another version: read it with the version that wrote it$"):
        kept_robot(tmp_path)
    for damaged in ("", "[]", "{"):
        path.write_text(damaged)
        with pytest.raises(RecordError, match=r"robot.json is damaged: bring it back from a copy, or delete it: then"):
            kept_robot(tmp_path)
    path.unlink()
    assert kept_robot(tmp_path) is None, "as the sentence says"
    path.mkdir()
    with pytest.raises(RecordError, match=r"robot\.json cannot be read: Is a directory"):
        kept_robot(tmp_path)
