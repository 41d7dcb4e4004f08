"""What the robot can do over a table, and the sentence for a table at which it cannot play."""

from __future__ import annotations

import re

import numpy as np
import pytest

from controller.model.constants import DeltaModel
from controller.model.reach import jacobians_at
from controller.model.workspace import (
    LARGEST_CONDITION,
    NO_WORK,
    WORST_CONDITION,
    BoardDoesNotFit,
    require_fit,
    survey,
    survey_point,
    working_heights,
    workspace,
)
from controller.offline import constrained
from controller.offline.simulation import ConstrainedArm
from hardware.parameters import load_parameters
from hardware.piece_set import PIECE_SHAPES, Kind
from hardware.table import Captured, TableSettings

MODEL = DeltaModel(load_parameters())
DRIVE = MODEL.parameters.drive


def test_heights_are_from_the_lowest_grip_to_the_highest_carry() -> None:
    low, high = working_heights()
    assert low == PIECE_SHAPES[Kind.PAWN].grip_height
    assert high == pytest.approx(0.034 + 0.060 + 0.010)


def test_the_default_table_fits_with_what_it_carries() -> None:
    heaviest = max(shape.mass for shape in PIECE_SHAPES.values())
    found = require_fit(DeltaModel(MODEL.parameters, heaviest), TableSettings())
    assert found.reachable.all()
    assert len(found.places) == 64 + 48
    for name, rows in (("board", slice(0, 64)), ("trays", slice(64, None))):
        print(
            f"{name}: condition of J_c at most {found.condition[rows].max():.2f}, "
            f"holding {found.holding_torque[rows].max():.2f} N m at most, "
            f"margin to the rated torque {found.torque_margin[rows].min():.2f} N m, "
            f"acceleration at least {found.acceleration[rows].min():.1f} m/s²"
        )
    assert found.condition[:64].max() < 2.5
    assert found.condition.max() < LARGEST_CONDITION
    assert found.torque_margin.min() > 0.05
    assert found.acceleration.min() > 15.0  # the default profile's


def test_survey_is_that_of_the_nine_coordinates() -> None:
    """Condition and holding torque again from the paper's own formulation, acceleration by forward dynamics."""
    table, arm = TableSettings(), ConstrainedArm(MODEL)
    found = survey(MODEL, table, (0.02, 0.07))
    assert found.point.shape == (112, 2, 3)
    for place in (0, 7, 27, 60, 64, 111):
        for height in (0, 1):
            point = found.point[place, height]
            np.testing.assert_allclose(point[:2] * (1.0, -1.0), table.xy(found.places[place]), atol=1e-12)
            assert point[2] == pytest.approx(0.47 - found.height[height])
            q = arm.at(point).q
            jacobian = constrained.virtual_jacobian(MODEL, q) @ constrained.tangent(MODEL, q)
            assert found.condition[place, height] == pytest.approx(np.linalg.cond(jacobian), rel=1e-9)
            holding = constrained.gravity_compensation(MODEL, q)
            assert found.holding_torque[place, height] == pytest.approx(np.abs(holding).max(), rel=1e-9)
            assert found.torque_margin[place, height] == pytest.approx(DRIVE.rated_torque - np.abs(holding).max())


