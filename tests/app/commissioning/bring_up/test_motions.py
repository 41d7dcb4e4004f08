"""What motions say of the arm is judged against bars; where they lead stays within the workspace."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from app.commissioning.bring_up.motion_judgement import (
    Followed,
    HeldPose,
    followed_of,
    judge_gravity,
    judge_tracking,
    judge_workspace,
)
from app.commissioning.bring_up.motions import edge_points, grid_points
from app.commissioning.check_report import CheckState, Finding
from app.commissioning.identification.survey import borders_of
from controller.model.constants import DeltaModel
from controller.model.reach import posture_at
from controller.records.flight_file import FLIGHT
from hardware.parameters import load_parameters
from hardware.table import TableSettings

ROBOT, TABLE = load_parameters(), TableSettings()


def wrong(findings: list[Finding]) -> list[str]:
    return [f"{one.device} {one.what}" for one in findings if one.state is CheckState.WRONG]


def held(count: int = 4) -> list[HeldPose]:
    model = DeltaModel(ROBOT)
    found = []
    for point in grid_points(ROBOT, TABLE)[:count]:
        one = HeldPose.at(model, point, point, posture_at(model, point).y, np.zeros(3))
        found.append(replace(one, torque=one.gravity))
    return found


@pytest.mark.parametrize("points", [edge_points(ROBOT, TABLE), grid_points(ROBOT, TABLE)])
def test_all_points_are_within_the_workspace(points: np.ndarray) -> None:
    borders = borders_of(ROBOT, TABLE)
    assert (points >= np.array(borders.low) - 1e-9).all()
    assert (points <= np.array(borders.high) + 1e-9).all()
    assert np.hypot(*points[:, :2].T).max() <= borders.reach + 1e-9
    assert np.ptp(points[:, :2], axis=0).min() > 0.2


def test_an_arm_off_its_place_or_too_heavy_to_hold_is_found() -> None:
    good = held()
    assert wrong(judge_workspace(good, ROBOT)) == []
    assert wrong(judge_workspace([replace(good[0], error=0.002), *good[1:]], ROBOT)) == ["arm home"]
    assert wrong(judge_workspace([*good[:3], replace(good[3], error=0.002)], ROBOT)) == ["arm edges"]
    heavy = replace(good[1], torque=np.array([0.0, 2.5, 0.0]))
    assert wrong(judge_workspace([good[0], heavy], ROBOT)) == ["arm holding torque"]


def test_gravity_is_judged_by_axis_and_more_strictly_once_identified() -> None:
    good = held()
    off = [replace(one, torque=one.gravity + np.array([0.0, 0.2, 0.0])) for one in good]
    assert wrong(judge_gravity(good, ROBOT, identified=True)) == []
    assert wrong(judge_gravity(off, ROBOT, identified=False)) == []
    assert wrong(judge_gravity(off, ROBOT, identified=True)) == ["axis 2 gravity"]
    far = [replace(one, torque=2.0 * one.gravity) for one in good]
    assert wrong(judge_gravity(far, ROBOT, identified=False)) == ["axis 1 gravity", "axis 2 gravity", "axis 3 gravity"]


def test_tracking_board_and_touch_have_a_bar_each() -> None:
    good = Followed(worst=0.0004, mean=0.0001, peak=4.0)
    assert wrong(judge_tracking(good, 0.001, 5.0)) == []
    assert wrong(judge_tracking(replace(good, worst=0.0011), 0.001, 5.0)) == ["arm tracking"]
    assert wrong(judge_tracking(good, -0.0031, 5.0)) == ["arm board"]
    assert wrong(judge_tracking(good, 0.0, 14.0)) == ["arm touch"]


@pytest.mark.parametrize("height", [0.0052, -0.0104])
def test_what_is_said_of_a_board_that_lies_higher_or_lower_puts_it_right(height: float) -> None:
    """Where the pads touched, in a table as it is believed and in one as it was told to be corrected."""
    touched = TABLE.base_from_board(np.array([0.0, 0.0, height]))
    advice = judge_tracking(Followed(0.0004, 0.0001, 4.0), height, 5.0)[1].advice
    found = re.match(r"add ([+-]\d\.\d+) to the third number of centre_in_base", advice)
    assert found is not None
    x, y, z = TABLE.centre_in_base
    corrected = TABLE.model_copy(update={"centre_in_base": (x, y, z + float(found[1]))})
    assert corrected.board_from_base(touched)[2] == pytest.approx(0.0, abs=1e-4)


def test_of_a_record_the_stiff_ticks_of_these_motions_count() -> None:
    rows = np.zeros(6, dtype=FLIGHT.dtype)
    rows["motion"] = [1, 2, 2, 3, 3, 4]
    rows["stiffness"] = 4900.0
    rows["stiffness"][2] = 400.0
    rows["reference_velocity"][:, 0] = 0.5
    rows["position"][:, 1] = [9.0, 0.0001, 9.0, 0.0003, 0.0002, 9.0]
    rows["torque"][:, 2] = [9.0, -3.0, 1.0, 2.0, 1.0, 9.0]
    found = followed_of(rows, 2, 3)
    assert (found.worst, found.mean, found.peak) == pytest.approx((0.0003, 0.0002, 3.0))
