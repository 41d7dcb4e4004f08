"""Boxes for captured pieces: their places, where they stand, and what becomes of pieces that fall into them."""

from __future__ import annotations

import math
from itertools import product

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from controller.model.constants import DeltaModel
from controller.model.workspace import BoardDoesNotFit, require_fit, seated
from hardware.parameters import load_parameters
from hardware.piece_set import PIECE_SHAPES, Colour, Kind
from hardware.sim.bodies.placed import StandingPiece
from hardware.sim.bodies.scene import LINING, build_model, camera_poses, deck_half_size
from hardware.sim.plant.plant import Plant
from hardware.table import BOX_ZONES, Captured, PieceSpec, Place, TableSettings

TABLE = TableSettings(captured=Captured.BOX)
PARAMETERS = load_parameters()
HEAVIEST = max(shape.mass for shape in PIECE_SHAPES.values())
HOME = np.array([0.0, 0.075, 0.325])
ABOVE = TABLE.box_fill + 0.006
ARMY = (*8 * (Kind.PAWN,), *2 * (Kind.ROOK, Kind.KNIGHT, Kind.BISHOP), Kind.QUEEN)


@pytest.mark.parametrize("place", TABLE.box_places())
def test_places_of_a_box_are_written_and_read(place: Place) -> None:
    assert Place.parse(str(place)) == place
    assert place.in_box
    assert not place.on_board


@pytest.mark.parametrize("text", ["B1", "BL", "BL0", "BL01", "BX3", "bl3", "BL-1", "BRR1"])
def test_what_is_no_place_of_a_box_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=f"^'{text}' is not a place; places are e4, L3, R24 or BL7$"):
        Place.parse(text)


def test_places_beyond_the_last_are_named() -> None:
    last = "trays are L1 to L12 and R1 to R12, boxes BL1 to BL24 and BR1 to BR24"
    for place in (Place("BL", 24), Place("BR", -1), Place("L", 12)):
        with pytest.raises(ValueError, match=f"^there is no place {place}: {last}$"):
            TABLE.xy(place)
    with pytest.raises(ValueError, match=r"^there is no place BL1: trays are L1 to L24 and R1 to R24$"):
        TableSettings().xy(Place("BL", 0))
    with pytest.raises(ValueError, match=r"^R3 is not in a box$"):
        TABLE.box_of(Place("R", 2))


def test_both_boxes_are_filled_point_by_point_before_any_point_again() -> None:
    places, points = TABLE.box_places(), 2 * TABLE.box_points
    assert len(places) == len(set(places)) == 48
    assert TABLE.drop_points() == places[: 2 * points]
    for turn in range(TABLE.box_rounds):
        part = places[turn * points : (turn + 1) * points]
        assert {TABLE.box_round(place) for place in part} == {turn}
        same = places[turn % 2 * points :]
        assert [TABLE.xy(place) for place in part] == [TABLE.xy(place) for place in same[:points]]
    for first, second in zip(places[:points], places[points : 2 * points], strict=True):
        assert TABLE.xy(second)[1] - TABLE.xy(first)[1] == pytest.approx(TABLE.box_pitch / 2.0)


def test_a_table_with_trays_alone_has_no_boxes() -> None:
    table = TableSettings()
    assert table.captured is Captured.TRAY
    assert table.boxes() == table.box_places() == table.drop_points() == ()