def test_acceleration_is_what_the_peak_torque_just_gives() -> None:
    """In the worst direction one servomotor is at its peak, in no direction is it beyond."""
    point = np.array([0.1, -0.08, 0.43])
    arm = ConstrainedArm(MODEL)
    size = survey_point(MODEL, point).acceleration
    state = arm.at(point)
    inverse = jacobians_at(MODEL, point).inverse
    random = np.random.default_rng(3)
    directions = random.normal(size=(3000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    holding = constrained.gravity_compensation(MODEL, state.q)
    inertia = np.stack([arm.torques(state.q, state.v, unit).torque - holding for unit in np.eye(3)], axis=1)
    torque = np.abs(holding + size * directions @ (inertia @ inverse).T)
    assert torque.max() <= DRIVE.peak_torque + 1e-9
    assert torque.max() > 0.99 * DRIVE.peak_torque


def test_where_the_robot_cannot_work_there_is_no_number() -> None:
    assert survey_point(MODEL, np.array([0.5, 0.0, 0.47])) == NO_WORK
    found = survey(MODEL, TableSettings(centre_in_base=(0.12, 0.0, 0.47)))
    assert not found.reachable.all()
    assert np.isinf(found.condition[~found.reachable]).all()
    assert np.isnan(found.torque_margin[~found.reachable]).all()
    assert np.isfinite(found.acceleration[found.reachable]).all()


def test_a_board_too_far_aside_is_refused_with_the_squares_named() -> None:
    table = TableSettings(centre_in_base=(0.25, 0.0, 0.47), tray_rows=1, tray_columns=1, tray_gap=0.001)
    with pytest.raises(BoardDoesNotFit) as caught:
        require_fit(MODEL, table)
    squares = [str(place) for place in caught.value.places if place.on_board]
    assert {"h1", "h8"} <= set(squares)
    assert "a4" not in squares
    expected = (
        "a board of 40.0 mm squares centred at (0.250, 0.000, 0.470) m does not fit: "
        f"{len(squares)} of 64 squares ({', '.join(squares)}) and 1 tray places (R1) are out of reach with the tool "
        "19, 104 mm above the board; use smaller squares or trays, or move the board towards the base's axis"
    )
    assert str(caught.value) == expected


def test_a_tournament_board_fits_only_nearer_to_the_base() -> None:
    with pytest.raises(
        BoardDoesNotFit,
        match=re.escape(
            "a board of 57.0 mm squares centred at (0.000, 0.000, 0.470) m does not fit: 4 tray places (L23, L24, R23, "
            "R24) are too near a singularity (condition of J_c 29.5 at worst, at most 6.0 is allowed) with the tool 19"
        ),
    ):
        require_fit(MODEL, TableSettings(square=0.057))
    assert require_fit(MODEL, TableSettings(square=0.057, centre_in_base=(0.0, 0.0, 0.40))).condition.max() < 6.0


def test_places_that_the_tool_may_not_be_driven_to_are_refused_before_a_game() -> None:
    with pytest.raises(
        BoardDoesNotFit,
        match=r"4 drop points of the boxes \(BL1, BR1, BL16, BR16\) are outside the workspace, which ends 310 mm from",
    ):
        require_fit(MODEL, TableSettings(square=0.048, captured=Captured.BOX))


@pytest.mark.parametrize("depth", [0.39, 0.43, 0.47, 0.50])
def test_the_arm_reaches_as_far_as_jacobians_are_well_conditioned_everywhere(depth: float) -> None:
    room = workspace(MODEL.parameters, TableSettings(centre_in_base=(0.01, -0.02, depth)))
    turns = np.random.default_rng(7).uniform(0.0, 2.0 * np.pi, 300)
    bottom = room.centre[2] + room.half_size[2]

    def worst(radius: float) -> float:
        rim = np.column_stack([radius * np.cos(turns), radius * np.sin(turns), np.full(turns.size, bottom)])
        return max(survey_point(MODEL, point).condition for point in rim)

    assert bottom > depth, "the tool may press a little into the board"
    assert worst(room.reach - 1e-3) < WORST_CONDITION < worst(room.reach + 1e-3)


def test_a_gripper_too_heavy_to_hold_is_refused_by_its_torque() -> None:
    with pytest.raises(
        BoardDoesNotFit,
        match=r"a1, b1.* are too heavy to hold \(up to 3\.\d\d N m, the servomotors are rated for 2\.40 N m\) with",
    ):
        require_fit(DeltaModel(MODEL.parameters, payload=0.5), TableSettings())
