"""Board, trays and pieces: where places lie, that they lie apart and in reach, and frames."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from hardware.contact_speeds import ContactSpeeds
from hardware.parameters import load_parameters
from hardware.piece_set import PIECE_SHAPES, Kind
from hardware.sim.bodies.arm import inverse_kinematics
from hardware.table import MOST_YAW, Place, TableSettings, square_place

TABLE = TableSettings()
SQUARES = [square_place(i) for i in range(64)]
PLACES = [*SQUARES, *TABLE.tray_places()]
WIDEST = max(shape.foot_radius for shape in PIECE_SHAPES.values())


@pytest.mark.parametrize(
    ("square", "name", "xy"),
    [(0, "a1", (-0.14, -0.14)), (7, "h1", (0.14, -0.14)), (28, "e4", (0.02, -0.02)), (63, "h8", (0.14, 0.14))],
)
def test_squares_have_names_and_centres(square: int, name: str, xy: tuple[float, float]) -> None:
    place = square_place(square)
    assert str(place) == name
    assert place.on_board
    assert TABLE.xy(place) == pytest.approx(xy)


def test_tray_places_are_numbered_from_1_beside_the_board() -> None:
    places = TABLE.tray_places()
    assert len(places) == 2 * TABLE.tray_size == len(set(places)) == 48
    assert [str(place) for place in (places[0], places[23], places[24], places[47])] == ["L1", "L24", "R1", "R24"]
    assert not places[0].on_board
    assert TABLE.xy(Place("R", 0)) == pytest.approx((0.16 + 0.030, -5.5 * 0.030))
    assert TABLE.xy(Place("R", 12)) == pytest.approx((0.16 + 0.030 + 0.038, -5.5 * 0.030))  # the next column outwards
    for left, right in zip(places[:24], places[24:], strict=True):
        x, y = TABLE.xy(right)
        assert TABLE.xy(left) == (-x, y)


@pytest.mark.parametrize(
    ("place", "said"),
    [
        (Place("board", 64), r"square 64 is not on the board: 0 \(a1\) to 63 \(h8\)"),
        (Place("board", -1), r"square -1 is not on the board: 0 \(a1\) to 63 \(h8\)"),
        (Place("L", 24), "there is no place L25: trays are L1 to L24 and R1 to R24"),
        (Place("R", -1), "there is no place R0: trays are L1 to L24 and R1 to R24"),
        (Place("M", 0), "there is no place M1: trays are L1 to L24 and R1 to R24"),
    ],
)
def test_places_that_are_not_there(place: Place, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        TABLE.xy(place)
    if place.on_board:
        with pytest.raises(ValueError, match=said):
            square_place(place.index)


def test_feet_on_neighbouring_places_do_not_touch() -> None:
    for one, other in itertools.combinations(PLACES, 2):
        (x, y), (u, v) = TABLE.xy(one), TABLE.xy(other)
        assert math.hypot(x - u, y - v) > 2.0 * WIDEST + 0.002, f"{one} and {other}"


def test_the_arm_reaches_every_place_at_every_height() -> None:
    for place in PLACES:
        x, y = TABLE.xy(place)
        for height in (0.015, 0.10):
            joints = inverse_kinematics(load_parameters(), TABLE.base_from_board(np.array([x, y, height])))
            assert np.isfinite(joints).all()


def test_frames_share_x_and_look_down_on_each_other() -> None:
    np.testing.assert_allclose(TABLE.base_from_board(np.zeros(3)), TABLE.centre_in_base)
    np.testing.assert_allclose(TABLE.base_from_board(np.array([0.1, 0.2, 0.3])), [0.1, -0.2, 0.47 - 0.3])
    rotation = TABLE.base_from_board(np.eye(3)) - TABLE.base_from_board(np.zeros(3))
    assert np.linalg.det(rotation) == pytest.approx(1.0)  # a rotation, not a mirror


@given(
    point=st.tuples(*[st.floats(-1.0, 1.0)] * 3),
    centre=st.tuples(*[st.floats(-0.5, 0.5)] * 3),
    rows=st.integers(0, 4),
    yaw=st.floats(-MOST_YAW, MOST_YAW),
)
def test_frames_map_there_and_back(
    point: tuple[float, float, float], centre: tuple[float, float, float], rows: int, yaw: float
) -> None:
    table = TableSettings(centre_in_base=centre, yaw_in_base=yaw)
    points = np.broadcast_to(np.array(point), (rows, 3))
    np.testing.assert_allclose(table.board_from_base(table.base_from_board(points)), points, atol=1e-12)
    homogeneous = np.column_stack([points, np.ones(rows)]) @ table.pose_in_base().T
    np.testing.assert_allclose(table.base_from_board(points), homogeneous[:, :3], atol=1e-12)


@pytest.mark.parametrize("kind", Kind)
def test_pads_grip_the_stem_of_every_piece(kind: Kind) -> None:
    shape, pads, gripper = PIECE_SHAPES[kind], load_parameters().pads, load_parameters().gripper
    assert shape.foot_height < shape.grip_height - pads.half_height  # above the foot
    assert shape.grip_height + pads.half_height < shape.height - 0.3 * shape.stem_radius  # below the top
    depth = pads.half_width * math.tan(pads.groove_angle)
    assert 0.0 < math.sqrt(2.0) * shape.stem_radius - depth < gripper.stroke  # by the faces
    assert shape.stem_radius + 0.005 < gripper.stroke  # opens around a piece 3 mm off its centre
    assert shape.stem_radius < shape.foot_radius


def test_the_set_is_that_of_a_60_mm_king() -> None:
    heights = {kind: shape.height for kind, shape in PIECE_SHAPES.items()}
    assert set(heights) == set(Kind)
    assert max(heights, key=lambda kind: heights[kind]) is Kind.KING
    assert heights[Kind.KING] == 0.060
    assert min(heights, key=lambda kind: heights[kind]) is Kind.PAWN
    assert all(0.005 < shape.mass < 0.05 for shape in PIECE_SHAPES.values())


def test_contact_limits_stay_below_the_standard() -> None:
    limits = ContactSpeeds()
    assert limits.downward_speed <= 0.45  # 138 N clamped, of 140 N allowed
    assert limits.tool_speed <= 0.8
    assert limits.near_height >= 0.09


@pytest.mark.parametrize(
    "wrong",
    [{"square": 0.0}, {"square": math.inf}, {"tray_rows": 0}, {"sqare": 0.05}, {"limits": {"tool_speed": -1.0}},
     {"centre_in_base": (0.0, math.nan, 0.4)}],
)  # fmt: skip
def test_impossible_tables_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        TableSettings.model_validate(wrong)
