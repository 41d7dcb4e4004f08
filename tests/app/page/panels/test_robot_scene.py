"""robot.json: numbers for the browser that agree with the robot, the table and the pieces."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from app.motion.settings import MotionSettings
from app.page.robot_scene import robot_scene
from app.scene.arm import arm_joints
from controller.model.constants import DeltaModel
from hardware.parameters import load_parameters
from hardware.piece_set import PIECE_SHAPES, Kind
from hardware.table import Captured, Place, TableSettings

TICK = 0.00088


def scene(table: TableSettings) -> dict[str, Any]:
    made: dict[str, Any] = json.loads(json.dumps(robot_scene(load_parameters(), table, MotionSettings().home, TICK)))
    return made


@pytest.mark.parametrize("captured", Captured)
def test_places_in_the_boards_frame_come_to_where_the_arm_finds_them(captured: Captured) -> None:
    table = TableSettings(captured=captured, yaw_in_base=0.03)
    shown = scene(table)["table"]
    pose = np.array(shown["pose"])
    for name in ("a1", "h8", "L1", "R12"):
        point = np.array([*shown["places"][name], 0.0, 1.0])
        expected = table.base_from_board(np.array([*table.xy(Place.parse(name)), 0.0]))
        assert (pose @ point)[:3] == pytest.approx(expected, abs=2e-6)
    assert len(shown["boxes"]) == (2 if captured is Captured.BOX else 0)


def test_the_arm_rests_at_home() -> None:
    home = scene(TableSettings())["home"]
    a, b, c = home["angles"]
    assert arm_joints(DeltaModel(load_parameters()), (a, b, c)).tool == pytest.approx(home["tool"], abs=1e-9)


@pytest.mark.parametrize("kind", Kind)
def test_a_piece_is_as_high_as_it_is(kind: Kind) -> None:
    shown = scene(TableSettings())["kinds"][kind.value]
    tops = [height for _, height in shown["outline"]]
    tops += [height for _, height in shown.get("head", {}).get("outline", [])]
    tops += [block["height"] + block["size"][2] / 2.0 for block in shown.get("blocks", [])]
    assert max(tops) == pytest.approx(PIECE_SHAPES[kind].height, abs=0.0005)
    assert shown["grip"] < shown["height"]