@given(
    square=st.floats(0.030, 0.060),
    points=st.integers(1, 12),
    rounds=st.integers(1, 5),
    pitch=st.floats(0.025, 0.06),
    width=st.floats(0.03, 0.10),
    gap=st.floats(0.001, 0.05),
    columns=st.integers(2, 4),
)
def test_pieces_are_dropped_between_the_walls_and_beside_everything_else(
    square: float, points: int, rounds: int, pitch: float, width: float, gap: float, columns: int
) -> None:
    table = TableSettings(
        captured=Captured.BOX, square=square, box_points=points, box_rounds=rounds, box_pitch=pitch, box_width=width,
        box_gap=gap, tray_columns=columns,
    )  # fmt: skip
    foot = max(shape.foot_radius for shape in PIECE_SHAPES.values())
    assert len(table.box_places()) == 2 * points * rounds
    for place in table.box_places():
        box, (x, y) = table.box_of(place), table.xy(place)
        assert box.zone == place.zone
        assert all(box.holds(x + dx, y + dy) for dx, dy in product((-1e-4 - foot / 2, foot / 2), repeat=2))
        assert math.copysign(1.0, x) == (-1.0 if place.zone == "BL" else 1.0)
    left, right = table.boxes()
    assert (left.x, left.y, left.half_x) == (-right.x, right.y, right.half_x)
    inner = right.x - right.half_x - right.wall
    for tray in table.tray_places():
        assert abs(table.xy(tray)[0]) <= inner - gap + 1e-12
    assert table.half_width == pytest.approx(right.x + right.half_x + right.wall)


def test_boxes_want_a_column_for_the_spares() -> None:
    with pytest.raises(ValidationError, match="make tray_columns 2 or more"):
        TableSettings(captured=Captured.BOX, tray_columns=1)


def test_an_army_has_room_without_a_heap_above_the_walls() -> None:
    """Fifteen pieces lie as loosely as spheres dropped at random, or more so, below the walls."""
    volume = sum(math.pi * PIECE_SHAPES[kind].foot_radius ** 2 * PIECE_SHAPES[kind].height for kind in ARMY)
    for box in TABLE.boxes():
        assert volume < 0.55 * 4.0 * box.half_x * box.half_y * box.height


def test_the_arm_reaches_every_drop_point() -> None:
    found = require_fit(DeltaModel(PARAMETERS, HEAVIEST), TABLE)
    assert set(TABLE.drop_points()) <= set(found.places)


def test_drop_points_out_of_reach_are_named_and_a_larger_board_is_moved_up() -> None:
    model = DeltaModel(PARAMETERS, HEAVIEST)
    with pytest.raises(BoardDoesNotFit, match=r"\d+ drop points of the boxes \(BL.*BR.*\) are") as caught:
        require_fit(model, TABLE.model_copy(update={"box_gap": 0.080}))
    assert any(place.in_box for place in caught.value.places)
    larger = seated(model, TABLE.model_copy(update={"square": 0.050}))
    assert larger.centre_in_base[2] < TABLE.centre_in_base[2]
    require_fit(model, larger)


def test_open_fingers_beside_a_box_touch_nothing() -> None:
    """A spare 3 mm off, taken with the fingers as wide as the gripper opens for it."""
    pads, stem = PARAMETERS.pads, max(shape.stem_radius for shape in PIECE_SHAPES.values())
    depth = pads.half_width * math.tan(pads.groove_angle)
    widest = stem / math.cos(pads.groove_angle) - depth + 0.0065
    box = TABLE.boxes()[1]
    spare = max(TABLE.xy(place)[0] for place in TABLE.tray_places())
    assert spare + 0.003 + widest + depth + pads.back < box.x - box.half_x - box.wall


def fallen(seed: int, rounds: int) -> Plant:
    """A world at rest after pieces were let go over all points of both boxes, so many rounds above each other."""
    rng = np.random.default_rng(seed)
    kinds = rng.permutation(np.array([kind.value for kind in 2 * ARMY]))
    places = TABLE.box_places()[: min(len(kinds), 16 * rounds)]
    pieces = []
    for kind, place in zip(kinds, places, strict=False):
        x, y = np.add(TABLE.xy(place), rng.normal(0.0, 0.0005, 2)).tolist()
        height = ABOVE + 0.062 * TABLE.box_round(place)  # right above the one before: a harder fall than any in a game
        spec = PieceSpec(str(place), Kind(kind), Colour.BLACK, place)
        pieces.append(StandingPiece(spec, x, y, float(rng.uniform(-3.0, 3.0)), height))
    model = build_model(PARAMETERS, TABLE, tuple(pieces), HOME, looks=False)
    plant = Plant(model, PARAMETERS, tuple(piece.spec.name for piece in pieces), boxes=TABLE.boxes())
    for _ in range(4000):
        plant.step()
        if plant.tick > 700 and plant.resting:
            return plant
    raise AssertionError("the heap did not come to rest")


@pytest.mark.parametrize("seed", range(3))
def test_what_falls_into_a_box_stays_there_below_what_the_arm_clears_and_comes_to_rest(seed: int) -> None:
    plant = fallen(seed, rounds=2)
    boxes = {box.zone: box for box in TABLE.boxes()}
    assert len(plant.truth(False).pieces) == 30
    for pose in plant.truth(False).pieces:
        place = Place.parse(pose.name)
        box = boxes[place.zone]
        assert box.holds(pose.x, pose.y), pose
        assert -0.001 < pose.z < box.height, pose
    for name in (pose.name for pose in plant.truth(False).pieces):
        body = plant.data.body(name)
        for geom in (f"{name}.foot", f"{name}.stem"):
            at = plant.model.geom(geom).id
            up = plant.data.geom_xmat[at].reshape(3, 3)[2]
            size = plant.model.geom_size[at]
            stem = plant.model.geom_type[at] == mujoco.mjtGeom.mjGEOM_CAPSULE
            reach = size[0] + abs(up[2]) * size[1] if stem else float(np.abs(up) @ size)
            assert plant.data.geom_xpos[at, 2] + reach < TABLE.box_fill, (name, body.xpos)


@pytest.mark.parametrize("kind", [Kind.PAWN, Kind.QUEEN])
def test_a_piece_that_falls_on_the_lining_hardly_bounces_and_does_not_reach_the_wood_below(kind: Kind) -> None:
    place = TABLE.box_places()[3]
    piece = StandingPiece(PieceSpec("it", kind, Colour.WHITE, place), *TABLE.xy(place), 0.4, ABOVE)
    plant = Plant(build_model(PARAMETERS, TABLE, (piece,), HOME, looks=False), PARAMETERS, ("it",))
    heights = []
    for _ in range(800):
        plant.step()
        heights.append(plant.truth(False).pieces[0].z)
    landed = next(i for i, z in enumerate(heights) if z < LINING)
    assert landed * PARAMETERS.drive.tick == pytest.approx(math.sqrt(2.0 * (ABOVE - LINING) / 9.81), abs=0.003)
    assert max(heights[landed:]) - LINING < ABOVE / 20.0
    assert min(heights) > 0.0
    assert heights[-1] == pytest.approx(LINING, abs=2e-4)


def test_a_fall_repeats_to_the_last_bit() -> None:
    assert fallen(5, rounds=1).digest() == fallen(5, rounds=1).digest()


def test_a_fall_into_a_box_is_no_force_of_the_robot() -> None:
    assert fallen(2, rounds=1).truth(False).peak_contact_force < 0.5


def test_walls_and_floor_are_there_for_arm_and_eye() -> None:
    bare = build_model(PARAMETERS, TABLE, (), HOME, looks=False)
    seen = build_model(PARAMETERS, TABLE, (), HOME)
    trays = build_model(PARAMETERS, TableSettings(), (), HOME)
    for zone in BOX_ZONES:
        for name in (*(f"wall.{zone}.{side}" for side in "abcd"), f"lining.{zone}"):
            geom = bare.geom(name)
            assert (geom.contype[0], geom.conaffinity[0]) == (1, 3), "pieces and tool meet it"
            assert seen.geom(name).rgba[3] == 1.0
            pairs = {frozenset((bare.pair_geom1[i], bare.pair_geom2[i])) for i in range(bare.npair)}
            assert frozenset((geom.id, bare.geom("bar_left").id)) in pairs
    names = [trays.geom(i).name for i in range(trays.ngeom)]
    assert not any(name.startswith(("wall.", "lining.")) for name in names)


def test_the_camera_steps_back_until_it_sees_the_boxes() -> None:
    ratio = deck_half_size(TABLE)[0] / deck_half_size(TableSettings())[0]
    assert ratio > 1.0
    for name, pose in camera_poses(TABLE).items():
        np.testing.assert_allclose(pose.position, ratio * np.array(camera_poses(TableSettings())[name].position))
